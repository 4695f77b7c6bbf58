//! The classifiers of an experiment's swarms: trained on drawn hands of other people than those that are shown.

use std::sync::Arc;

use gestalt_protocol::ClassId;
use gestalt_strategies::{Classifier, LabelledFeatures};

use super::plan::{Recognition, SwarmPlan, camera};
use crate::experiment::error::ExperimentError;
use gestalt_vision::camera_model::CameraModel;
use gestalt_vision::model::learn_fingers;
use gestalt_vision::perception::{FeatureSet, HandConfig, LayerConfig, Perception};
use gestalt_vision::source::rendered::TrainingFrames;

/// The features that are measured.
pub const FEATURES: FeatureSet = FeatureSet::Shape;

/// The gestures shown: so many fingers.
pub const GESTURES: usize = 6;

/// The people that classifiers are trained on follow from it; those of a run from the run's seed.
const SEED: u64 = 2027;

/// Training covers what robots meet.
const BEARING_DEG: f64 = 80.0;

/// A classifier for each way to see and each choice of cameras.
pub struct Classifiers(Vec<(LayerConfig, Vec<String>, Arc<Classifier>)>);

impl Classifiers {
    /// Trains all that the swarms need.
    pub fn train(
        plan: &Recognition,
        mut progress: impl FnMut(usize, usize),
    ) -> Result<Self, ExperimentError> {
        let mut ways: Vec<(LayerConfig, Vec<String>)> = Vec::new();
        for swarm in &plan.swarms {
            let way = (swarm.layer, swarm.trained_on.clone());
            if !ways.contains(&way) {
                ways.push(way);
            }
        }
        let total = ways.len() * plan.training_frames;
        let mut trained = Vec::new();
        for (n, (layer, cameras)) in ways.into_iter().enumerate() {
            let classifier = train_one(plan, layer, &cameras, |frame| {
                progress(n * plan.training_frames + frame, total);
            })?;
            trained.push((layer, cameras, Arc::new(classifier)));
        }
        Ok(Self(trained))
    }

    /// The one of a swarm.
    pub fn of(&self, swarm: &SwarmPlan) -> &Arc<Classifier> {
        let fits = |(layer, cameras, _): &&(LayerConfig, Vec<String>, _)| {
            *layer == swarm.layer && *cameras == swarm.trained_on
        };
        &self.0.iter().find(fits).expect("one was trained for each swarm of the plan").2
    }
}

fn train_one(
    plan: &Recognition,
    layer: LayerConfig,
    cameras: &[String],
    mut progress: impl FnMut(usize),
) -> Result<Classifier, ExperimentError> {
    let models: Vec<CameraModel> = cameras.iter().map(|name| camera(name)).collect::<Result<_, _>>()?;
    let mut samples = Vec::with_capacity(plan.training_frames);
    let mut eyes: Vec<(String, Perception)> = Vec::new();
    for (n, frame) in
        TrainingFrames::new(models, plan.glove, BEARING_DEG, SEED).take(plan.training_frames).enumerate()
    {
        let frame = frame?;
        if !eyes.iter().any(|(name, _)| *name == frame.camera) {
            let perception =
                Perception::for_camera(FEATURES, HandConfig::default(), layer, &camera(&frame.camera)?)?;
            eyes.push((frame.camera.clone(), perception));
        }
        let perception = eyes.iter_mut().find(|(name, _)| *name == frame.camera);
        if let Some(Ok(seen)) = perception.map(|(_, perception)| perception.observe(&frame.image)) {
            let class = ClassId(frame.class.into());
            samples.push(LabelledFeatures::new(seen.features, class, Some(frame.group)));
        }
        progress(n + 1);
    }
    learn_fingers(FEATURES, &samples, SEED)
        .map_err(|error| ExperimentError::Setting(format!("training: {error}")))
}
