//! Classifiers of disjoint groups of authors, whose majority is certified.
//!
//! Each learned from the samples of the authors of its group alone, and from those of the robot itself. Whatever an author says changes what one of them says,
//! and no more: a majority that is ahead of every other class by more than twice as many stands against that many liars, in however many groups.
//!
//! A. Levine, S. Feizi, "Deep Partition Aggregation: provable defenses against general poisoning attacks", ICLR (2021).

use std::cmp::Reverse;

use gestalt_protocol::ClassId;
use gestalt_rounds::Vocabulary;

/// What most groups say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Certified {
    /// The gesture that most of them say; of equals the one of the smaller number.
    pub class: ClassId,
    /// How many say so.
    pub votes: usize,
    /// Against how many groups with a liar this is certain: whatever they had said, it would be the same. 0: one could have made it another.
    pub tolerates: usize,
}

/// What the classifiers of all groups say of one look.
pub(crate) struct Votes<'a> {
    /// The gestures that any of them has met, and all of the list.
    vocabulary: &'a Vocabulary,
    /// How many say each.
    votes: Vec<usize>,
    /// What each makes of one that is not on the list.
    unknown: Vec<f64>,
}

impl<'a> Votes<'a> {
    pub fn of(vocabulary: &'a Vocabulary) -> Self {
        Self { vocabulary, votes: vec![0; vocabulary.classes()], unknown: Vec::new() }
    }

    /// One says that gesture, if it has met any.
    pub fn add(&mut self, class: Option<ClassId>, unknown: f64) {
        if let Some(place) = class.and_then(|class| self.vocabulary.place(class)) {
            self.votes[place] += 1;
        }
        self.unknown.push(unknown);
    }

    /// The probabilities of all gestures of the list, and that of one beside it, the middle of what they say: the part of the groups that say so, as if one
    /// more had been undecided. Nobody moves more of it than the groups that it is in.
    pub fn probabilities(mut self) -> (Vec<f64>, f64) {
        let each = 1.0 / self.votes.len() as f64;
        let all = self.votes.iter().sum::<usize>() as f64 + 1.0;
        self.unknown.sort_by(f64::total_cmp);
        let unknown = self.unknown.get(self.unknown.len() / 2).copied().unwrap_or_default();
        (self.votes.into_iter().map(|votes| (votes as f64 + each) / all).collect(), unknown)
    }

    pub fn certified(&self) -> Option<Certified> {
        let votes = || self.vocabulary.all().zip(self.votes.iter().copied());
        let (class, most) = votes().max_by_key(|(class, votes)| (*votes, Reverse(*class)))?;
        // Of equals the one of the smaller number is said: such a one needs one vote less.
        let others = votes().filter(|(other, _)| *other != class);
        let rival = others.map(|(other, votes)| votes + usize::from(other < class)).max().unwrap_or(0);
        // One group that changes its mind takes one from here and gives it there.
        Some(Certified { class, votes: most, tolerates: most.saturating_sub(rival) / 2 })
    }
}
