//! The classifier of a robot: scaling, principal components, one-vs-one support vector machines, calibrated
//! probabilities.
//!
//! ```text
//! raw features ─► FeatureSpace ─► Machine: a decision per pair ─► Calibration: P(k)
//! ```

mod calibration;
mod codec;
mod coupling;
mod kernel;
mod machine;
mod sigmoid;

use std::sync::Arc;

pub(crate) use calibration::Calibration;
pub use codec::{MAX_MODEL, ModelError};
use coupling::couple;
pub(crate) use kernel::dot;
pub(crate) use machine::Machine;
use machine::pairs;
use sigmoid::Sigmoid;

use crate::{Classify, ClassifyError, FeatureSpace, Vocabulary};

/// A trained classifier. [`crate::train`] makes one, [`Classifier::decode`] reads one.
#[derive(Clone, Debug, PartialEq)]
pub struct Classifier {
    vocabulary: Vocabulary,
    space: Arc<FeatureSpace>,
    machine: Machine,
    calibration: Calibration,
}

impl Classifier {
    pub(crate) fn new(
        vocabulary: Vocabulary,
        space: Arc<FeatureSpace>,
        machine: Machine,
        calibration: Calibration,
    ) -> Self {
        Self { vocabulary, space, machine, calibration }
    }

    /// The space it judges in.
    #[must_use]
    pub fn space(&self) -> &Arc<FeatureSpace> {
        &self.space
    }

    /// How many support vectors all pairs share.
    #[must_use]
    pub fn support_vectors(&self) -> usize {
        self.machine.counts.iter().sum()
    }
}

impl Classify for Classifier {
    fn vocabulary(&self) -> &Vocabulary {
        &self.vocabulary
    }

    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        let reduced = self.space.project(features)?;
        let mut decisions = Vec::with_capacity(self.machine.offsets.len());
        self.machine.decide(&reduced, &mut decisions);
        Ok(self.calibration.probabilities(&decisions, self.vocabulary.classes()))
    }
}
