//! Disjoint groups of other robots, each with room of its own in a training set and a classifier of its own.
//!
//! What is held of a group, and of this robot itself, follows from what that group, and this robot, came with, and from nothing else: only so is a majority of their
//! classifiers [certified](gestalt_svm::Certified).

use std::cmp::Reverse;
use std::collections::{BTreeMap, VecDeque};

use gestalt_protocol::ClassId;

use crate::sample::{HeldSample, HeldSamples, SetPart};

/// So many groups, by what is left of an author's number when it is divided by theirs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Groups(usize);

impl Groups {
    /// `None` for no group.
    pub fn new(groups: usize) -> Option<Self> {
        (groups > 0).then_some(Self(groups))
    }

    /// The group of the author of a sample; `None` for this robot itself.
    pub fn of(self, sample: &HeldSample) -> Option<usize> {
        let author = sample.author().filter(|_| sample.part == SetPart::External)?;
        Some(author.0 as usize % self.0)
    }

    /// The samples to go because their group has more than its room, an equal part of that many and one: as many as are too many, each the oldest of the gesture that the
    /// group has most of. What is left over when the room is divided is this robot's.
    pub fn above(self, samples: &HeldSamples, capacity: usize) -> Vec<u64> {
        let each = capacity / (self.0 + 1);
        let mut counts = vec![0; self.0];
        for (author, held) in samples.authors() {
            counts[author.0 as usize % self.0] += held;
        }
        let own = samples.total(SetPart::Personal) + samples.total(SetPart::Shared);
        let others = counts.into_iter().enumerate().map(|(group, held)| (Some(group), held, each));
        let all = others.chain([(None, own, capacity - self.0 * each)]);
        let crowded = all.filter(|(_, held, room)| held > room);
        crowded.flat_map(|(group, held, room)| self.oldest_of_most(samples, group, held - room)).collect()
    }

    /// So many samples of a group, one after the other.
    fn oldest_of_most(self, samples: &HeldSamples, group: Option<usize>, n: usize) -> Vec<u64> {
        let theirs = |class: ClassId| {
            let of_class = samples.with_keys(samples.class_keys(class));
            of_class.filter(|sample| self.of(sample) == group).map(|sample| sample.key).collect()
        };
        let mut left: BTreeMap<ClassId, VecDeque<u64>> =
            samples.classes().map(|class| (class, theirs(class))).collect();
        let oldest = |_| {
            let (_, most) = left.iter_mut().max_by_key(|(class, keys)| (keys.len(), Reverse(**class)))?;
            most.pop_front()
        };
        (0..n).filter_map(oldest).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use gestalt_protocol::{RobotId, RoundId, SampleId};
    use proptest::prelude::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{ForgettingRule, SelectionRule, TrainingSet};

    const ME: RobotId = RobotId(1);

    /// What comes: from whom, how many samples, of which class.
    type Coming = (u32, u32, u32);

    /// What a set holds, but of that group, after all that came; all of that group say something else, as they like.
    fn held(coming: &[Coming], capacity: usize, lying: usize, lies: &[Coming]) -> Vec<(u32, u32, bool)> {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let set = TrainingSet::new(
            ME,
            capacity,
            SelectionRule::default().build(),
            ForgettingRule::default().build(),
        );
        let mut set = set.in_groups(Groups::new(3));
        set.meet(Arc::new((1..9).map(RobotId).collect()));
        let mut lies = lies.iter();
        for (index, mut next) in (0..).zip(coming.iter()) {
            let author = next.0;
            if author != ME.0 && author as usize % 3 == lying {
                next = lies.next().unwrap_or(next);
            }
            let (_, count, class) = *next;
            for number in 100 * index + 1..=100 * index + count {
                let round = RoundId { counter: number, opener: ME, life: 0 };
                let (class, vector) = (ClassId(class), vec![number as f32, 1.0]);
                if author == ME.0 {
                    set.keep(class, round, vector, &mut rng);
                } else {
                    let id = SampleId { author: RobotId(author), life: 1, number };
                    set.receive(id, class, round, vector, &mut rng);
                }
            }
            assert!(set.len() <= capacity);
        }
        let of_others = set.iter().filter(|sample| Groups(3).of(sample) != Some(lying));
        of_others.map(|sample| (sample.round.counter, sample.class.0, sample.id.is_some())).collect()
    }

    /// The first of them to go, as it reads.
    fn first_above(samples: &HeldSamples, capacity: usize) -> Option<u64> {
        let groups = Groups(3);
        let of = |group| samples.iter().filter(move |sample| groups.of(sample) == group);
        let each = capacity / 4;
        let mut rooms = (0..3).map(|group| (Some(group), each)).chain([(None, capacity - 3 * each)]);
        let (crowded, _) = rooms.find(|(group, room)| of(*group).count() > *room)?;
        let theirs = |class: ClassId| of(crowded).filter(move |sample| sample.class == class);
        let most = samples.classes().max_by_key(|class| (theirs(*class).count(), Reverse(*class)))?;
        theirs(most).next().map(|sample| sample.key)
    }

    fn coming() -> impl Strategy<Value = Vec<Coming>> {
        prop::collection::vec((1..9_u32, 1..9_u32, 0..4_u32), 1..60)
    }

    proptest! {
        #[test]
        fn at_once_goes_what_would_go_one_by_one(coming in coming(), capacity in 4..60_usize) {
            let mut samples = HeldSamples::default();
            let each = coming.iter().flat_map(|(author, count, class)| (0..*count).map(|_| (*author, *class)));
            for (key, (author, class)) in (1..).zip(each) {
                let id = SampleId { author: RobotId(author), life: 1, number: key };
                let part = if author == ME.0 { SetPart::Shared } else { SetPart::External };
                let (key, round) = (u64::from(key), RoundId { counter: 1, opener: ME, life: 0 });
                let (class, vector) = (ClassId(class), [0.0].into());
                samples.insert(HeldSample { key, part, id: Some(id), class, round, vector });
            }
            let at_once = Groups(3).above(&samples, capacity);
            let mut one_by_one = Vec::new();
            while let Some(key) = first_above(&samples, capacity) {
                samples.remove(key);
                one_by_one.push(key);
            }
            prop_assert_eq!(at_once, one_by_one);
        }

        #[test]
        fn what_is_held_of_one_group_and_of_oneself_is_the_same_whatever_another_sends(
            honest in coming(), lies in coming(), capacity in 4..60_usize, lying in 0..3_usize,
        ) {
            let before = held(&honest, capacity, lying, &[]);
            prop_assert_eq!(before, held(&honest, capacity, lying, &lies));
        }
    }

    #[test]
    fn of_a_group_that_has_too_much_the_oldest_of_what_it_has_most_of_goes() {
        // Room for 3 of each group; the second is of robots 1, 4 and 7.
        let held = held(&[(4, 2, 0), (7, 3, 1), (5, 1, 2), (1, 5, 3)], 12, 0, &[]);
        let of_second: Vec<(u32, u32)> =
            held.iter().filter(|(_, _, of_other)| *of_other).map(|s| (s.0, s.1)).collect();
        assert_eq!(of_second, [(2, 0), (102, 1), (103, 1), (201, 2)]);
        let own: Vec<u32> = held.iter().filter(|(_, _, of_other)| !of_other).map(|s| s.0).collect();
        assert_eq!(own, [303, 304, 305]);
    }
}
