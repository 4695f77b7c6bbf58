//! The feature spaces and classifiers that runs start from, made once and shared by all.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use gestalt_protocol::ClassId;
use gestalt_strategies::{
    Classifier, Classify, Components, FeatureSpace, LabelledFeatures, Learner, LearnerOptions, ScalingMethod,
    Vocabulary,
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::error::ExperimentError;
use super::setting::{Method, Setting, Start};
use crate::emulation::School;
use gestalt_vision::dataset::Dataset;
use gestalt_vision::model::RobotModel;
use gestalt_vision::network::EMBEDDING;
use gestalt_vision::perception::{FeatureSet, HandConfig, Perception};
use gestalt_vision::source::Glove;
use gestalt_vision::source::rendered::TrainingFrames;
use gestalt_vision::survey::Survey;

/// Rendered people who show each gesture once to fit a feature space on, and up to which bearing they are seen.
const PEOPLE: usize = 40;
const BEARING_DEG: f64 = 75.0;

/// Of these, who teach the model that robots may start from; and up to which bearing: cameras that nobody thought of
/// when it was trained are what robots learn on the spot for.
const MODEL_PEOPLE: usize = 8;
const MODEL_BEARING_DEG: f64 = 10.0;

/// A feature space, and the classifier that robots start from, if from any.
type Beginning = (Arc<FeatureSpace>, Option<Arc<Classifier>>);

/// Labelled hands, other than those that robots see.
#[derive(Debug)]
pub struct Schools {
    vocabulary: Vocabulary,
    features: FeatureSet,
    nothing: Vec<LabelledFeatures>,
    model: Vec<LabelledFeatures>,
    made: BTreeMap<String, Arc<School>>,
}

impl Schools {
    /// Looks at rendered hands and, for the model that robots may start from, at the pictures of `dataset` if there is
    /// one. Where robots see a ready vocabulary (`ready`), their feature space is fitted on hands that count, of which no
    /// gesture is theirs. Embeddings (`features`) have a space already, and no rendered hands.
    ///
    /// # Errors
    /// A dataset that cannot be read, or has not all gestures of the vocabulary.
    pub fn new(
        vocabulary: Vocabulary,
        (features, ready): (FeatureSet, bool),
        dataset: Option<&Path>,
    ) -> Result<Self, ExperimentError> {
        let mut perception = Perception::new(features, HandConfig::default())?;
        let pictured = |perception: &mut Perception| {
            let survey = |folder| -> Result<_, ExperimentError> {
                let dataset = Dataset::list(folder, Some(vocabulary.labels()))?;
                Ok(Survey::of(&dataset.images, perception, || ()).samples())
            };
            dataset.map(survey).transpose()
        };
        let (nothing, model) = if features == FeatureSet::Embedding {
            // Their space is there already.
            (Vec::new(), pictured(&mut perception)?.unwrap_or_default())
        } else if ready {
            let counts = Vocabulary::new((0..6).map(|n| n.to_string()));
            let counts = counts.map_err(|error| ExperimentError::Setting(error.to_string()))?;
            (rendered(&counts, PEOPLE, BEARING_DEG, &mut perception)?, Vec::new())
        } else {
            let nothing = rendered(&vocabulary, PEOPLE, BEARING_DEG, &mut perception)?;
            let model = match pictured(&mut perception)? {
                Some(samples) => samples,
                None => rendered(&vocabulary, MODEL_PEOPLE, MODEL_BEARING_DEG, &mut perception)?,
            };
            (nothing, model)
        };
        Ok(Self { vocabulary, features, nothing, model, made: BTreeMap::new() })
    }

    /// The school of a setting.
    ///
    /// # Errors
    /// Hands that nothing can be learned from.
    pub fn of(&mut self, setting: &Setting) -> Result<Arc<School>, ExperimentError> {
        let options = &setting.learning.learner;
        let key = format!("{:?} {:?} {} {options:?}", setting.start, setting.reduction, setting.components);
        if let Some(school) = self.made.get(&key) {
            return Ok(school.clone());
        }
        let (space, start) = match self.features {
            FeatureSet::Embedding => self.embedded(setting)?,
            _ => self.measured(setting)?,
        };
        let school = Arc::new(School::new(space, self.vocabulary.clone(), start, options.clone())?);
        self.made.insert(key, school.clone());
        Ok(school)
    }

    /// A space fitted on the hands that robots start from, and what they start from.
    fn measured(&self, setting: &Setting) -> Result<Beginning, ExperimentError> {
        let samples = match setting.start {
            Start::Nothing => &self.nothing,
            Start::Model => &self.model,
            Start::Shipped => {
                return wrong("start: the shipped model is of learned eyes: say features: 'embedding'");
            }
        };
        let space = Arc::new(space(self.features, samples, setting.reduction, setting.components));
        let start = match setting.start {
            Start::Nothing => None,
            _ => Some(self.train(&space, &setting.learning.learner)?),
        };
        Ok((space, start))
    }

    /// The space of the shipped model, and what robots start from.
    fn embedded(&self, setting: &Setting) -> Result<Beginning, ExperimentError> {
        if (setting.reduction, setting.components) != (Method::Pca, EMBEDDING) {
            return wrong(
                "features: an embedding keeps all its 24 numbers: leave reduction and components out",
            );
        }
        let shipped = RobotModel::hands()?.classifier;
        let options = &setting.learning.learner;
        let start = match setting.start {
            Start::Nothing => None,
            Start::Model if self.model.is_empty() => {
                return wrong("start: learned eyes know bare hands only: say of which with --start-dataset");
            }
            Start::Model => Some(self.train(shipped.space(), options)?),
            Start::Shipped => {
                let known = shipped.vectors().filter_map(|(class, vector)| {
                    let label = shipped.vocabulary().labels().get(class.index())?;
                    Some((self.vocabulary.class(label)?, vector.to_vec()))
                });
                Some(self.learn(shipped.space(), options, known)?)
            }
        };
        Ok((shipped.space().clone(), start))
    }

    fn train(
        &self,
        space: &Arc<FeatureSpace>,
        options: &LearnerOptions,
    ) -> Result<Arc<Classifier>, ExperimentError> {
        let in_space = self.model.iter().filter_map(|sample| {
            let coordinates = space.project(&sample.features).ok()?;
            Some((sample.class, coordinates))
        });
        self.learn(space, options, in_space)
    }

    fn learn(
        &self,
        space: &Arc<FeatureSpace>,
        options: &LearnerOptions,
        samples: impl Iterator<Item = (ClassId, Vec<f32>)>,
    ) -> Result<Arc<Classifier>, ExperimentError> {
        let mut learner = Learner::new(space.clone(), self.vocabulary.clone(), options.clone())?;
        for (key, (class, coordinates)) in (0..).zip(samples) {
            learner.insert(key, class, &coordinates)?;
        }
        Ok(learner.learn()?)
    }
}

fn wrong<T>(what: &str) -> Result<T, ExperimentError> {
    Err(ExperimentError::Setting(what.to_owned()))
}

fn space(
    features: FeatureSet,
    samples: &[LabelledFeatures],
    method: Method,
    components: usize,
) -> FeatureSpace {
    let scaling = ScalingMethod::PerComponent;
    match method.ranking() {
        None => {
            let rows = samples.iter().map(|sample| sample.features.as_slice());
            let mut rng = ChaCha8Rng::seed_from_u64(1);
            FeatureSpace::fit(features.name(), rows, scaling, Components::Count(components), &mut rng)
        }
        Some(ranking) => {
            let samples: Vec<(&[f32], ClassId)> =
                samples.iter().map(|sample| (sample.features.as_slice(), sample.class)).collect();
            FeatureSpace::fit_ranked(features.name(), &samples, scaling, ranking, components)
        }
    }
}

/// Rendered hands of the gestures that the vocabulary has.
fn rendered(
    vocabulary: &Vocabulary,
    people: usize,
    bearing_deg: f64,
    perception: &mut Perception,
) -> Result<Vec<LabelledFeatures>, ExperimentError> {
    let frames = TrainingFrames::new(Vec::new(), Glove::Cyan, bearing_deg, 0x7eac4);
    let mut samples = Vec::new();
    for frame in frames.take(6 * people) {
        let frame = frame?;
        let class = vocabulary.class(&frame.class.to_string());
        if let (Ok(seen), Some(class)) = (perception.observe(&frame.image), class) {
            samples.push(LabelledFeatures::new(seen.features, class, Some(frame.group)));
        }
    }
    if samples.len() < 2 {
        return Err(ExperimentError::Setting(
            "no gesture of the dataset is a count of fingers that can be rendered: give --start-dataset"
                .to_owned(),
        ));
    }
    Ok(samples)
}
