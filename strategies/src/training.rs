//! From labelled feature vectors to a classifier.

use gestalt_protocol::ClassId;
use linfa_svm::SvmError;
use rand::Rng;
use thiserror::Error;

use crate::classifier::{Classifier, Machine, Sigmoid, Space, calibrated, couple, pairs};
use crate::folds::{Folding, split};
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
/// | `gammas` | ¼, ½, 1, 2 | values of γ that are tried, in units of 1 / (variance of the reduced samples) | > 0 |
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
            gammas: vec![0.25, 0.5, 1.0, 2.0],
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
/// C and γ are those with the least log loss in cross-validation. The sigmoids are fitted on the decision values
/// of samples held out there: scaling, principal components and machines of a fold have not seen them. The
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
    let classes = vocabulary.classes();
    let (assignment, folding) = split(samples, classes, options.folds, rng);
    let folds: Vec<Fold> = (0..options.folds)
        .map(|fold| Fold::new(samples, classes, options, rng, |i| assignment[i] != fold))
        .collect();

    let total = options.costs.len() * options.gammas.len() * options.folds + 1;
    let mut done = 0;
    let mut best: Option<(HeldOut, f64, f64)> = None;
    for &gamma in &options.gammas {
        for &cost in &options.costs {
            let mut decisions = vec![Vec::new(); samples.len()];
            for fold in &folds {
                let machine = fold.fit(cost, gamma)?;
                for &index in &fold.held_out {
                    machine.decide(&fold.rows[index], &mut decisions[index]);
                }
                done += 1;
                progress(Progress { done, total });
            }
            let outcome = HeldOut::new(&decisions, samples, classes);
            if best.as_ref().is_none_or(|(least, ..)| outcome.log_loss < least.log_loss) {
                best = Some((outcome, cost, gamma));
            }
        }
    }
    let (held_out, cost, gamma) = best.ok_or(TrainError::Option("no value of C or of γ to try"))?;

    let all = Fold::new(samples, classes, options, rng, |_| true);
    let machine = all.fit(cost, gamma)?;
    progress(Progress { done: total, total });
    let classifier =
        Classifier::new(feature_set.to_owned(), vocabulary.clone(), all.space, machine, held_out.sigmoids);
    let HeldOut { accuracy, log_loss, .. } = held_out;
    Ok(Trained { classifier, cost, gamma, folding, accuracy, log_loss })
}

/// A space fitted on some samples, and all samples as seen in it.
struct Fold {
    space: Space,
    rows: Vec<Vec<f32>>,
    /// By class, the samples it was fitted on.
    members: Vec<Vec<usize>>,
    /// The others.
    held_out: Vec<usize>,
    /// 1 / (total variance of the rows it was fitted on): the unit of γ.
    gamma_unit: f64,
}

impl Fold {
    fn new(
        samples: &[Sample],
        classes: usize,
        options: &TrainOptions,
        rng: &mut impl Rng,
        learns: impl Fn(usize) -> bool,
    ) -> Self {
        let learned = samples.iter().enumerate().filter(|(index, _)| learns(*index));
        let features = learned.clone().map(|(_, sample)| sample.features.as_slice());
        let space = Space::fit(features, options.scaling, options.components, rng);
        let rows: Vec<Vec<f32>> = samples.iter().map(|sample| space.project(&sample.features)).collect();
        let mut members = vec![Vec::new(); classes];
        let (mut squares, mut count) = (0.0, 0.0);
        for (index, sample) in learned {
            members[sample.class.index()].push(index);
            // Rows are centred, so their squares sum up to the variance.
            squares += rows[index].iter().map(|x| f64::from(x * x)).sum::<f64>();
            count += 1.0;
        }
        let held_out = (0..samples.len()).filter(|index| !learns(*index)).collect();
        Self { space, rows, members, held_out, gamma_unit: count / squares.max(f64::MIN_POSITIVE) }
    }

    fn fit(&self, cost: f64, gamma: f64) -> Result<Machine, SvmError> {
        let row = |&index: &usize| self.rows[index].as_slice();
        let members: Vec<Vec<&[f32]>> = self.members.iter().map(|m| m.iter().map(row).collect()).collect();
        Machine::fit(&members, self.space.pca.kept(), cost, gamma * self.gamma_unit)
    }
}

/// What cross-validation says about one choice of parameters.
struct HeldOut {
    sigmoids: Vec<Sigmoid>,
    accuracy: f64,
    log_loss: f64,
}

impl HeldOut {
    fn new(decisions: &[Vec<f64>], samples: &[Sample], classes: usize) -> Self {
        let sigmoids: Vec<Sigmoid> = pairs(classes)
            .enumerate()
            .map(|(pair, (i, j))| {
                let values = samples.iter().zip(decisions).filter_map(|(sample, decisions)| {
                    let class = sample.class.index();
                    (class == i || class == j).then(|| (decisions[pair], class == i))
                });
                Sigmoid::fit(&values.collect::<Vec<_>>())
            })
            .collect();
        let (mut right, mut loss) = (0, 0.0);
        for (sample, decisions) in samples.iter().zip(decisions) {
            let p = couple(calibrated(decisions, &sigmoids), classes);
            let truth = p[sample.class.index()];
            right += usize::from(p.iter().all(|other| *other <= truth));
            loss -= truth.max(1e-12).ln();
        }
        let count = samples.len() as f64;
        Self { sigmoids, accuracy: right as f64 / count, log_loss: loss / count }
    }
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
