//! The classifier a robot starts with, and the features it needs to be shown.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use gestalt_protocol::ClassId;
use gestalt_strategies::{
    Classifier, LabelledFeatures, TrainError, TrainOptions, TrainProgress, Vocabulary, train,
};
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

/// The model of rendered hands: what [`train_on_rendered`] gives. `gestalt train --rendered --out FILE` makes it again.
const RENDERED: &[u8] = include_bytes!("../models/rendered.gestalt");

/// The model of learned eyes: trained together with their weights, see `peer/training`.
const HANDS: &[u8] = include_bytes!("../models/hands.gestalt");

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
    #[error("training on synthetic hands: {0}")]
    Source(#[from] SourceError),
    /// No perception to train with.
    #[error("training on synthetic hands: {0}")]
    Perception(#[from] PerceptionError),
    /// The training itself.
    #[error("training on synthetic hands: {0}")]
    Training(#[from] TrainError),
}

/// How many rendered frames the embedded model is trained on.
const FRAMES: usize = 1500;

impl RobotModel {
    /// The model of learned eyes: gestures `0` to `5`, of bare hands before any camera.
    ///
    /// # Errors
    /// See [`ModelError`].
    pub fn hands() -> Result<Self, ModelError> {
        Self::new(hands()?, "trained on many hands".to_owned(), PathBuf::from("hands"))
    }

    /// The model of rendered hands: gestures `0` to `5`, trained on synthetic hands.
    ///
    /// # Errors
    /// See [`ModelError`].
    pub fn rendered() -> Result<Self, ModelError> {
        Self::new(rendered()?, "trained on synthetic hands".to_owned(), PathBuf::from("rendered"))
    }

    /// The model in a file that `gestalt train` wrote.
    ///
    /// # Errors
    /// See [`ModelError`].
    pub fn read(path: &Path) -> Result<Self, ModelError> {
        Self::new(Model::read(path)?, path.display().to_string(), path.to_owned())
    }

    /// Writes its classifier to a file.
    ///
    /// # Errors
    /// [`ModelError::File`].
    pub fn write(&self, path: &Path) -> Result<(), ModelError> {
        let origin = Origin { dataset: self.name.clone(), ..Origin::default() };
        Ok(Model { classifier: Classifier::clone(&self.classifier), origin }.write(path)?)
    }

    fn new(model: Model, name: String, path: PathBuf) -> Result<Self, ModelError> {
        let features = model.classifier.space().feature_set().parse();
        let features: FeatureSet = features.map_err(|cause| ModelError::Features { path, cause })?;
        model.check_features(features.name(), features.length())?;
        Ok(Self { classifier: Arc::new(model.classifier), features, name })
    }
}

/// The model of learned eyes, with the record of its training.
///
/// # Errors
/// See [`ModelFileError`].
pub fn hands() -> Result<Model, ModelFileError> {
    Model::decode(HANDS, Path::new("hands"))
}

/// The model of rendered hands, with the record of its training.
///
/// # Errors
/// See [`ModelFileError`].
pub fn rendered() -> Result<Model, ModelFileError> {
    Model::decode(RENDERED, Path::new("rendered"))
}

/// Makes the model of rendered hands: gestures `0` to `5`, rendered for all cameras, from the same seed every time. `progress` is
/// told how far it has come, as done and total.
///
/// # Errors
/// See [`ModelError`].
pub fn train_on_rendered(mut progress: impl FnMut(usize, usize)) -> Result<Model, ModelError> {
    const SEED: u64 = 2026;
    let features = FeatureSet::Shape;
    let samples = rendered_samples(features, SEED, FRAMES, |done| progress(done, FRAMES))?;
    let classifier = learn_fingers(features, &samples, SEED)?;
    let origin = Origin {
        dataset: format!(
            "{FRAMES} rendered frames, {} of them with a hand found: all camera presets, {:?} gloves, bearing ±{BEARING_DEG}°",
            samples.len(),
            Glove::default(),
        ),
        people: samples
            .iter()
            .filter_map(|sample| sample.group)
            .collect::<BTreeSet<_>>()
            .into_iter()
            .collect(),
        images: Vec::new(),
        seed: SEED,
        cost: COST,
        gamma: GAMMA,
    };
    Ok(Model { classifier, origin })
}

/// The robots of a swarm stand within this bearing, to either side.
const BEARING_DEG: f64 = 80.0;

/// What perception finds in rendered frames. Frames without a hand to be found teach nothing.
fn rendered_samples(
    features: FeatureSet,
    seed: u64,
    frames: usize,
    mut progress: impl FnMut(usize),
) -> Result<Vec<LabelledFeatures>, ModelError> {
    let mut perception = Perception::new(features, HandConfig::default())?;
    let mut samples = Vec::with_capacity(frames);
    let rendered = TrainingFrames::new(Vec::new(), Glove::default(), BEARING_DEG, seed).take(frames);
    for (done, frame) in (1..).zip(rendered) {
        let frame = frame?;
        if let Ok(observation) = perception.observe(&frame.image) {
            let (class, group) = (ClassId(frame.class.into()), Some(frame.group));
            samples.push(LabelledFeatures::new(observation.features, class, group));
        }
        progress(done);
    }
    Ok(samples)
}

/// C, and γ in units of 1 / (total variance of the reduced samples): what serves rendered hands.
const COST: f64 = 8.0;
const GAMMA: f64 = 1.0;

/// Learns the gestures `0` to `5` from rendered hands, with the one choice of parameters that serves them.
///
/// # Errors
/// See [`TrainError`].
///
/// # Panics
/// Never: the six labels are a vocabulary.
pub fn learn_fingers(
    features: FeatureSet,
    samples: &[LabelledFeatures],
    seed: u64,
) -> Result<Classifier, TrainError> {
    let vocabulary = Vocabulary::new(["0", "1", "2", "3", "4", "5"])
        .expect("six different labels of one letter are a vocabulary");
    let options = TrainOptions { costs: vec![COST], gammas: vec![GAMMA], ..TrainOptions::default() };
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    train(features.name(), &vocabulary, samples, &options, rng, |_: TrainProgress| {})
        .map(|trained| trained.classifier)
}

#[cfg(test)]
mod tests {
    use gestalt_strategies::{Classify, Evaluation};

    use super::*;

    /// Frames that the model was not trained on.
    fn fresh_samples() -> Vec<LabelledFeatures> {
        let samples = rendered_samples(FeatureSet::Shape, 4711, 300, |_| ()).unwrap();
        assert!(samples.len() > 250, "a hand in {} of 300 frames", samples.len());
        samples
    }

    #[test]
    fn the_model_of_learned_eyes_is_made_for_their_weights() {
        let model = hands().unwrap();
        assert_eq!(model.classifier.vocabulary().labels(), ["0", "1", "2", "3", "4", "5"]);
        model.check_features(FeatureSet::Embedding.name(), FeatureSet::Embedding.length()).unwrap();
        assert_eq!(RobotModel::hands().unwrap().features, FeatureSet::Embedding);
    }

    #[test]
    fn a_model_for_features_of_another_name_or_number_is_refused() {
        let sample = |n: u8| {
            LabelledFeatures::new(vec![f32::from(n % 2), f32::from(n)], ClassId((n % 2).into()), None)
        };
        let samples: Vec<LabelledFeatures> = (0..20).map(sample).collect();
        let vocabulary = Vocabulary::new(["fist", "palm"]).unwrap();
        // The set's own name, and the name without a version.
        for name in [FeatureSet::Shape.name(), "shape"] {
            let mut rng = ChaCha8Rng::seed_from_u64(1);
            let trained =
                train(name, &vocabulary, &samples, &TrainOptions::default(), &mut rng, |_| ()).unwrap();
            let model = Model { classifier: trained.classifier, origin: Origin::default() };
            let error = RobotModel::new(model, String::new(), PathBuf::new()).unwrap_err();
            assert!(matches!(error, ModelError::File(ModelFileError::FeatureSet { .. })), "{error}");
        }
    }

    #[test]
    fn the_model_of_rendered_hands_is_made_for_the_perception_of_today() {
        let model = rendered().unwrap();
        assert_eq!(model.classifier.vocabulary().labels(), ["0", "1", "2", "3", "4", "5"]);
        model.check_features(FeatureSet::Shape.name(), FeatureSet::Shape.length()).unwrap();
        assert!(model.origin.dataset.starts_with("1500 rendered frames"), "{}", model.origin.dataset);
        assert_eq!(RobotModel::rendered().unwrap().features, FeatureSet::Shape);
    }

    /// When perception or the rendered hands change what they give, this falls: make the model again, with `gestalt train
    /// --rendered --out peer/vision/models/rendered.gestalt`.
    #[test]
    fn the_model_of_rendered_hands_reads_hands_it_has_not_seen() {
        let classifier = RobotModel::rendered().unwrap().classifier;
        let mut evaluation = Evaluation::new(6);
        for sample in fresh_samples() {
            evaluation.record(sample.class, &classifier.probabilities(&sample.features).unwrap());
        }
        let accuracy = evaluation.accuracy().unwrap().value;
        // It was .937 when the model was made.
        assert!(accuracy > 0.9, "accuracy {accuracy:.3}: the model is stale");
    }

    #[test]
    fn the_model_of_rendered_hands_can_be_made_again() {
        if std::env::var_os("GESTALT_LONG").is_none() {
            return;
        }
        let shipped = rendered().unwrap();
        let again = train_on_rendered(|_, _| ()).unwrap();
        assert_eq!(again.origin, shipped.origin);
        assert_eq!(again.classifier, shipped.classifier);
    }
}
