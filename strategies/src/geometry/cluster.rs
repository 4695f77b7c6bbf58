//! Samples that lie together, and where.

use super::points::Points;
use super::sum::{Sum, narrow};
use crate::sample::HeldSample;

/// Samples with their sum: who lies nearest to their mean is found in one pass.
#[derive(Clone, Debug, Default)]
pub(crate) struct Cluster {
    pub(crate) points: Points,
    pub(crate) sum: Sum,
}

impl Cluster {
    /// Takes a sample in.
    pub(crate) fn insert(&mut self, sample: &HeldSample) {
        self.points.push(sample.key, &sample.vector);
        self.sum.add(&sample.vector);
    }

    /// Takes a sample out that is in.
    pub(crate) fn remove(&mut self, sample: &HeldSample) {
        if let Some(place) = self.points.place(sample.key) {
            self.points.swap_remove(place);
            self.sum.subtract(&sample.vector);
        }
    }

    /// The centroid, in the precision that distances are measured in; `None` of no sample.
    pub(crate) fn centroid(&self) -> Option<Vec<f32>> {
        Some(narrow(self.sum.mean()?))
    }
}
