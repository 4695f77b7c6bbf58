//! The search for C and γ by cross-validation.

use linfa_svm::SvmError;
use rand::Rng;

use super::error::TrainError;
use super::folds::{Folding, split};
use super::options::TrainOptions;
use crate::calibration::Calibration;
use crate::feature_space::FeatureSpace;
use crate::labelled::LabelledFeatures;
use crate::machine::Machine;

/// What is learned of a sample: itself, or one variation of it.
#[derive(Clone, Copy)]
pub(super) struct Row<'a> {
    /// Index of the sample.
    pub sample: usize,
    pub class: usize,
    pub features: &'a [f32],
}

/// The samples in their order, then the variations of each.
pub(super) fn rows(samples: &[LabelledFeatures]) -> Vec<Row<'_>> {
    let numbered = || samples.iter().enumerate();
    let row = |(sample, labelled): (usize, &LabelledFeatures), features| Row {
        sample,
        class: labelled.class.index(),
        features,
    };
    let varied = numbered().flat_map(|of| of.1.variations.iter().map(move |features| (of, features)));
    numbered()
        .map(|of| row(of, &of.1.features))
        .chain(varied.map(|(of, features)| row(of, features)))
        .collect()
}

/// The samples, split and seen in the space of each fold.
pub(super) struct Search {
    /// The class of each row.
    truths: Vec<usize>,
    /// How many of the rows are samples themselves: the first.
    samples: usize,
    classes: usize,
    folds: Vec<Fold>,
    pub folding: Folding,
}

/// A pair of parameters, and what cross-validation says about it.
pub(super) struct Choice {
    pub cost: f64,
    pub gamma: f64,
    pub held_out: HeldOut,
}

impl Search {
    pub fn new(
        feature_set: &str,
        samples: &[LabelledFeatures],
        rows: &[Row],
        classes: usize,
        options: &TrainOptions,
        rng: &mut impl Rng,
    ) -> Self {
        let (assignment, folding) = split(samples, classes, options.folds, rng);
        let folds = (0..options.folds).map(|fold| {
            // A variation lies where its sample does: what is held out was learned in no disguise.
            Fold::new(feature_set, rows, classes, options, rng, |row| assignment[row.sample] != fold)
        });
        let (folds, truths) = (folds.collect(), rows.iter().map(|row| row.class).collect());
        Self { truths, samples: samples.len(), classes, folds, folding }
    }

    /// The pair with the least log loss. Calls `step` for each fold.
    ///
    /// Along γ with the middle C, then along C: the loss is flat in C where γ is right, so the full grid finds no
    /// better pair in twice the time.
    pub fn run(&self, options: &TrainOptions, mut step: impl FnMut()) -> Result<Choice, TrainError> {
        let (costs, gammas) = (&options.costs, &options.gammas);
        let middle = costs.len() / 2;
        let mut best: Option<Choice> = None;
        for &gamma in gammas {
            self.attempt(costs[middle], gamma, &mut step, &mut best)?;
        }
        let gamma = best.as_ref().map_or(gammas[0], |best| best.gamma);
        for (_, &cost) in costs.iter().enumerate().filter(|(index, _)| *index != middle) {
            self.attempt(cost, gamma, &mut step, &mut best)?;
        }
        best.ok_or(TrainError::NoFit)
    }

    fn attempt(
        &self,
        cost: f64,
        gamma: f64,
        step: &mut impl FnMut(),
        best: &mut Option<Choice>,
    ) -> Result<(), SvmError> {
        let mut decisions = vec![Vec::new(); self.truths.len()];
        for fold in &self.folds {
            step();
            // Of fewer people than folds, some folds hold nobody out.
            if fold.held_out.is_empty() {
                continue;
            }
            let machine = fold.fit(cost, gamma)?;
            for &index in &fold.held_out {
                machine.decide(&fold.rows[index], &mut decisions[index]);
            }
        }
        let held_out = HeldOut::new(&decisions, &self.truths, self.samples, self.classes);
        let least = best.as_ref().map_or(f64::INFINITY, |best| best.held_out.log_loss);
        if held_out.log_loss < least {
            *best = Some(Choice { cost, gamma, held_out });
        }
        Ok(())
    }
}

/// A space fitted on some rows, and all rows as seen in it.
pub(super) struct Fold {
    pub space: FeatureSpace,
    rows: Vec<Vec<f32>>,
    /// By class, the rows it was fitted on.
    members: Vec<Vec<usize>>,
    /// The others.
    held_out: Vec<usize>,
    /// 1 / (total variance of the rows it was fitted on): the unit of γ.
    gamma_unit: f64,
}

impl Fold {
    pub fn new(
        feature_set: &str,
        all: &[Row],
        classes: usize,
        options: &TrainOptions,
        rng: &mut impl Rng,
        learns: impl Fn(&Row) -> bool,
    ) -> Self {
        let learned = all.iter().enumerate().filter(|(_, row)| learns(row));
        let features = learned.clone().map(|(_, row)| row.features);
        let space = FeatureSpace::fit(feature_set, features, options.scaling, options.components, rng);
        let rows: Vec<Vec<f32>> = all.iter().map(|row| space.coordinates(row.features)).collect();
        let mut members = vec![Vec::new(); classes];
        let (mut squares, mut count) = (0.0, 0.0);
        for (index, row) in learned {
            members[row.class].push(index);
            // Rows are centred, so their squares sum up to the variance.
            squares += rows[index].iter().map(|x| f64::from(x * x)).sum::<f64>();
            count += 1.0;
        }
        let held_out = (0..all.len()).filter(|index| !learns(&all[*index])).collect();
        Self { space, rows, members, held_out, gamma_unit: count / squares.max(f64::MIN_POSITIVE) }
    }

    /// How many rows of each class it was fitted on.
    pub fn counts(&self) -> Vec<u32> {
        self.members.iter().map(|members| members.len() as u32).collect()
    }

    pub fn fit(&self, cost: f64, gamma: f64) -> Result<Machine, SvmError> {
        let row = |&index: &usize| self.rows[index].as_slice();
        let members: Vec<Vec<&[f32]>> = self.members.iter().map(|m| m.iter().map(row).collect()).collect();
        Machine::fit(&members, self.space.components(), cost, gamma * self.gamma_unit)
    }
}

/// What cross-validation says about one choice of parameters.
pub(super) struct HeldOut {
    pub calibration: Calibration,
    pub accuracy: f64,
    pub log_loss: f64,
}

impl HeldOut {
    /// Of the decision values of all rows, of which the first `samples` count: variations are no pictures of the test.
    fn new(decisions: &[Vec<f64>], truths: &[usize], samples: usize, classes: usize) -> Self {
        let calibration = Calibration::fit(decisions, truths, classes);
        let (mut right, mut loss) = (0, 0.0);
        for (decisions, &truth) in decisions.iter().zip(truths).take(samples) {
            let p = calibration.probabilities(decisions, classes);
            let truth = p[truth];
            right += usize::from(p.iter().all(|other| *other <= truth));
            loss -= truth.max(1e-12).ln();
        }
        let count = samples as f64;
        Self { calibration, accuracy: right as f64 / count, log_loss: loss / count }
    }
}
