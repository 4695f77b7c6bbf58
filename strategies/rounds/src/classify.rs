//! The contract between a robot and its classifier.

use std::fmt::Debug;

use thiserror::Error;

use crate::observation::Observation;
use crate::vocabulary::Vocabulary;

/// A feature vector that a classifier cannot judge. The classifier is unchanged.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum ClassifyError {
    /// It has another number of components than the classifier was trained on.
    #[error(
        "feature vector of {found} components, the classifier takes {expected}: train and look with the same feature set"
    )]
    Length {
        /// Components of the vector.
        found: usize,
        /// Components the classifier takes.
        expected: usize,
    },
    /// A component is NaN or infinite.
    #[error("component {0} of the feature vector is not finite")]
    NotFinite(usize),
}

/// What a classifier makes of one look: all that a robot wants to know of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Judgement {
    /// As of [`Classify::probabilities`].
    pub probabilities: Vec<f64>,
    /// As of [`Classify::unknown`].
    pub unknown: Option<f64>,
    /// As of [`Classify::view`].
    pub view: Option<Vec<f32>>,
}

/// Tells gestures apart: from a raw feature vector to a probability for each class.
///
/// A trait, so that a researcher's own classifier can sit in a robot; `Classifier` is ours. Only the vocabulary and the probabilities are required.
/// A robot asks [`Self::judge_seen`], which asks [`Self::judge`]: who finds all three answers on one way gives that too.
pub trait Classify: Debug + Send + Sync {
    /// The gestures it can tell.
    fn vocabulary(&self) -> &Vocabulary;

    /// The probability of each class given the features: one value per class of the vocabulary, each in
    /// `0.0..=1.0`, summing to 1.
    ///
    /// # Errors
    /// See [`ClassifyError`].
    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError>;

    /// How likely a further gesture would be that it was never taught, if it were on the list: on the scale of [`Self::probabilities`], which a
    /// gesture of the list that it was never taught has too, and above 1 where it is likelier than all of them. `None` for a classifier that cannot
    /// tell, and for what it cannot judge.
    fn unknown(&self, features: &[f32]) -> Option<f64> {
        let _ = features;
        None
    }

    /// All that there is to say of a look, at once.
    ///
    /// # Errors
    /// As of [`Self::probabilities`].
    fn judge(&self, features: &[f32]) -> Result<Judgement, ClassifyError> {
        let probabilities = self.probabilities(features)?;
        Ok(Judgement { probabilities, unknown: self.unknown(features), view: self.view(features) })
    }

    /// The same of what perception hands over. Where its quality says how likely it shows a hand at all, a classifier may find what hardly does unknown;
    /// the others judge the features alone.
    ///
    /// # Errors
    /// As of [`Self::probabilities`].
    fn judge_seen(&self, seen: &Observation) -> Result<Judgement, ClassifyError> {
        self.judge(&seen.features)
    }

    /// The probabilities of a vector already reduced: coordinates in the feature space it judges in.
    /// `None` for a classifier without such a space, and for coordinates of another length or that are not finite.
    fn probabilities_in_space(&self, coordinates: &[f32]) -> Option<Vec<f64>> {
        let _ = coordinates;
        None
    }

    /// Where a feature vector lies among all views, in units such that errors about two views correlate by exp(−d²) at a
    /// distance of d: near ones repeat each other. `None` for a classifier that cannot say, whose every look is new.
    fn view(&self, features: &[f32]) -> Option<Vec<f32>> {
        let _ = features;
        None
    }
}
