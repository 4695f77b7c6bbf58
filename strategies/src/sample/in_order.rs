//! Samples by key, side by side.

use super::grow::{EMPTY, insert};
use super::held::HeldSample;

/// Samples in the order of their keys, which mostly grow: a new one is put at the end, one that goes leaves its place empty until many are. In a tree
/// of such samples every other place would be empty.
#[derive(Debug, Default)]
pub(super) struct InOrder {
    keys: Vec<u64>,
    /// By place of the key.
    samples: Vec<Option<HeldSample>>,
    empty: usize,
}

impl InOrder {
    pub fn get(&self, key: u64) -> Option<&HeldSample> {
        self.samples[self.place(key).ok()?].as_ref()
    }

    /// Where that key is; where it would be, if it is not. Keys are looked up all the time, and mostly follow each other without a gap.
    fn place(&self, key: u64) -> Result<usize, usize> {
        let first = self.keys.first().copied().unwrap_or(key);
        let without_gaps = usize::try_from(key.saturating_sub(first)).unwrap_or(usize::MAX);
        if self.keys.get(without_gaps) == Some(&key) {
            return Ok(without_gaps);
        }
        // Gaps only bring it nearer to the first.
        self.keys[..without_gaps.min(self.keys.len())].binary_search(&key)
    }

    pub fn iter(&self) -> impl DoubleEndedIterator<Item = &HeldSample> {
        self.samples.iter().flatten()
    }

    pub fn len(&self) -> usize {
        self.keys.len() - self.empty
    }

    /// Takes a sample in, in place of another one of that key.
    pub fn insert(&mut self, sample: HeldSample) {
        match self.place(sample.key) {
            Ok(place) => {
                let before = self.samples[place].replace(sample);
                self.empty -= usize::from(before.is_none());
            }
            Err(place) => {
                insert(&mut self.keys, place, sample.key);
                insert(&mut self.samples, place, Some(sample));
            }
        }
    }

    pub fn remove(&mut self, key: u64) -> Option<HeldSample> {
        let place = self.place(key).ok()?;
        let sample = self.samples[place].take()?;
        self.empty += 1;
        if self.empty * EMPTY > self.keys.len() {
            self.samples.retain(Option::is_some);
            self.keys.clear();
            self.keys.extend(self.samples.iter().flatten().map(|sample| sample.key));
            self.empty = 0;
        }
        Some(sample)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use gestalt_protocol::{ClassId, RobotId, RoundId};
    use proptest::prelude::*;

    use super::*;
    use crate::sample::SetPart;

    fn sample(key: u64, class: u32) -> HeldSample {
        let round = RoundId { counter: 1, opener: RobotId(1), life: 0 };
        HeldSample {
            key,
            part: SetPart::Personal,
            id: None,
            class: ClassId(class),
            round,
            vector: [0.5].into(),
        }
    }

    proptest! {
        #[test]
        fn it_holds_what_a_tree_holds(ops in proptest::collection::vec((any::<bool>(), 0_u64..40, 0_u32..6), 0..400)) {
            let (mut held, mut tree) = (InOrder::default(), BTreeMap::new());
            for (comes, key, class) in ops {
                if comes {
                    held.insert(sample(key, class));
                    tree.insert(key, sample(key, class));
                } else {
                    prop_assert_eq!(held.remove(key), tree.remove(&key));
                }
                prop_assert_eq!(held.get(key), tree.get(&key));
                prop_assert_eq!(held.len(), tree.len());
                prop_assert!(held.iter().eq(tree.values()));
                prop_assert!(held.iter().rev().eq(tree.values().rev()));
                prop_assert!(held.empty * EMPTY <= held.keys.len(), "few places are empty");
            }
        }
    }
}
