//! The gestures that votes are fused over: those of the list, and those that were named since.

use std::borrow::Cow;

use gestalt_protocol::{Certificate, ClassId, MAX_CLASSES, Vote};

/// The gestures that a set of votes is evidence for, each with its place.
///
/// Robots hear at different times of a gesture that was named, and learn it at different times. So all that any of the votes knows are fused over, those
/// of the list first, then the others in the order of their numbers. For a gesture that a robot does not know, its evidence for "unknown" counts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Columns {
    listed: usize,
    named: Vec<ClassId>,
}

impl Columns {
    /// Those of votes over so many gestures of the list. Of more than [`MAX_CLASSES`] those are left out that the fewest votes know, and of equals those of the
    /// greater numbers.
    pub fn of<'a>(listed: usize, votes: impl Iterator<Item = &'a Vote>) -> Self {
        let mut named: Vec<ClassId> = votes.flat_map(|vote| vote.named.iter().copied()).collect();
        named.sort_unstable();
        let room = MAX_CLASSES.saturating_sub(listed);
        let distinct = |named: &[ClassId]| named.chunk_by(|a, b| a == b).count();
        if distinct(&named) > room {
            let mut known_by: Vec<(usize, ClassId)> =
                named.chunk_by(|a, b| a == b).map(|same| (same.len(), same[0])).collect();
            known_by.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)));
            known_by.truncate(room);
            named = known_by.into_iter().map(|(_, class)| class).collect();
            named.sort_unstable();
        }
        named.dedup();
        Self { listed, named }
    }

    /// Those that a certificate is over.
    #[must_use]
    pub fn of_certificate(certificate: &Certificate) -> Self {
        Self { listed: certificate.listed(), named: certificate.named.clone() }
    }

    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.listed + self.named.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Those that were named, ascending.
    #[must_use]
    pub fn named(&self) -> &[ClassId] {
        &self.named
    }

    /// The gesture at that place.
    #[must_use]
    pub fn class(&self, place: usize) -> Option<ClassId> {
        match place.checked_sub(self.listed) {
            None => Some(ClassId(place as u32)),
            Some(beyond) => self.named.get(beyond).copied(),
        }
    }

    /// All of them, by place.
    pub fn classes(&self) -> impl Iterator<Item = ClassId> + '_ {
        (0..self.listed as u32).map(ClassId).chain(self.named.iter().copied())
    }

    /// A vote's evidence for each. Where it says nothing of "unknown" either, a gesture that it does not know is as likely as its mean.
    pub(crate) fn row<'a>(&self, vote: &'a Vote) -> Cow<'a, [f32]> {
        if self.named == vote.named {
            return Cow::Borrowed(&vote.evidence);
        }
        let for_others = vote.unknown.unwrap_or(0.0);
        self.classes().map(|class| vote.evidence_for(class).unwrap_or(for_others)).collect()
    }

    /// The gesture that a vote finds likeliest of those it knows; of equals the one of the smaller place.
    pub(crate) fn top(&self, vote: &Vote) -> ClassId {
        let known = self.classes().filter_map(|class| Some((class, vote.evidence_for(class)?)));
        let top = known.fold(None, |top: Option<(ClassId, f32)>, (class, of_class)| match top {
            Some((_, greatest)) if greatest >= of_class => top,
            _ => Some((class, of_class)),
        });
        top.map_or(ClassId(0), |(class, _)| class)
    }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::{RobotId, RoundId, VocabularyId};

    use super::*;

    fn named(label: &str) -> ClassId {
        ClassId::named(&"ana".parse().unwrap(), label)
    }

    /// A vote over two gestures of the list and these.
    fn vote(evidence: &[f32], labels: &[&str]) -> Vote {
        let mut named: Vec<ClassId> = labels.iter().map(|label| named(label)).collect();
        named.sort();
        let round = RoundId { counter: 1, opener: RobotId(1), life: 0 };
        let evidence = evidence.to_vec();
        Vote { round, vocabulary: VocabularyId(1), evidence, looks: 1.0, unknown: Some(-0.5), named }
    }

    #[test]
    fn who_does_not_know_a_gesture_says_unknown_of_it() {
        let votes = [vote(&[1.0, -1.0], &[]), vote(&[0.0, -2.0, 2.0], &["circle"])];
        let columns = Columns::of(2, votes.iter());
        assert_eq!(columns.classes().collect::<Vec<_>>(), [ClassId(0), ClassId(1), named("circle")]);
        assert_eq!(*columns.row(&votes[0]), [1.0, -1.0, -0.5]);
        assert_eq!(*columns.row(&votes[1]), [0.0, -2.0, 2.0]);
        assert_eq!(columns.top(&votes[0]), ClassId(0));
        assert_eq!(columns.top(&votes[1]), named("circle"));
        let far = vote(&[-3.0, -2.0], &[]);
        assert_eq!(columns.top(&far), ClassId(1), "of those it knows");
    }

    #[test]
    fn of_too_many_those_that_most_know_are_kept_in_any_order() {
        let labels: Vec<String> = (0..70).map(|n| n.to_string()).collect();
        let one = |label: &String| vote(&[0.0, 0.0, 1.0], &[label]);
        let mut votes: Vec<Vote> = labels.iter().map(one).collect();
        votes.push(one(&labels[69]));
        let columns = Columns::of(2, votes.iter());
        assert_eq!(columns.len(), MAX_CLASSES);
        assert!(columns.named().contains(&named("69")));
        assert_eq!(Columns::of(2, votes.iter().rev()), columns);
    }
}
