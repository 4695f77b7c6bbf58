//! A classifier whose features are the probabilities themselves, so that a scenario says what a robot sees.

use gestalt_protocol::ClassId;
use gestalt_strategies::{Classify, ClassifyError, Observation, Vocabulary};

/// Tells six gestures apart, the numbers 0 to 5, by being told.
#[derive(Debug)]
pub struct Fixed(Vocabulary);

impl Default for Fixed {
    fn default() -> Self {
        Self(Vocabulary::new((0..6).map(|k| k.to_string())).expect("six different labels"))
    }
}

impl Classify for Fixed {
    fn vocabulary(&self) -> &Vocabulary {
        &self.0
    }

    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        if features.len() != self.0.classes() {
            return Err(ClassifyError::Length { found: features.len(), expected: self.0.classes() });
        }
        Ok(features.iter().map(|p| f64::from(*p)).collect())
    }
}

/// What a frame shows to a robot that sees `class` with probability `p`.
#[must_use]
pub fn look(class: ClassId, p: f32) -> Observation {
    let mut features = vec![(1.0 - p) / 5.0; 6];
    features[class.index()] = p;
    Observation { features, quality: 1.0 }
}
