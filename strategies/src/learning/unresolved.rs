//! Samples of which it is not known what they show: kept, not trained on, until an instructor says more or the
//! classifier is sure.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use gestalt_protocol::{ClassId, RobotId, RoundId, SampleId};

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

impl UnresolvedSample {
    /// Which other robot it is of; `None` of this robot's own.
    fn of(&self) -> Option<RobotId> {
        self.shared.filter(|_| self.part == SetPart::External).map(|id| id.author)
    }
}

/// The keys of such samples in training begin here, far beyond those of the training set.
const FIRST_KEY: u64 = 1 << 63;

/// The largest number that one of an earlier life can have.
pub(super) const LAST_NUMBER: u64 = FIRST_KEY / 2;

/// The key that a sample of that number has in training.
pub(crate) fn training_key(number: u64) -> u64 {
    FIRST_KEY | number
}

/// The samples kept aside, oldest first, never more than so many: where there are more, the oldest goes of whoever has most. So nobody's push out
/// those of the others, and this robot's own, which are one author's, stay as many as any other's.
#[derive(Clone, Debug)]
pub(super) struct Unresolved {
    samples: BTreeMap<u64, UnresolvedSample>,
    /// The same by whose they are; of nobody none.
    authors: BTreeMap<Option<RobotId>, BTreeSet<u64>>,
    /// And how many those are, the most last; of equals this robot is the first.
    by_number: BTreeSet<(usize, Option<RobotId>)>,
    /// Those of this life that were in the training set before: for them a part may be shared already, and is not again when they come back.
    earned: BTreeSet<u64>,
    next: u64,
    capacity: usize,
}

impl Unresolved {
    pub fn new(samples: Vec<(u64, UnresolvedSample)>, next: u64, capacity: usize) -> Self {
        let mut aside = Self {
            samples: BTreeMap::new(),
            authors: BTreeMap::new(),
            by_number: BTreeSet::new(),
            earned: BTreeSet::new(),
            next,
            capacity,
        };
        for (number, sample) in samples {
            aside.next = aside.next.max(number + 1);
            aside.insert(number, sample);
        }
        aside
    }

    /// Puts one aside; those whose place was taken, which may be itself, come back.
    pub fn put(&mut self, aside: UnresolvedSample) -> (u64, Vec<(u64, UnresolvedSample)>) {
        let number = self.next;
        self.next += 1;
        self.insert(number, aside);
        (number, self.trim())
    }

    /// Takes out those that are more than there is room for: after one came, and of what was stored where there was more room.
    pub fn trim(&mut self) -> Vec<(u64, UnresolvedSample)> {
        let mut gone = Vec::new();
        while self.samples.len() > self.capacity
            && let Some(first) = self.first_to_go()
        {
            gone.extend(self.remove(first));
        }
        for (number, _) in &gone {
            self.earned.remove(number);
        }
        gone
    }

    fn first_to_go(&self) -> Option<u64> {
        let (_, most) = self.by_number.last()?;
        self.authors.get(most)?.first().copied()
    }

    fn insert(&mut self, number: u64, aside: UnresolvedSample) {
        self.remove(number);
        self.count(aside.of(), |of_author| of_author.insert(number));
        self.samples.insert(number, aside);
    }

    fn remove(&mut self, number: u64) -> Option<(u64, UnresolvedSample)> {
        let aside = self.samples.remove(&number)?;
        self.count(aside.of(), |of_author| of_author.remove(&number));
        Some((number, aside))
    }

    /// Changes which are of that author.
    fn count(&mut self, author: Option<RobotId>, change: impl FnOnce(&mut BTreeSet<u64>) -> bool) {
        let of_author = self.authors.entry(author).or_default();
        self.by_number.remove(&(of_author.len(), author));
        change(of_author);
        if of_author.is_empty() {
            self.authors.remove(&author);
        } else {
            self.by_number.insert((of_author.len(), author));
        }
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
        let taken = self.samples.iter().filter(|(_, aside)| pick(aside)).map(|(number, _)| *number);
        taken.collect::<Vec<_>>().into_iter().filter_map(|number| self.remove(number)).collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A sample of that robot; 0: an own one.
    fn of(robot: u32, number: u32) -> UnresolvedSample {
        let id = SampleId { author: RobotId(robot), life: 1, number };
        let (part, shared) =
            if robot == 0 { (SetPart::Personal, None) } else { (SetPart::External, Some(id)) };
        let round = RoundId { counter: 1, opener: RobotId(1), life: 1 };
        UnresolvedSample { part, shared, round, vector: [0.0].into(), guess: None }
    }

    fn counts(aside: &Unresolved) -> BTreeMap<u32, usize> {
        let mut counts = BTreeMap::new();
        for (_, sample) in aside.iter() {
            *counts.entry(sample.of().map_or(0, |robot| robot.0)).or_default() += 1;
        }
        counts
    }

    #[test]
    fn however_many_one_author_has_those_of_the_others_stay_and_own_ones_last() {
        let mut aside = Unresolved::new(Vec::new(), 1, 12);
        for robot in [0, 0, 2, 0] {
            aside.put(of(robot, 1));
        }
        for number in 0..100 {
            aside.put(of(3, number));
        }
        assert_eq!(counts(&aside), [(0, 3), (2, 1), (3, 8)].into());
        let (_, oldest) = aside.iter().find(|(_, sample)| sample.of() == Some(RobotId(3))).unwrap();
        assert_eq!(oldest.shared.unwrap().number, 92, "of one author the newest stay");
        // A robot that comes to as many as the others, and no further.
        for number in 0..100 {
            aside.put(of(4, number));
            aside.put(of(0, number));
        }
        assert_eq!(counts(&aside), [(0, 4), (2, 1), (3, 4), (4, 3)].into());
        assert_eq!(aside.take(|sample| sample.part == SetPart::External).len(), 8);
        assert_eq!((counts(&aside), aside.authors.len(), aside.by_number.len()), ([(0, 4)].into(), 1, 1));
    }

    #[test]
    fn what_is_read_back_counts_as_it_did_and_where_there_is_room_for_none_none_stays() {
        let stored = [(7, of(3, 1)), (8, of(3, 2)), (9, of(0, 1))];
        let mut aside = Unresolved::new(stored.to_vec(), 2, 3);
        let (number, gone) = aside.put(of(2, 1));
        assert_eq!((number, gone), (10, vec![(7, of(3, 1))]));
        let mut none = Unresolved::new(stored.to_vec(), 2, 0);
        assert_eq!((none.put(of(0, 2)).1.len(), none.len(), none.next()), (4, 0, 11));
        let mut less = Unresolved::new(stored.to_vec(), 2, 2);
        assert_eq!((less.trim(), less.trim(), less.len()), (vec![(7, of(3, 1))], vec![], 2));
    }
}
