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
    /// The gesture that most of them say, of those that any has met; of equals the one of the smaller number.
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
    /// Which of them any has met: of the others nobody can say that they are shown.
    taught: &'a [bool],
    /// How many say each.
    votes: Vec<usize>,
    /// How many find one that they have not met likelier than any that they have.
    undecided: usize,
    /// What each makes of one that is not on the list.
    unknown: Vec<f64>,
}

impl<'a> Votes<'a> {
    pub fn of(vocabulary: &'a Vocabulary, taught: &'a [bool]) -> Self {
        let votes = vec![0; vocabulary.classes()];
        Self { vocabulary, taught, votes, undecided: 0, unknown: Vec::new() }
    }

    /// One says which gesture that it has met is the likeliest, and how likely, if it has met any; and how likely one is that it has not met.
    pub fn add(&mut self, likeliest: Option<(ClassId, f64)>, unknown: f64) {
        match likeliest {
            // Before much is known all are equally likely, but for what is rounded.
            Some((class, p)) if p >= unknown * (1.0 - 1e-9) => {
                if let Some(place) = self.vocabulary.place(class) {
                    self.votes[place] += 1;
                }
            }
            Some(_) => self.undecided += 1,
            // Who has met nothing says nothing.
            None => {}
        }
        self.unknown.push(unknown);
    }

    /// The probabilities of all gestures of the list, and that of one beside it, the middle of what they say. One that none has met is exactly as likely as that;
    /// of the others it is the part of the groups that say so, as if one more had been undecided. Nobody moves more of it than the groups that it is in.
    pub fn probabilities(mut self) -> (Vec<f64>, f64) {
        self.unknown.sort_by(f64::total_cmp);
        let unknown = self.unknown.get(self.unknown.len() / 2).copied().unwrap_or_default();
        let taught = self.taught.iter().filter(|taught| **taught).count();
        let untaught = self.taught.len() - taught;
        // Whoever has met less finds that of each of them, and of more, so together they are 1 at most.
        let rest = if taught > 0 { (1.0 - untaught as f64 * unknown).max(0.0) } else { 0.0 };
        let all = (self.votes.iter().sum::<usize>() + self.undecided) as f64 + 1.0;
        let each = (self.undecided as f64 + 1.0) / taught.max(1) as f64;
        let of = |(votes, taught): (usize, &bool)| match taught {
            true => (votes as f64 + each) / all * rest,
            false => unknown,
        };
        (self.votes.into_iter().zip(self.taught).map(of).collect(), unknown)
    }

    pub fn certified(&self) -> Option<Certified> {
        let any = self.taught.contains(&true);
        let votes = || self.vocabulary.all().zip(self.votes.iter().copied());
        let met = votes().zip(self.taught).filter(|(_, taught)| **taught || !any).map(|(said, _)| said);
        let (class, most) = met.max_by_key(|(class, votes)| (*votes, Reverse(*class)))?;
        // Of equals the one of the smaller number is said: such a one needs one vote less, also where none has met it yet, for whoever lies may teach
        // it. One that is yet to be named needs no fewer than the first of the list.
        let others = votes().filter(|(other, _)| *other != class);
        let others = others.map(|(other, votes)| votes + usize::from(other < class));
        let rival = others.chain([self.undecided]).max().unwrap_or(0);
        // One group that changes its mind takes one from here and gives it there.
        Some(Certified { class, votes: most, tolerates: most.saturating_sub(rival) / 2 })
    }
}
