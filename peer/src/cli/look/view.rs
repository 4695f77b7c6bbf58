//! What a look shows: the picture and the words.

use std::path::Path;

use gestalt_strategies::{Classify, Observation};
use opencv::core::{Mat, Rect};
use opencv::prelude::*;
use serde_json::json;

use super::super::Failure;
use super::super::show::{line, quoted};
use crate::opinion::likeliest;
use crate::picture::stages;
use gestalt_vision::model::RobotModel;
use gestalt_vision::perception::{FeatureSet, GROUPS, NoObservation, Perception, hog_columns};

/// All that is shown.
pub(super) struct View {
    /// The camera's name.
    pub camera: String,
    /// Where the frame is from, in words.
    pub source: String,
    /// The frame.
    pub frame: Mat,
    /// What processed it.
    pub perception: Perception,
    /// What it found.
    pub seen: Result<Observation, NoObservation>,
    /// What judges the hand.
    pub model: RobotModel,
}

impl View {
    /// What the classifier says of the hand, or why it says nothing.
    fn opinion(&self) -> Result<Vec<(String, f64)>, String> {
        let observation = self.seen.as_ref().map_err(|_| "no hand found".to_owned())?;
        let (set, classifier) = (self.perception.feature_set(), &self.model.classifier);
        if set != self.model.features {
            return Err(format!(
                "the model takes {} features: give another with --model",
                self.model.features.name()
            ));
        }
        let probabilities =
            classifier.probabilities(&observation.features).map_err(|error| error.to_string())?;
        let labels = classifier.vocabulary().labels().iter().cloned();
        Ok(labels.zip(probabilities).collect())
    }

    /// The picture: one stage beside the other.
    pub(super) fn draw(&self) -> Result<String, Failure> {
        let perception = &self.perception;
        let balanced = perception.balance(&self.frame)?;
        let [blue, green, red] = perception.gains();
        let found = self.seen.is_ok();
        let mask = if found {
            // Without its margin, the mask covers the region exactly.
            let mask = perception.mask();
            Mat::roi(mask, Rect::new(1, 1, mask.cols() - 2, mask.rows() - 2))?.try_clone()?
        } else {
            perception.candidates().clone()
        };
        let mask = if mask.empty() {
            Mat::new_rows_cols_with_default(3, 4, opencv::core::CV_8U, 0.into())?
        } else {
            mask
        };
        let (features, scale) = self.features();
        let layer = serde_json::to_value(perception.layer())?;
        let off: Vec<&String> = layer
            .as_object()
            .into_iter()
            .flatten()
            .filter(|(_, on)| **on == json!(false))
            .map(|(name, _)| name)
            .collect();
        let stages_on = if off.is_empty() { "all stages on".to_owned() } else { format!("off: {off:?}") };
        Ok(stages::draw(&stages::Stages {
            headline: format!(
                "{}\ncamera: {}; {stages_on}; features: {}; model: {}",
                self.source,
                self.camera,
                perception.feature_set().name(),
                self.model.name
            ),
            frame: &self.frame,
            region: perception.region(),
            balanced: &balanced,
            balance: format!("gains: red {red:.2}, green {green:.2}, blue {blue:.2}"),
            mask: &mask,
            hand: match &self.seen {
                Ok(observation) => Ok(format!("quality {:.2}", observation.quality)),
                Err(cause) => Err(cause.to_string()),
            },
            features,
            scale,
            opinion: self.opinion(),
        })?)
    }

    /// The features in groups, and what their bars mean.
    fn features(&self) -> (stages::Groups, stages::Scale) {
        let Ok(observation) = &self.seen else { return (Vec::new(), (String::new(), 1.0)) };
        match self.perception.feature_set() {
            FeatureSet::Shape => {
                let mut values = observation.features.clone();
                let mut unit = "raw values";
                if self.model.features == FeatureSet::Shape {
                    self.model.classifier.space().scaling().apply(&observation.features, &mut values);
                    unit = "standard deviations from the training mean";
                }
                let mut rest = values.as_slice();
                let group = |(name, length): (&str, usize)| {
                    let (group, others) = rest.split_at(length.min(rest.len()));
                    rest = others;
                    (name.to_owned(), group.to_vec())
                };
                (GROUPS.into_iter().map(group).collect(), (unit.to_owned(), 3.0))
            }
            FeatureSet::Embedding => {
                let values = vec![("embedding".to_owned(), observation.features.clone())];
                (values, ("raw values, each of no meaning by itself".to_owned(), 3.0))
            }
            FeatureSet::Hog => {
                let columns = hog_columns(&observation.features);
                let named = (1..).zip(columns).map(|(i, values): (usize, _)| (format!("column {i}"), values));
                (named.collect(), ("gradient magnitude in 9 orientations, 7 x 7 blocks".to_owned(), 0.4))
            }
        }
    }

    /// One line of text, or a JSON object.
    pub(super) fn say(&self, out: &Path, as_json: bool) -> Result<(), Failure> {
        let opinion = self.opinion();
        let probabilities: Vec<f64> = opinion.iter().flatten().map(|(_, probability)| *probability).collect();
        let best = likeliest(&probabilities).and_then(|(class, probability)| {
            Some((opinion.as_ref().ok()?.get(class.index())?.0.clone(), probability))
        });
        let (width, height) = (self.frame.cols(), self.frame.rows());
        let (hand, quality) = match &self.seen {
            Ok(observation) => (None, Some(observation.quality)),
            Err(cause) => (Some(cause.to_string()), None),
        };
        let region = self.perception.region();
        let object = json!({
            "source": self.source,
            "camera": self.camera,
            "width": width,
            "height": height,
            "hand": quality.is_some(),
            "cause": hand,
            "quality": quality,
            "region": quality.map(|_| [region.x, region.y, region.width, region.height]),
            "gains_bgr": self.perception.gains(),
            "features": self.perception.feature_set().name(),
            "opinion": opinion.as_ref().ok().map(|all| all.iter().cloned().collect::<std::collections::BTreeMap<_, _>>()),
            "class": best.as_ref().map(|(label, _)| label),
            "out": out.display().to_string(),
        });
        let judged = match (&hand, quality, &best, &opinion) {
            (Some(cause), ..) => cause.clone(),
            (_, Some(quality), Some((label, p)), _) => {
                format!("hand (quality {quality:.2}): {}, p = {p:.2}", quoted(label))
            }
            (_, _, _, Err(cause)) => format!("hand; {cause}"),
            _ => "hand".to_owned(),
        };
        let words =
            format!("{}, {}, {width}×{height}: {judged} → {}", self.source, self.camera, out.display());
        line(as_json, &object, &words)
    }
}
