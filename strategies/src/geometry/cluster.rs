//! Samples that lie together, and where.

use super::points::Points;
use super::sum::{ExactSum, narrow};
use crate::sample::HeldSample;

/// Samples with their sum: who lies nearest to their mean is found in one pass.
#[derive(Clone, Debug, Default)]
pub struct Cluster {
    points: Points,
    sum: ExactSum,
}

impl Cluster {
    /// The samples, by key.
    #[must_use]
    pub fn points(&self) -> &Points {
        &self.points
    }

    /// Their sum.
    #[must_use]
    pub fn sum(&self) -> &ExactSum {
        &self.sum
    }

    /// Whether no sample is in.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.points.keys().is_empty()
    }

    /// Takes a sample in.
    pub fn insert(&mut self, sample: &HeldSample) {
        self.points.push(sample.key, &sample.vector);
        self.sum.add(&sample.vector);
    }

    /// Takes a sample out that is in.
    pub fn remove(&mut self, sample: &HeldSample) {
        if let Some(place) = self.points.place(sample.key) {
            self.points.swap_remove(place);
            self.sum.subtract(&sample.vector);
        }
    }

    /// The centroid, in the precision that distances are measured in; `None` of no sample.
    #[must_use]
    pub fn centroid(&self) -> Option<Vec<f32>> {
        Some(narrow(self.sum.mean()?))
    }
}
