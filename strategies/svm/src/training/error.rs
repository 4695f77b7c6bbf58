//! What nothing can be learned from, and the check for it.

use std::iter;

use gestalt_protocol::ClassId;
use gestalt_rounds::Vocabulary;
use linfa_svm::SvmError;
use thiserror::Error;

use super::options::TrainOptions;
use crate::labelled::LabelledFeatures;
use crate::reduction::Components;

/// Samples or options that nothing can be learned from.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum TrainError {
    /// An option out of its range.
    #[error("training option out of range: {0}")]
    Option(&'static str),
    /// A feature vector, of a sample or of a variation, of another length than the first.
    #[error("sample {sample} has {found} features, the first has {expected}")]
    Length {
        /// Index of the sample.
        sample: usize,
        /// Its features.
        found: usize,
        /// Features of the first sample.
        expected: usize,
    },
    /// A feature that is NaN or infinite.
    #[error("feature {component} of sample {sample} is not finite")]
    NotFinite {
        /// Index of the sample.
        sample: usize,
        /// Index of the feature.
        component: usize,
    },
    /// A class that the vocabulary does not have.
    #[error("sample {sample} is of class {class}, which the vocabulary does not have")]
    Class {
        /// Index of the sample.
        sample: usize,
        /// Its class.
        class: ClassId,
    },
    /// A gesture of the vocabulary with fewer samples than can be held out and learned from.
    #[error("gesture '{label}' has {found} samples, training needs at least {MIN_SAMPLES} of each")]
    TooFew {
        /// The gesture.
        label: String,
        /// Its samples.
        found: usize,
    },
    /// All samples are the same.
    #[error("all samples have the same features: nothing tells the gestures apart")]
    NoVariance,
    /// No pair of C and γ gave finite probabilities.
    #[error("no C and γ gave a usable machine: try other values")]
    NoFit,
    /// The solver refused.
    #[error("the support vector solver refused: {0}")]
    Solver(String),
}

impl From<SvmError> for TrainError {
    fn from(error: SvmError) -> Self {
        Self::Solver(error.to_string())
    }
}

/// Least samples of a class: one to hold out, one to learn from.
pub const MIN_SAMPLES: usize = 2;

pub(super) fn check_options(feature_set: &str, options: &TrainOptions) -> Result<(), TrainError> {
    let positive = |values: &[f64]| !values.is_empty() && values.iter().all(|v| *v > 0.0 && v.is_finite());
    if !(1..=64).contains(&feature_set.len()) {
        return Err(TrainError::Option("the name of the feature set is 1 to 64 bytes"));
    }
    if !(2..=20).contains(&options.folds) {
        return Err(TrainError::Option("folds from 2 to 20"));
    }
    match options.components {
        Components::Count(0) => return Err(TrainError::Option("at least 1 component")),
        Components::Variance(part) if !(part > 0.0 && part < 1.0) => {
            return Err(TrainError::Option("the part of the variance to keep lies between 0 and 1"));
        }
        Components::Count(_) | Components::Variance(_) => {}
    }
    if !positive(&options.costs) || !positive(&options.gammas) {
        return Err(TrainError::Option("C and γ each need values, all above 0"));
    }
    Ok(())
}

pub(super) fn check_samples(vocabulary: &Vocabulary, samples: &[LabelledFeatures]) -> Result<(), TrainError> {
    let mut counts = vec![0; vocabulary.classes()];
    let expected = samples.first().map_or(0, |first| first.features.len());
    for (index, sample) in samples.iter().enumerate() {
        for features in iter::once(&sample.features).chain(&sample.variations) {
            let found = features.len();
            if found != expected {
                return Err(TrainError::Length { sample: index, found, expected });
            }
            if let Some(component) = features.iter().position(|x| !x.is_finite()) {
                return Err(TrainError::NotFinite { sample: index, component });
            }
        }
        match counts.get_mut(sample.class.index()) {
            Some(count) => *count += 1,
            None => return Err(TrainError::Class { sample: index, class: sample.class }),
        }
    }
    for (label, &found) in vocabulary.labels().iter().zip(&counts) {
        if found < MIN_SAMPLES {
            return Err(TrainError::TooFew { label: label.clone(), found });
        }
    }
    if samples.iter().all(|sample| sample.features == samples[0].features) {
        return Err(TrainError::NoVariance);
    }
    Ok(())
}
