//! From the decision values of all pairs to the probabilities of all classes.

use serde::{Deserialize, Serialize};

use crate::coupling::couple;
use crate::sigmoid::Sigmoid;

/// What turns decision values into probabilities: a sigmoid for each pair, coupling, and one exponent.
///
/// Coupling is too cautious: most pairs know neither class of the sample, and their guesses pull towards
/// "unknown". The exponent makes up for it: P(k) ∝ pₖ^s with one s for all classes, which is temperature scaling
/// with T = 1/s (C. Guo et al., "On calibration of modern neural networks", ICML 2017). It never changes which
/// class is the most probable.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Calibration {
    /// One per pair of classes.
    pub sigmoids: Vec<Sigmoid>,
    /// s; 1 where nothing was fitted.
    pub sharpness: f64,
}

/// Probabilities are kept this far off 0 and 1: of pairs, so that coupling is well posed (as LIBSVM does), and of
/// classes, so that their logarithms can be added up as evidence.
const LEAST: f64 = 1e-7;

impl Calibration {
    /// The probability of each class, given the decision value of each pair; they sum to 1.
    pub fn probabilities(&self, decisions: &[f64], classes: usize) -> Vec<f64> {
        self.coupled(self.of_pairs(decisions), classes)
    }

    /// The probability of the first class of each pair, given its decision value.
    pub fn of_pairs(&self, decisions: &[f64]) -> impl Iterator<Item = f64> {
        decisions.iter().zip(&self.sigmoids).map(|(&f, sigmoid)| sigmoid.probability(f))
    }

    /// The probability of each class, given those of pairs; they sum to 1.
    pub fn coupled(&self, of_pairs: impl Iterator<Item = f64>, classes: usize) -> Vec<f64> {
        let mut p = couple(of_pairs.map(|p| p.clamp(LEAST, 1.0 - LEAST)), classes);
        p.iter_mut().for_each(|p| *p = p.powf(self.sharpness).max(LEAST));
        let sum: f64 = p.iter().sum();
        p.iter_mut().for_each(|p| *p /= sum);
        p
    }
}
