//! What a classifier is to be trained on from now on.

use std::sync::Arc;

use gestalt_protocol::ClassId;
use gestalt_svm::{LearnError, Learner};

use crate::sample::HeldSample;

/// One change of the samples that a classifier is to be trained on.
#[derive(Clone, Debug, PartialEq)]
pub enum TrainingChange {
    /// This sample is new, or replaces the one of that key.
    Insert {
        /// Names the sample.
        key: u64,
        /// The gesture it shows.
        class: ClassId,
        /// Its coordinates in the feature space.
        vector: Arc<[f32]>,
    },
    /// That sample is gone.
    Remove(u64),
    /// That sample shows another gesture.
    Relabel {
        /// Which sample.
        key: u64,
        /// The gesture it shows.
        class: ClassId,
    },
}

impl TrainingChange {
    /// Makes a learner follow it.
    ///
    /// # Errors
    /// [`LearnError`] for a sample that cannot be trained on; the learner is unchanged.
    pub fn apply_to(&self, learner: &mut Learner) -> Result<(), LearnError> {
        match self {
            Self::Insert { key, class, vector } => learner.insert(*key, *class, vector),
            Self::Remove(key) => {
                learner.remove(*key);
                Ok(())
            }
            Self::Relabel { key, class } => learner.relabel(*key, *class).map(|_| ()),
        }
    }
}

/// A sample of the training set as one to be trained on.
pub(super) fn inserted(sample: &HeldSample) -> TrainingChange {
    TrainingChange::Insert { key: sample.key, class: sample.class, vector: sample.vector.clone() }
}
