//! The batches that the samples held were shared in, as their authors said them.

use std::collections::BTreeSet;
use std::sync::Arc;

use gestalt_protocol::{HeldBatch, SampleId};

use super::grow::insert;

/// Batches in the order of the names of their first samples. They are kept as they came, since an author signs a batch as a whole, and for
/// as long as one sample of them is held; so there are no more of them than shared samples. None is empty.
#[derive(Clone, Debug, Default)]
pub(crate) struct Batches(Vec<Arc<HeldBatch>>);

impl Batches {
    /// Keeps a batch, unless its numbers reach into those of another; says by which name. Honest authors number their samples one
    /// after the other, and of two batches by a liar that overlap the first is passed on.
    pub fn keep(&mut self, batch: impl Into<Arc<HeldBatch>>) -> Option<SampleId> {
        let batch = batch.into();
        let (first, last) = (batch.samples.first()?, batch.samples.samples.last()?.id);
        let place = self.after(first);
        let before = self.0[..place].last().and_then(|before| before.samples.samples.last());
        let behind = self.0.get(place).and_then(|behind| behind.samples.first());
        if before.is_some_and(|before| before.id >= first) || behind.is_some_and(|behind| behind <= last) {
            return None;
        }
        insert(&mut self.0, place, batch);
        Some(first)
    }

    /// How many begin with that sample or before it.
    fn after(&self, id: SampleId) -> usize {
        self.0.partition_point(|batch| batch.samples.first() <= Some(id))
    }

    /// The last batch that begins with that sample or before it, and where it is.
    fn until(&self, id: SampleId) -> Option<(usize, &HeldBatch)> {
        let place = self.after(id).checked_sub(1)?;
        Some((place, &self.0[place]))
    }

    /// The batch of that name, and where it is.
    fn find(&self, first: SampleId) -> Option<(usize, &HeldBatch)> {
        self.until(first).filter(|(_, batch)| batch.samples.first() == Some(first))
    }

    /// The batch of that name.
    pub fn get(&self, first: SampleId) -> Option<&HeldBatch> {
        self.find(first).map(|(_, batch)| batch)
    }

    /// The name of the batch that a sample was shared in, if it is kept.
    pub fn of(&self, id: SampleId) -> Option<SampleId> {
        let (_, batch) = self.until(id)?;
        if batch.samples.samples.iter().any(|sample| sample.id == id) { batch.samples.first() } else { None }
    }

    /// Lets go of those of these batches of which nothing is held; says of which.
    pub fn let_go(
        &mut self,
        firsts: BTreeSet<SampleId>,
        is_held: impl Fn(SampleId) -> bool,
    ) -> Vec<SampleId> {
        let mut gone = Vec::new();
        for first in firsts {
            let Some((place, batch)) = self.find(first) else { continue };
            if !batch.samples.samples.iter().any(|sample| is_held(sample.id)) {
                self.0.remove(place);
                gone.push(first);
            }
        }
        gone
    }

    /// All of them.
    #[cfg(test)]
    pub fn iter(&self) -> impl Iterator<Item = &HeldBatch> {
        self.0.iter().map(|batch| &**batch)
    }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::{ClassId, FeatureSpaceId, RobotId, RoundId, Samples, SharedSample, Stamp, Vector};

    use super::*;

    fn id(life: u32, number: u32) -> SampleId {
        SampleId { author: RobotId(1), life, number }
    }

    fn batch(life: u32, numbers: &[u32]) -> HeldBatch {
        let sample = |number: &u32| SharedSample {
            id: id(life, *number),
            class: ClassId(0),
            round: RoundId { counter: 1, opener: RobotId(1), life: 0 },
            vector: Vector::I8(vec![0]),
        };
        let samples = Samples { space: FeatureSpaceId(0), samples: numbers.iter().map(sample).collect() };
        HeldBatch { robot: RobotId(1), stamp: Stamp::default(), samples, signature: None }
    }

    #[test]
    fn a_sample_is_found_in_its_batch_and_in_no_other() {
        let mut batches = Batches::default();
        assert_eq!(batches.keep(batch(5, &[1, 2, 4])), Some(id(5, 1)));
        assert_eq!(batches.keep(batch(5, &[5])), Some(id(5, 5)));
        assert_eq!(batches.keep(batch(6, &[1])), Some(id(6, 1)));
        assert_eq!(batches.of(id(5, 4)), Some(id(5, 1)));
        assert_eq!(batches.of(id(5, 5)), Some(id(5, 5)));
        assert_eq!(batches.of(id(6, 1)), Some(id(6, 1)));
        for unknown in [id(5, 3), id(5, 6), id(4, 1), id(6, 2)] {
            assert_eq!(batches.of(unknown), None);
        }
    }

    #[test]
    fn batches_that_overlap_are_not_kept_so_none_is_left_behind() {
        let mut batches = Batches::default();
        batches.keep(batch(5, &[10, 20]));
        for liar in [&[10, 20][..], &[10], &[20], &[15], &[5, 10], &[5, 30], &[20, 21], &[1, 12]] {
            assert_eq!(batches.keep(batch(5, liar)), None, "{liar:?}");
        }
        assert_eq!(batches.keep(batch(5, &[21])), Some(id(5, 21)));
        assert_eq!(batches.keep(batch(5, &[1, 9])), Some(id(5, 1)));
        let all: BTreeSet<SampleId> = [id(5, 1), id(5, 10), id(5, 21)].into();
        assert_eq!(batches.let_go(all.clone(), |held| held == id(5, 20)), [id(5, 1), id(5, 21)]);
        assert_eq!(batches.let_go(all, |_| false), [id(5, 10)]);
        assert!(batches.iter().next().is_none());
    }
}
