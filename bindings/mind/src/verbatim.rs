//! A classifier for hosts that have their own: what they observe are the probabilities themselves.

use gestalt_strategies::{Classify, ClassifyError, Vocabulary};

use crate::error::MindError;

/// How far the sum of a host's probabilities may be from 1: single precision, and then some.
const TOLERANCE: f64 = 1e-3;

/// Takes the features for the probabilities.
#[derive(Debug)]
pub(crate) struct Verbatim(pub Vocabulary);

impl Classify for Verbatim {
    fn vocabulary(&self) -> &Vocabulary {
        &self.0
    }

    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        let expected = self.0.classes();
        if features.len() != expected {
            return Err(ClassifyError::Length { found: features.len(), expected });
        }
        let sum: f64 = features.iter().copied().map(f64::from).sum();
        Ok(features.iter().map(|p| f64::from(*p) / sum).collect())
    }
}

/// Whether these are a probability for each of so many classes.
pub(crate) fn check(probabilities: &[f32], classes: usize) -> Result<(), MindError> {
    let wrong = |cause| Err(MindError::Probabilities(cause));
    if probabilities.len() != classes {
        return wrong(format!("{} values, the vocabulary has {classes} gestures", probabilities.len()));
    }
    // NaN is in no range.
    if let Some(place) = probabilities.iter().position(|p| !(0.0..=1.0).contains(p)) {
        return wrong(format!("value {place} is {}, not from 0 to 1", probabilities[place]));
    }
    let sum: f64 = probabilities.iter().copied().map(f64::from).sum();
    if (sum - 1.0).abs() > TOLERANCE {
        return wrong(format!("they sum to {sum}, not to 1"));
    }
    Ok(())
}
