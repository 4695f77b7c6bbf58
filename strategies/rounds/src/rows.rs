//! Votes as fusion rules take them.

use gestalt_protocol::Vote;

/// One row of evidence per vote, all of one length. Where any of the robots can tell what is unknown, that is the last class of all.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Rows {
    /// How many values each has: the gestures of the list, and "unknown" where it is one.
    pub classes: usize,
    rows: Vec<Vec<f32>>,
}

impl Rows {
    /// Those of votes over so many gestures. Who cannot tell what is unknown speaks neither for nor against it: to such a robot it is as likely as
    /// the likeliest gesture.
    pub fn of<'a>(gestures: usize, votes: impl Iterator<Item = &'a Vote> + Clone) -> Self {
        let tells = votes.clone().any(|vote| vote.unknown.is_some());
        let row = |vote: &Vote| {
            let mut row = vote.evidence.clone();
            if tells {
                let likeliest = row.iter().copied().fold(f32::NEG_INFINITY, f32::max);
                row.push(vote.unknown.unwrap_or(likeliest));
            }
            row
        };
        Self { classes: gestures + usize::from(tells), rows: votes.map(row).collect() }
    }

    /// As a rule takes them.
    pub fn as_slices(&self) -> Vec<&[f32]> {
        self.rows.iter().map(Vec::as_slice).collect()
    }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::{RobotId, RoundId, VocabularyId};

    use super::*;

    #[test]
    fn who_cannot_tell_what_is_unknown_neither_supports_nor_denies_it() {
        let round = RoundId { counter: 1, opener: RobotId(1), life: 0 };
        let vote = |evidence: [f32; 2], unknown| Vote {
            round,
            vocabulary: VocabularyId(1),
            evidence: evidence.to_vec(),
            looks: 1.0,
            unknown,
        };
        let silent = [vote([1.0, -1.0], None)];
        assert_eq!(Rows::of(2, silent.iter()).as_slices(), [[1.0, -1.0]]);
        let both = [vote([1.0, -1.0], None), vote([2.0, -2.0], Some(-3.0))];
        let rows = Rows::of(2, both.iter());
        assert_eq!((rows.classes, rows.as_slices()), (3, vec![&[1.0, -1.0, 1.0][..], &[2.0, -2.0, -3.0]]));
    }
}
