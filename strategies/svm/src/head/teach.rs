//! Heads of one's own.

use std::fmt::Debug;
use std::sync::Arc;

use super::Head;
use crate::feature_space::FeatureSpace;

/// A sample as it is learned from: its class, the showing it is of, and where it lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shown<'a> {
    /// The place of its class in the vocabulary.
    pub class: usize,
    /// Samples of one showing repeat each other: together they count once.
    pub showing: u64,
    /// Its coordinates in the feature space.
    pub vector: &'a [f32],
}

/// Makes a head of what was shown, in place of the discriminant: [`Learner::with_head`](crate::Learner::with_head).
///
/// It is asked after each change, and once for each fold of the cross-validation that finds out where it is better than the machines. The same samples
/// come in the same order, whatever came and went before. A head that knows the nearest mean:
///
/// ```
/// use std::sync::Arc;
///
/// use gestalt_svm::{FeatureSpace, Head, Shown, Teach};
///
/// /// How many samples of each class, and their sum.
/// #[derive(Debug)]
/// struct NearestMean(Vec<(f32, Vec<f32>)>);
///
/// impl Head for NearestMean {
///     fn logs(&self, x: &[f32]) -> Vec<f64> {
///         let squared = |(count, sum): &(f32, Vec<f32>)| sum.iter().zip(x).map(|(s, x)| (s / count - x).powi(2)).sum::<f32>();
///         self.0.iter().map(|mean| if mean.0 > 0.0 { -f64::from(squared(mean)) } else { f64::NEG_INFINITY }).collect()
///     }
/// }
///
/// #[derive(Debug)]
/// struct Means;
///
/// impl Teach for Means {
///     fn teach(&self, shown: &[Shown<'_>], classes: usize, space: &FeatureSpace) -> Arc<dyn Head> {
///         let mut means = vec![(0.0, vec![0.0; space.components()]); classes];
///         for Shown { class, vector, .. } in shown {
///             means[*class].0 += 1.0;
///             means[*class].1.iter_mut().zip(*vector).for_each(|(sum, x)| *sum += x);
///         }
///         Arc::new(NearestMean(means))
///     }
/// }
///
/// # use gestalt_protocol::ClassId;
/// # use gestalt_rounds::{Classify, Vocabulary};
/// # use gestalt_svm::{Components, Learner, LearnerOptions, ScalingMethod};
/// # use rand::SeedableRng;
/// let views = [[0.0_f32, 0.1], [0.1, 0.0], [1.0, 0.9], [0.9, 1.0]];
/// # let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
/// # let rows = views.iter().map(|view| view.as_slice());
/// # let space = FeatureSpace::fit("example-1", rows, ScalingMethod::Common, Components::Count(2), &mut rng);
/// let vocabulary = Vocabulary::new(["fist", "palm"])?;
/// let mut learner = Learner::new(Arc::new(space), vocabulary, LearnerOptions::default())?.with_head(Arc::new(Means));
/// for (key, view) in (0..).zip(&views) {
///     let vector = learner.space().project(view)?;
///     learner.insert(key, ClassId(u8::from(key > 1).into()), &vector)?;
/// }
/// let probabilities = learner.learn()?.probabilities(&[0.8, 0.9])?;
/// assert!(probabilities[1] > 0.5, "a palm: {probabilities:?}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Teach: Debug + Send + Sync {
    /// A head that knows these samples, of so many classes.
    fn teach(&self, shown: &[Shown<'_>], classes: usize, space: &FeatureSpace) -> Arc<dyn Head>;
}
