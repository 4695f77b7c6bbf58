//! From labelled feature vectors to a classifier.

use std::sync::Arc;

use gestalt_rounds::Vocabulary;
use rand::Rng;

use super::error::{TrainError, check_options, check_samples};
use super::folds::Folding;
use super::options::TrainOptions;
use super::search::{Choice, Fold, HeldOut, Row, Search, rows};
use crate::classifier::Classifier;
use crate::familiarity::Familiarity;
use crate::feature_space::FeatureSpace;
use crate::head::Shown;
use crate::labelled::LabelledFeatures;

/// How far training has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrainProgress {
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
    /// Part of the held-out samples of the cross-validation judged right, without their variations, `0.0..=1.0`.
    pub accuracy: f64,
    /// Mean −ln P(true class) of the held-out samples, without their variations, in nats: what C and γ were chosen by.
    pub log_loss: f64,
}

/// Trains a classifier on samples of the raw feature set named `feature_set`.
///
/// C and γ are those with the least log loss in cross-validation. The calibration is fitted on the decision
/// values of samples held out there: scaling, principal components and machines of a fold have not seen them. The
/// scaling, components and machines of the result are then fitted on all samples. Variations of a sample are held out with
/// it and learned with it.
///
/// The same samples, options and generator give the same classifier, byte for byte, on one machine. Another may differ in
/// the last bits: products of matrices and exponentials are as its processor makes them fastest.
///
/// # Errors
/// See [`TrainError`].
pub fn train(
    feature_set: &str,
    vocabulary: &Vocabulary,
    samples: &[LabelledFeatures],
    options: &TrainOptions,
    rng: &mut impl Rng,
    mut progress: impl FnMut(TrainProgress),
) -> Result<Trained, TrainError> {
    check_options(feature_set, options)?;
    check_samples(vocabulary, samples)?;
    let rows = rows(samples);
    let search = Search::new(feature_set, samples, &rows, vocabulary.classes(), options, rng);
    let total = (options.gammas.len() + options.costs.len() - 1) * options.folds + 1;
    let mut done = 0;
    let best = search.run(options, || {
        done += 1;
        progress(TrainProgress { done, total });
    })?;
    let Choice { cost, gamma, held_out } = best;

    let all = Fold::new(feature_set, &rows, vocabulary.classes(), options, rng, |_| true);
    let machine = all.fit(cost, gamma)?;
    progress(TrainProgress { done: total, total });
    let learned = all.counts();
    let familiarity = familiarity(&all.space, samples, &rows);
    let (space, calibration) = (Arc::new(all.space), held_out.calibration);
    let classifier = Classifier::new(vocabulary.clone(), space, learned, machine, calibration, familiarity);
    let HeldOut { accuracy, log_loss, .. } = held_out;
    Ok(Trained { classifier, cost, gamma, folding: search.folding, accuracy, log_loss })
}

/// How the classes of these samples lie in that space; all that one person shows of a gesture is one showing, and so is a
/// sample of nobody in particular with its variations.
fn familiarity(space: &FeatureSpace, samples: &[LabelledFeatures], rows: &[Row]) -> Option<Familiarity> {
    let coordinates: Vec<Option<Vec<f32>>> =
        rows.iter().map(|row| space.project(row.features).ok()).collect();
    let shown = rows.iter().zip(&coordinates).filter_map(|(row, vector)| {
        let showing = samples[row.sample].group.map_or(1 << 32 | row.sample as u64, u64::from);
        Some(Shown { class: row.class, showing, vector: vector.as_deref()? })
    });
    Familiarity::learn(&shown.collect::<Vec<_>>(), space.spread())
}
