//! The classifier a robot starts with, and the features it needs to be shown.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use gestalt_protocol::ClassId;
use gestalt_strategies::{Classifier, Progress, Sample, TrainError, TrainOptions, Vocabulary, train};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use thiserror::Error;

use crate::model_file::{Model, ModelFileError, Origin};
use crate::perception::{FeatureSet, FeatureSetError, HandConfig, Perception, PerceptionError};
use crate::source::rendered::TrainingFrames;
use crate::source::{Glove, SourceError};

/// A classifier with what its user must know of it.
#[derive(Clone, Debug)]
pub struct RobotModel {
    /// The classifier.
    pub classifier: Arc<Classifier>,
    /// The features it was trained on.
    pub features: FeatureSet,
    /// Its name for people.
    pub name: String,
}

/// Why there is no model.
#[derive(Debug, Error)]
pub enum ModelError {
    /// The file.
    #[error(transparent)]
    File(#[from] ModelFileError),
    /// The file holds a classifier for features that this program cannot compute.
    #[error("model {path}: {cause}; train it again with this release")]
    Features {
        /// Which file.
        path: PathBuf,
        /// Which features.
        cause: FeatureSetError,
    },
    /// No frames to train on.
    #[error("training on drawn hands: {0}")]
    Source(#[from] SourceError),
    /// No perception to train with.
    #[error("training on drawn hands: {0}")]
    Perception(#[from] PerceptionError),
    /// The training itself.
    #[error("training on drawn hands: {0}")]
    Training(#[from] TrainError),
}

/// How many drawn frames the embedded model is trained on.
const RENDERED_FRAMES: usize = 1500;

impl RobotModel {
    /// The embedded model, trained on rendered hands. `progress` is told how far the training has come, as done and
    /// total.
    ///
    /// # Errors
    /// See [`ModelError`].
    pub fn rendered(progress: impl FnMut(usize, usize)) -> Result<Self, ModelError> {
        Self::new(train_on_rendered(progress)?, "trained on drawn hands".to_owned(), PathBuf::new())
    }

    /// The model in a file that `gestalt train` wrote.
    ///
    /// # Errors
    /// See [`ModelError`].
    pub fn read(path: &Path) -> Result<Self, ModelError> {
        Self::new(Model::read(path)?.classifier, path.display().to_string(), path.to_owned())
    }

    /// Writes its classifier to a file.
    ///
    /// # Errors
    /// [`ModelError::File`].
    pub fn write(&self, path: &Path) -> Result<(), ModelError> {
        let origin = Origin { dataset: self.name.clone(), ..Origin::default() };
        Ok(Model { classifier: Classifier::clone(&self.classifier), origin }.write(path)?)
    }

    fn new(classifier: Classifier, name: String, path: PathBuf) -> Result<Self, ModelError> {
        let features =
            classifier.space().feature_set().parse().map_err(|cause| ModelError::Features { path, cause })?;
        Ok(Self { classifier: Arc::new(classifier), features, name })
    }
}

/// Trains the embedded model: gestures `0` to `5`, drawn for all cameras, from the same seed every time.
///
/// # Errors
/// See [`ModelError`].
pub fn train_on_rendered(mut progress: impl FnMut(usize, usize)) -> Result<Classifier, ModelError> {
    const SEED: u64 = 2026;
    let features = FeatureSet::Shape;
    let mut perception = Perception::new(features, HandConfig::default())?;
    let mut samples = Vec::with_capacity(RENDERED_FRAMES);
    // The robots of a swarm stand within ±80°; frames without a hand to be found teach nothing.
    for frame in TrainingFrames::new(Vec::new(), Glove::default(), 80.0, SEED).take(RENDERED_FRAMES) {
        let frame = frame?;
        if let Ok(observation) = perception.observe(&frame.image) {
            samples.push(Sample {
                features: observation.features,
                class: ClassId(frame.class),
                group: Some(frame.group),
            });
        }
        progress(samples.len(), RENDERED_FRAMES);
    }
    Ok(learn_fingers(features, &samples, SEED)?)
}

/// Learns the gestures `0` to `5` from drawn hands, with the one choice of parameters that serves them.
///
/// # Errors
/// See [`TrainError`].
///
/// # Panics
/// Never: the six labels are a vocabulary.
pub fn learn_fingers(features: FeatureSet, samples: &[Sample], seed: u64) -> Result<Classifier, TrainError> {
    let vocabulary = Vocabulary::new(["0", "1", "2", "3", "4", "5"])
        .expect("six different labels of one letter are a vocabulary");
    let options = TrainOptions { costs: vec![8.0], gammas: vec![1.0], ..TrainOptions::default() };
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    train(features.name(), &vocabulary, samples, &options, rng, |_: Progress| {})
        .map(|trained| trained.classifier)
}
