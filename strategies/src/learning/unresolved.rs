//! Samples of which it is not known what they show: kept, not trained on, until an instructor says more or the
//! classifier is sure.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use gestalt_protocol::{ClassId, RoundId, SampleId};

use crate::sample::SetPart;

/// A sample whose class is open.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct UnresolvedSample {
    /// The part of the training set it came from, or would go to.
    pub part: SetPart,
    /// Its id, once shared.
    pub shared: Option<SampleId>,
    pub round: RoundId,
    pub vector: Arc<[f32]>,
    /// The class the robot trains on it as meanwhile, because it is sure itself. Never shared.
    pub guess: Option<ClassId>,
}

/// The keys of such samples in training begin here, far beyond those of the training set.
const FIRST_KEY: u64 = 1 << 63;

/// The largest number that one of an earlier life can have.
pub(super) const LAST_NUMBER: u64 = FIRST_KEY / 2;

/// The key that a sample of that number has in training.
pub(crate) fn training_key(number: u64) -> u64 {
    FIRST_KEY | number
}

/// The samples kept aside, oldest first, never more than so many.
#[derive(Clone, Debug)]
pub(super) struct Unresolved {
    samples: BTreeMap<u64, UnresolvedSample>,
    /// Those of this life that were in the training set before: for them a part may be shared already, and is not again when they come back.
    earned: BTreeSet<u64>,
    next: u64,
    capacity: usize,
}

impl Unresolved {
    pub fn new(samples: Vec<(u64, UnresolvedSample)>, next: u64, capacity: usize) -> Self {
        let samples: BTreeMap<_, _> = samples.into_iter().collect();
        let next = samples.keys().next_back().map_or(next, |last| next.max(last + 1));
        Self { samples, earned: BTreeSet::new(), next, capacity }
    }

    /// Puts one aside; those whose place was taken, which may be itself, come back.
    pub fn put(&mut self, aside: UnresolvedSample) -> (u64, Vec<(u64, UnresolvedSample)>) {
        let number = self.next;
        self.next += 1;
        self.samples.insert(number, aside);
        let mut gone = Vec::new();
        while self.samples.len() > self.capacity {
            gone.extend(self.samples.pop_first());
        }
        for (number, _) in &gone {
            self.earned.remove(number);
        }
        (number, gone)
    }

    /// That one was in the training set before.
    pub fn note_earned(&mut self, number: u64) {
        if self.samples.contains_key(&number) {
            self.earned.insert(number);
        }
    }

    /// Whether that one, which was taken out, was in the training set before.
    pub fn take_earned(&mut self, number: u64) -> bool {
        self.earned.remove(&number)
    }

    /// Takes out those for which `pick` says so, oldest first.
    pub fn take(&mut self, pick: impl Fn(&UnresolvedSample) -> bool) -> Vec<(u64, UnresolvedSample)> {
        let (taken, left) = std::mem::take(&mut self.samples).into_iter().partition(|(_, aside)| pick(aside));
        self.samples = left;
        BTreeMap::into_iter(taken).collect()
    }

    pub fn get(&self, number: u64) -> Option<&UnresolvedSample> {
        self.samples.get(&number)
    }

    pub fn iter(&self) -> impl Iterator<Item = (u64, &UnresolvedSample)> {
        self.samples.iter().map(|(number, aside)| (*number, aside))
    }

    /// Notes what the robot takes one for.
    pub fn guess(&mut self, number: u64, class: Option<ClassId>) {
        if let Some(aside) = self.samples.get_mut(&number) {
            aside.guess = class;
        }
    }

    pub fn len(&self) -> usize {
        self.samples.len()
    }

    pub fn next(&self) -> u64 {
        self.next
    }
}
