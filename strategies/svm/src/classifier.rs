//! The classifier of a robot: scaling, principal components, one-vs-one support vector machines, calibrated
//! probabilities.
//!
//! ```text
//! raw features ─► FeatureSpace ─► Machine: a decision per pair ─► Calibration: P(k)
//! ```

use std::sync::Arc;

use gestalt_protocol::ClassId;
use gestalt_rounds::{Classify, ClassifyError, Vocabulary};

use crate::calibration::Calibration;
use crate::feature_space::FeatureSpace;
use crate::machine::Machine;

/// The squared distance at which two views are at a distance of 1, in units of the space's variance. Measured on drawn hands
/// (3,000 frames, sixteen robots, 72 showings): whether two views of one showing are misjudged correlates by .93, .82, .68,
/// .42, .19, .13, .04 at squared distances of .0035, .01, .035, .15, .3, .6, 1.2 variances; exp(−d² / .17) fits that.
const REPEATS: f64 = 0.17;

/// A trained classifier. [`Learner`](crate::Learner) and `train` make one, [`Classifier::decode`] reads one.
///
/// It need not have met all gestures of its vocabulary. After n samples, one that it has never met gets the
/// probability 1 / (n + classes), Laplace's rule of succession; the others share the rest.
#[derive(Clone, Debug, PartialEq)]
pub struct Classifier {
    pub(crate) vocabulary: Vocabulary,
    pub(crate) space: Arc<FeatureSpace>,
    /// How many samples of each class it has learned from. Machines and calibration are of those with any.
    pub(crate) learned: Vec<u32>,
    pub(crate) machine: Machine,
    pub(crate) calibration: Calibration,
}

impl Classifier {
    pub(crate) fn new(
        vocabulary: Vocabulary,
        space: Arc<FeatureSpace>,
        learned: Vec<u32>,
        machine: Machine,
        calibration: Calibration,
    ) -> Self {
        Self { vocabulary, space, learned, machine, calibration }
    }

    /// The space it judges in.
    #[must_use]
    pub fn space(&self) -> &Arc<FeatureSpace> {
        &self.space
    }

    /// How many samples of each class it has learned from.
    #[must_use]
    pub fn learned(&self) -> &[u32] {
        &self.learned
    }

    /// How many support vectors all pairs share.
    #[must_use]
    pub fn support_vectors(&self) -> usize {
        self.machine.counts.iter().sum()
    }

    /// The support vectors with their classes.
    pub(crate) fn vectors(&self) -> impl Iterator<Item = (ClassId, &[f32])> {
        let classes = self.met().zip(&self.machine.counts);
        let classes = classes.flat_map(|(class, &count)| std::iter::repeat_n(ClassId(class as u8), count));
        classes.zip(self.machine.vectors.chunks_exact(self.machine.width))
    }

    /// The classes it has met.
    fn met(&self) -> impl Iterator<Item = usize> {
        self.learned.iter().enumerate().filter(|(_, count)| **count > 0).map(|(class, _)| class)
    }

    /// Judges coordinates in its space.
    fn judge(&self, coordinates: &[f32]) -> Vec<f64> {
        let (classes, met) = (self.learned.len(), self.met().count());
        let learned: f64 = self.learned.iter().map(|count| f64::from(*count)).sum();
        let unmet = 1.0 / (learned + classes as f64);
        let mut probabilities = vec![unmet; classes];
        if met > 0 {
            let mut decisions = Vec::with_capacity(self.machine.offsets.len());
            self.machine.decide(coordinates, &mut decisions);
            let rest = 1.0 - unmet * (classes - met) as f64;
            for (class, p) in self.met().zip(self.calibration.probabilities(&decisions, met)) {
                probabilities[class] = p * rest;
            }
        }
        probabilities
    }
}

impl Classify for Classifier {
    fn vocabulary(&self) -> &Vocabulary {
        &self.vocabulary
    }

    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        Ok(self.judge(&self.space.project(features)?))
    }

    fn view(&self, features: &[f32]) -> Option<Vec<f32>> {
        let unit = (REPEATS * self.space.variance()).sqrt() as f32;
        let mut view = self.space.project(features).ok().filter(|_| unit > 0.0)?;
        view.iter_mut().for_each(|coordinate| *coordinate /= unit);
        Some(view)
    }

    fn probabilities_in_space(&self, coordinates: &[f32]) -> Option<Vec<f64>> {
        let fits = coordinates.len() == self.space.components() && coordinates.iter().all(|x| x.is_finite());
        fits.then(|| self.judge(coordinates))
    }
}
