//! What answers for a gesture: heads over one feature space.
//!
//! Support vector machines are the better head where much was shown, and hardly learn from five showings. Classes of one shared covariance do: what is
//! known of the many tells how far the few will scatter. So a [`Learner`](crate::Learner) has both, and each pair of classes is answered by the one that
//! is better there, by what it was shown.

mod blend;
mod discriminant;
mod discriminant_sums;
mod sharpness;
mod sums;
mod teach;
#[cfg(test)]
mod tests;

use std::fmt::Debug;

pub(crate) use blend::{Blend, Few, Losses, YOUNG, blended};
pub use discriminant::Discriminant;
pub(crate) use discriminant::Room;
pub use discriminant_sums::DiscriminantSums;
pub(crate) use sharpness::sharpness;
pub(crate) use sums::Sums;
pub use teach::{Shown, Teach};

/// Tells classes apart in a feature space: what each says of a view.
///
/// The support vector machines of a [`Classifier`](crate::Classifier) are one ([`Classifier::machines`](crate::Classifier::machines)), its
/// [`Discriminant`] is another, and a researcher's own takes the place of that by way of [`Teach`].
pub trait Head: Debug + Send + Sync {
    /// The logarithm of how likely the view is if it shows a class, up to a number that all classes have in common; by class, negative infinity for
    /// those that it was not taught.
    fn logs(&self, coordinates: &[f32]) -> Vec<f64>;

    /// The probability of each class, if all are as likely beforehand.
    fn probabilities(&self, coordinates: &[f32]) -> Vec<f64> {
        let logs = self.logs(coordinates);
        let greatest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let likelihoods: Vec<f64> = logs.iter().map(|log| (log - greatest).exp()).collect();
        let sum: f64 = likelihoods.iter().sum();
        likelihoods.iter().map(|likelihood| likelihood / sum).collect()
    }
}

/// By how much the greatest of logarithms exceeds the second; `None` of fewer than two.
pub(crate) fn margin_of<'a>(logs: impl IntoIterator<Item = &'a f64>) -> Option<f64> {
    let (mut first, mut second) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
    for log in logs {
        if *log > first {
            (first, second) = (*log, first);
        } else if *log > second {
            second = *log;
        }
    }
    second.is_finite().then_some(first - second)
}
