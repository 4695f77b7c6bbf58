//! What a classifier is to be trained on from now on.

use std::sync::Arc;

use gestalt_protocol::{ClassId, Fnv1a, RoundId};
use gestalt_svm::{LearnError, Learner};

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
        /// Names the round it was seen in: samples of one repeat each other.
        showing: u64,
        /// Where groups of authors are learned from apart: of which its author is; `None` for this robot itself.
        group: Option<usize>,
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
            Self::Insert { key, class, vector, showing, group } => {
                learner.insert_of(*group, *key, *class, vector.clone(), *showing)
            }
            Self::Remove(key) => {
                learner.remove(*key);
                Ok(())
            }
            Self::Relabel { key, class } => learner.relabel(*key, *class).map(|_| ()),
        }
    }
}

/// A sample as one to be trained on as that gesture, or no longer.
pub(super) fn inserted_as(
    class: Option<ClassId>,
    key: u64,
    vector: &Arc<[f32]>,
    round: RoundId,
    group: Option<usize>,
) -> TrainingChange {
    match class {
        Some(class) => {
            let (vector, showing) = (vector.clone(), showing(round));
            TrainingChange::Insert { key, class, vector, showing, group }
        }
        None => TrainingChange::Remove(key),
    }
}

/// A number for a round, the same at every robot.
pub(super) fn showing(round: RoundId) -> u64 {
    let mut fnv = Fnv1a::default();
    fnv.add([round.counter, round.opener.0, round.life].into_iter().flat_map(u32::to_le_bytes));
    fnv.hash()
}
