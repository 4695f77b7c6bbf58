//! How to learn, and why not.

use gestalt_protocol::ClassId;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// How a [`Learner`](crate::Learner) learns.
///
/// | name | default | meaning | range |
/// |---|---|---|---|
/// | `cost` | 10 | C: what a sample on the wrong side of the margin costs | 0.001–10,000 |
/// | `gamma` | 1 | γ of the kernel exp(−γ·‖x − y‖²), in units of 1 / [`FeatureSpace::variance`](crate::FeatureSpace::variance) | 0.0001–10,000 |
/// | `staleness` | 0.1 | the part of a pair's samples that may come or go before it is calibrated again | 0–0.25 |
/// | `groups` | 0 | groups of authors, each with a classifier of its own, of which the majority is [certified](crate::Certified); 0: one learns from all | 0, or 2–64 |
/// | `folds` | 5 | parts of the cross-validation that the probabilities are fitted on | 2–20 |
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LearnerOptions {
    /// C: what a sample on the wrong side of the margin costs.
    pub cost: f64,
    /// γ of the kernel exp(−γ·‖x − y‖²), in units of 1 / (total variance of the feature space).
    pub gamma: f64,
    /// Parts of the cross-validation that the probabilities are fitted on.
    pub folds: usize,
    /// The part of a pair's samples that may come or go before its probabilities are fitted again; 0 fits them after
    /// each change.
    ///
    /// A machine is always up to date; what its decisions mean changes more slowly, and costs several times as much
    /// to find out. With the default, at 1,000 samples of classes of one size, fewer than one in 1,000 answers differ
    /// from those of a fresh fit; at 200 samples or where classes differ eightfold in size, two to eight.
    pub staleness: f64,
    /// Groups of authors, each with a classifier of its own, of which the majority is certified; 0: one learns from all.
    pub groups: usize,
}

impl Default for LearnerOptions {
    fn default() -> Self {
        Self { cost: 10.0, gamma: 1.0, folds: 5, staleness: 0.1, groups: 0 }
    }
}

impl LearnerOptions {
    /// Whether all options lie in their ranges.
    ///
    /// # Errors
    /// [`LearnError::Option`] names the first that does not.
    pub fn validate(&self) -> Result<(), LearnError> {
        if !(1e-3..=1e4).contains(&self.cost) {
            return Err(LearnError::Option("cost from 0.001 to 10000"));
        }
        if !(1e-4..=1e4).contains(&self.gamma) {
            return Err(LearnError::Option("gamma from 0.0001 to 10000"));
        }
        if !(2..=20).contains(&self.folds) {
            return Err(LearnError::Option("folds from 2 to 20"));
        }
        if !(0.0..=0.25).contains(&self.staleness) {
            return Err(LearnError::Option("staleness from 0 to 0.25"));
        }
        if self.groups != 0 && !(2..=64).contains(&self.groups) {
            return Err(LearnError::Option("groups 0, or from 2 to 64"));
        }
        Ok(())
    }
}

/// What cannot be learned from. The learner is unchanged.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum LearnError {
    /// An option out of its range.
    #[error("learner option out of range: {0}")]
    Option(&'static str),
    /// The samples that the feature space was fitted on did not differ.
    #[error("nothing varies in the feature space: fit it on samples that differ")]
    NoVariance,
    /// The classifier to build on judges in another feature space.
    #[error("the classifier judges in another feature space: build on one that was trained in this space")]
    Space,
    /// The classifier to build on tells other gestures apart.
    #[error("the classifier tells other gestures apart: build on one of the same vocabulary")]
    Vocabulary,
    /// A vector of another length than the feature space has coordinates.
    #[error("vector of {found} coordinates, the feature space has {expected}: reduce it in the same space")]
    Length {
        /// Coordinates of the vector.
        found: usize,
        /// Coordinates of the space.
        expected: usize,
    },
    /// A coordinate that is NaN, infinite, or beyond ± 1,000,000.
    #[error("coordinate {0} of the vector is not a number within ±1000000")]
    Range(usize),
    /// A class that is not on the list, or one more that was named than can be told apart.
    #[error("class {0} is not in the vocabulary, or there is no room for one more gesture")]
    Class(ClassId),
}
