//! The classifier of a robot: scaling, principal components, one-vs-one support vector machines, calibrated
//! probabilities.
//!
//! ```text
//! raw features ─► Scaling ─► Pca ─► Machine: a decision per pair ─► Calibration: P(k)
//! ```

mod calibration;
mod codec;
mod coupling;
mod kernel;
mod machine;
mod sigmoid;
mod space;

use gestalt_protocol::FeatureSpaceId;

pub(crate) use calibration::Calibration;
pub use codec::{MAX_MODEL, ModelError};
use coupling::couple;
pub(crate) use kernel::dot;
pub(crate) use machine::Machine;
use machine::pairs;
use sigmoid::Sigmoid;
pub(crate) use space::Space;

use crate::{Classify, ClassifyError, Pca, Scaling, Vocabulary};

/// A trained classifier. [`crate::train`] makes one, [`Classifier::decode`] reads one.
#[derive(Clone, Debug, PartialEq)]
pub struct Classifier {
    feature_set: String,
    vocabulary: Vocabulary,
    space: Space,
    machine: Machine,
    calibration: Calibration,
    /// Follows from the above; kept because it is asked for with every sample.
    id: FeatureSpaceId,
}

impl Classifier {
    pub(crate) fn new(
        feature_set: String,
        vocabulary: Vocabulary,
        space: Space,
        machine: Machine,
        calibration: Calibration,
    ) -> Self {
        let id = space.id(&feature_set);
        Self { feature_set, vocabulary, space, machine, calibration, id }
    }

    /// The name of the raw feature set it was trained on, such as `hog-1`.
    #[must_use]
    pub fn feature_set(&self) -> &str {
        &self.feature_set
    }

    /// How many raw features it takes.
    #[must_use]
    pub fn features(&self) -> usize {
        self.space.scaling.width()
    }

    /// Names the space of [`Self::reduce`]: the same for two classifiers only if their vectors may be mixed.
    #[must_use]
    pub fn space(&self) -> FeatureSpaceId {
        self.id
    }

    /// Its scaling.
    #[must_use]
    pub fn scaling(&self) -> &Scaling {
        &self.space.scaling
    }

    /// Its principal components.
    #[must_use]
    pub fn pca(&self) -> &Pca {
        &self.space.pca
    }

    /// How many support vectors all pairs share.
    #[must_use]
    pub fn support_vectors(&self) -> usize {
        self.machine.counts.iter().sum()
    }

    /// The coordinates of a raw feature vector in the space that the classifier judges in.
    ///
    /// # Errors
    /// See [`ClassifyError`].
    pub fn reduce(&self, features: &[f32]) -> Result<Vec<f32>, ClassifyError> {
        if features.len() != self.features() {
            return Err(ClassifyError::Length { found: features.len(), expected: self.features() });
        }
        if let Some(component) = features.iter().position(|x| !x.is_finite()) {
            return Err(ClassifyError::NotFinite(component));
        }
        Ok(self.space.project(features))
    }
}

impl Classify for Classifier {
    fn vocabulary(&self) -> &Vocabulary {
        &self.vocabulary
    }

    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        let reduced = self.reduce(features)?;
        let mut decisions = Vec::with_capacity(self.machine.offsets.len());
        self.machine.decide(&reduced, &mut decisions);
        Ok(self.calibration.probabilities(&decisions, self.vocabulary.classes()))
    }
}
