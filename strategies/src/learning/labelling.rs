//! What becomes of samples by what instructors say of their round: into the training set, out of it, aside.

use std::collections::BTreeSet;

use gestalt_protocol::{ClassId, FeatureSpaceId, RoundId, SharedSample};
use gestalt_rounds::Classify;

use super::changes::{TrainingChange, inserted_as};
use super::memory::Item;
use super::state::{Declined, Learning};
use super::unresolved::{self, UnresolvedSample};
use crate::candidates::Candidates;
use crate::lessons::Verdict;
use crate::sample::{HeldSample, SetPart};
use crate::training_set::{SampleReceipt, SetChange};
use crate::vector_codec::{VectorError, decode_vector};

impl Learning {
    /// Takes in a sample that another robot shared. Says whether it was news.
    pub fn receive(&mut self, space: FeatureSpaceId, sample: &SharedSample) -> Result<bool, Declined> {
        if space != self.space_id {
            return Err(Declined::Vector(VectorError::Space { found: space, expected: self.space_id }));
        }
        if !sample.class.is_named() && self.vocabulary.place(sample.class).is_none() {
            return Err(Declined::Class);
        }
        let vector = decode_vector(&sample.vector, &self.space).map_err(Declined::Vector)?;
        let SharedSample { id, round, .. } = *sample;
        let vector = self.shelf.vector(id, vector);
        let verdict = self.verdict(round);
        let class = match verdict {
            Verdict::Class(class) => Some(class),
            Verdict::Unsaid => Some(sample.class),
            // It waits aside, and takes no other sample's place.
            Verdict::Among(_) | Verdict::Retracted => None,
        };
        let receipt = match class {
            Some(class) => self.set.receive(id, class, round, vector.clone(), &mut *self.rng),
            None => self.set.note(id, round),
        };
        match receipt {
            SampleReceipt::New(changes) => {
                self.dirty.insert(Item::Seen(id.series()));
                self.absorb(changes);
                if class.is_none() {
                    let (part, shared) = (self.set.part_of(id), Some(id));
                    self.put_aside(UnresolvedSample { part, shared, round, vector, guess: None });
                }
                Ok(true)
            }
            SampleReceipt::Known => Ok(false),
            SampleReceipt::Refused(_) => Err(Declined::Number),
        }
    }

    /// Does to all samples of a round what instructors said of it: nothing but that decides, so that robots that heard
    /// it in another order come to the same.
    pub(super) fn apply_to_round(&mut self, round: RoundId) {
        let names: BTreeSet<RoundId> = self.recent.names(round).collect();
        let verdict = self.verdict(round);
        let kept_as = self.name_to_keep(round, &names, &verdict);
        match verdict {
            Verdict::Class(class) => {
                for name in &names {
                    let changes = self.set.relabel(*name, class);
                    self.absorb(changes);
                }
                for (number, aside) in self.aside.take(|aside| names.contains(&aside.round)) {
                    self.note_not_aside(number, &aside);
                    let is_new = !self.aside.take_earned(number);
                    self.take_back(aside, class, is_new);
                }
                for vector in self.recent.take_unlabelled(round) {
                    self.keep(kept_as, class, vector, true);
                }
            }
            verdict @ (Verdict::Among(_) | Verdict::Retracted) => {
                for change in names.iter().flat_map(|name| self.set.retract(*name)).collect::<Vec<_>>() {
                    if let SetChange::Removed(sample) = &change {
                        let HeldSample { part, id: shared, round, vector, .. } = sample.clone();
                        let aside = UnresolvedSample { part, shared, round, vector, guess: None };
                        let number = self.put_aside(aside);
                        self.aside.note_earned(number);
                    }
                    self.absorb(vec![change]);
                }
                let possible =
                    |class| matches!(&verdict, Verdict::Among(candidates) if candidates.contains(class));
                let of_round = self.aside.iter().filter(|(_, aside)| names.contains(&aside.round));
                let refuted = of_round.filter(|(_, aside)| aside.guess.is_some_and(|guess| !possible(guess)));
                let refuted: Vec<u64> = refuted.map(|(number, _)| number).collect();
                refuted.into_iter().for_each(|number| self.guess(number, None));
                if verdict != Verdict::Retracted {
                    for vector in self.recent.take_unlabelled(round) {
                        let (part, round, vector) = (SetPart::Personal, kept_as, vector.into());
                        self.put_aside(UnresolvedSample { part, shared: None, round, vector, guess: None });
                    }
                }
            }
            Verdict::Unsaid => {}
        }
    }

