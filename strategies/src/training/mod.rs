//! From labelled feature vectors to a classifier.

mod folds;
mod search;

use std::sync::Arc;

use gestalt_protocol::ClassId;
use linfa_svm::SvmError;
use rand::Rng;
use thiserror::Error;

pub use folds::Folding;
use search::{Choice, Fold, HeldOut, Search};

use crate::classifier::Classifier;
use crate::{Components, ScalingMethod, Vocabulary};

/// A labelled feature vector.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// The raw features.
    pub features: Vec<f32>,
    /// The gesture shown.
    pub class: ClassId,
    /// Who showed it, if known: cross-validation keeps a person's samples together.
    pub group: Option<u32>,
}

/// How to train.
///
/// | name | default | meaning | range |
/// |---|---|---|---|
/// | `scaling` | per component | how features are brought to one scale | |
/// | `components` | 60 | principal components kept | ≥ 1, or a part of the variance in 0–1 |
/// | `costs` | 1, 4, 16 | values of C that are tried | > 0 |
/// | `gammas` | ⅛, ¼, ½, 1 | values of γ that are tried, in units of 1 / (variance of the reduced samples) | > 0 |
/// | `folds` | 5 | parts of the cross-validation | 2–20 |
#[derive(Clone, Debug, PartialEq)]
pub struct TrainOptions {
    /// How features are brought to one scale.
    pub scaling: ScalingMethod,
    /// How many principal components to keep.
    pub components: Components,
    /// The values of C that are tried: what a sample on the wrong side of the margin costs.
    pub costs: Vec<f64>,
    /// The values of γ that are tried, in units of 1 / (total variance of the reduced samples).
    pub gammas: Vec<f64>,
    /// Parts of the cross-validation.
    pub folds: usize,
}

impl Default for TrainOptions {
    fn default() -> Self {
        Self {
            scaling: ScalingMethod::PerComponent,
            components: Components::Count(60),
            costs: vec![1.0, 4.0, 16.0],
            gammas: vec![0.125, 0.25, 0.5, 1.0],
            folds: 5,
        }
    }
}

/// Samples or options that nothing can be learned from.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum TrainError {
    /// An option out of its range.
    #[error("training option out of range: {0}")]
    Option(&'static str),
    /// A feature vector of another length than the first.
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

/// How far training has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Machines fitted so far, one per fold and pair of parameters.
    pub done: usize,
    /// Machines to fit.
    pub total: usize,
}

/// A classifier, and how it came to be.
#[derive(Clone, Debug, PartialEq)]
pub struct Trained {
    /// The classifier, trained on all samples.
    pub classifier: Classifier,
    /// The chosen C.
    pub cost: f64,
    /// The chosen γ, in units of 1 / (total variance of the reduced samples).
    pub gamma: f64,
    /// What the cross-validation kept together.
    pub folding: Folding,
    /// Part of the held-out samples of the cross-validation judged right, `0.0..=1.0`.
    pub accuracy: f64,
    /// Mean −ln P(true class) of the held-out samples, in nats: what C and γ were chosen by.
    pub log_loss: f64,
}

/// Trains a classifier on samples of the raw feature set named `feature_set`.
///
/// C and γ are those with the least log loss in cross-validation. The calibration is fitted on the decision
/// values of samples held out there: scaling, principal components and machines of a fold have not seen them. The
/// scaling, components and machines of the result are then fitted on all samples.
///
/// The same samples, options and generator give the same classifier, byte for byte.
///
/// # Errors
/// See [`TrainError`].
pub fn train(
    feature_set: &str,
    vocabulary: &Vocabulary,
    samples: &[Sample],
    options: &TrainOptions,
    rng: &mut impl Rng,
    mut progress: impl FnMut(Progress),
) -> Result<Trained, TrainError> {
    check_options(feature_set, options)?;
    check_samples(vocabulary, samples)?;
    let search = Search::new(feature_set, samples, vocabulary.classes(), options, rng);
    let total = (options.gammas.len() + options.costs.len() - 1) * options.folds + 1;
    let mut done = 0;
    let best = search.run(options, || {
        done += 1;
        progress(Progress { done, total });
    })?;
    let Choice { cost, gamma, held_out } = best;

    let all = Fold::new(feature_set, samples, vocabulary.classes(), options, rng, |_| true);
    let machine = all.fit(cost, gamma)?;
    progress(Progress { done: total, total });
    let learned = all.counts();
    let classifier =
        Classifier::new(vocabulary.clone(), Arc::new(all.space), learned, machine, held_out.calibration);
    let HeldOut { accuracy, log_loss, .. } = held_out;
    Ok(Trained { classifier, cost, gamma, folding: search.folding, accuracy, log_loss })
}

fn check_options(feature_set: &str, options: &TrainOptions) -> Result<(), TrainError> {
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

fn check_samples(vocabulary: &Vocabulary, samples: &[Sample]) -> Result<(), TrainError> {
    let mut counts = vec![0; vocabulary.classes()];
    let expected = samples.first().map_or(0, |first| first.features.len());
    for (index, sample) in samples.iter().enumerate() {
        let found = sample.features.len();
        if found != expected {
            return Err(TrainError::Length { sample: index, found, expected });
        }
        if let Some(component) = sample.features.iter().position(|x| !x.is_finite()) {
            return Err(TrainError::NotFinite { sample: index, component });
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