    /// The name under which what was seen in a round is kept: one that instructors spoke of. Its other names are known to those alone who lived through it,
    /// and to them not for long, so a later word on the one that was spoken of would not reach there. Of several, one that by itself says what all do.
    fn name_to_keep(&self, round: RoundId, names: &BTreeSet<RoundId>, verdict: &Verdict) -> RoundId {
        let mut spoken_of = names.iter().filter(|name| self.lessons.contains(**name)).peekable();
        let first = spoken_of.peek().copied();
        let says_all = spoken_of.find(|name| self.lessons.verdict(**name, &self.gestures) == *verdict);
        says_all.or(first).copied().unwrap_or(round)
    }

    /// A sample of this robot's own. Of those that are new a part may be shared: what was taken back and is said again is none.
    fn keep(&mut self, round: RoundId, class: ClassId, vector: Vec<f32>, is_new: bool) {
        self.credit += if is_new { self.config.share_fraction } else { 0.0 };
        let changes = self.set.keep(class, round, vector, &mut *self.rng);
        self.absorb(changes);
    }

    fn take_back(&mut self, aside: UnresolvedSample, class: ClassId, is_new: bool) {
        let UnresolvedSample { shared, round, vector, .. } = aside;
        match shared {
            None => self.keep(round, class, vector.to_vec(), is_new),
            Some(id) => {
                let changes = self.set.take_back(id, class, round, vector, &mut *self.rng);
                self.absorb(changes);
            }
        }
    }

    /// Puts one aside; says under which number.
    fn put_aside(&mut self, aside: UnresolvedSample) -> u64 {
        let (number, gone) = self.aside.put(aside);
        self.dirty.extend([Item::Counters, Item::Aside(number)]);
        for (number, aside) in gone {
            self.note_not_aside(number, &aside);
        }
        number
    }

    /// Lets go of what there is no room for, where it was stored when there was more.
    pub(super) fn trim(&mut self) {
        let gone = self.set.trim(&mut *self.rng);
        self.absorb(gone);
        for (number, aside) in self.aside.trim() {
            self.note_not_aside(number, &aside);
        }
    }

    /// Notes that a sample is aside no longer.
    fn note_not_aside(&mut self, number: u64, aside: &UnresolvedSample) {
        self.dirty.insert(Item::Aside(number));
        self.note_gone(aside.shared);
        if aside.guess.is_some() {
            self.training.push(TrainingChange::Remove(unresolved::training_key(number)));
        }
    }

    /// Lets go of what is aside of lives of which no sample counts as seen any more: from here they would come back to all that let go of them.
    pub(super) fn let_go_aside(&mut self) {
        let seen = self.set.seen();
        let is_gone =
            |aside: &UnresolvedSample| aside.shared.is_some_and(|id| seen.intervals(id.series()).is_empty());
        for (number, aside) in self.aside.take(is_gone) {
            self.aside.take_earned(number);
            self.note_not_aside(number, &aside);
        }
    }

    /// Trains, or trains no longer, on a sample aside as what the robot itself takes it for.
    fn guess(&mut self, number: u64, class: Option<ClassId>) {
        self.aside.guess(number, class);
        self.dirty.insert(Item::Aside(number));
        let key = unresolved::training_key(number);
        let class = class.and_then(|class| self.trained_as(class));
        self.training.push(match self.aside.get(number) {
            Some(aside) => inserted_as(class, key, &aside.vector, aside.round, None),
            None => TrainingChange::Remove(key),
        });
    }

    /// Trains on own samples of which several gestures are possible and the classifier is sure of one.
    pub fn settle_aside(&mut self, classifier: &dyn Classify) {
        let sure = |aside: &UnresolvedSample| {
            let Verdict::Among(candidates) = self.verdict(aside.round) else { return None };
            let p = classifier.probabilities_in_space(&aside.vector)?;
            likeliest(classifier.vocabulary().all().zip(p), &candidates)
                .filter(|(_, p)| *p >= self.config.sure)
                .map(|(class, _)| class)
        };
        // Guesses at what others share would differ from robot to robot.
        let open = self.aside.iter().filter(|(_, aside)| aside.shared.is_none() && aside.guess.is_none());
        let guesses: Vec<(u64, ClassId)> =
            open.filter_map(|(number, aside)| Some((number, sure(aside)?))).collect();
        guesses.into_iter().for_each(|(number, class)| self.guess(number, Some(class)));
    }
}

/// The likeliest of the candidates, and its probability among them.
fn likeliest(p: impl Iterator<Item = (ClassId, f64)>, candidates: &Candidates) -> Option<(ClassId, f64)> {
    let possible: Vec<(ClassId, f64)> = p.filter(|(class, _)| candidates.contains(*class)).collect();
    let sum: f64 = possible.iter().map(|(_, p)| p).sum();
    let (class, p) = possible.into_iter().max_by(|(_, a), (_, b)| a.total_cmp(b))?;
    (sum > 0.0).then(|| (class, p / sum))
}
