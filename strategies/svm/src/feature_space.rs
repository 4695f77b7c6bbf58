//! The space that classifiers judge in and samples are shared in: scaled, then reduced.

use gestalt_protocol::{ClassId, FeatureSpaceId, Fnv1a};
use gestalt_rounds::ClassifyError;
use rand::Rng;
use serde::{Deserialize, Serialize};

use crate::reduction::{Components, Pca, Ranking, Reduction, best};
use crate::scaling::{Scaling, ScalingMethod};

/// From the raw features of one named set to the few coordinates that carry what they say.
///
/// Vectors of one space, and only they, may be compared, mixed and learned from together: its [`id`](Self::id)
/// travels with every shared sample.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FeatureSpace {
    pub(crate) feature_set: String,
    pub(crate) scaling: Scaling,
    pub(crate) reduction: Reduction,
    /// The standard deviation of each coordinate over the samples it was fitted on.
    pub(crate) spread: Vec<f32>,
}

impl FeatureSpace {
    /// Fits the space of these feature vectors: at least two, of one length, finite; with principal components as
    /// the reduction.
    ///
    /// # Panics
    /// If there is no vector, or none has a component.
    pub fn fit<'a>(
        feature_set: &str,
        rows: impl Iterator<Item = &'a [f32]> + Clone,
        method: ScalingMethod,
        keep: Components,
        rng: &mut impl Rng,
    ) -> Self {
        let scaling = Scaling::fit(rows.clone(), method);
        let (mut all, mut row) = (Vec::new(), Vec::new());
        for features in rows.clone() {
            scaling.apply(features, &mut row);
            all.extend_from_slice(&row);
        }
        let reduction = Reduction::Pca(Pca::fit(&all, scaling.width(), keep, rng));
        Self::with_reduction(feature_set, rows, scaling, reduction)
    }

    /// Fits the space of these labelled feature vectors, at least two, of one length, finite; it keeps the features that
    /// rank best, at least one.
    ///
    /// # Panics
    /// If a vector is shorter than the first.
    #[must_use]
    pub fn fit_ranked(
        feature_set: &str,
        samples: &[(&[f32], ClassId)],
        method: ScalingMethod,
        ranking: Ranking,
        keep: usize,
    ) -> Self {
        let rows = samples.iter().map(|(features, _)| *features);
        let scaling = Scaling::fit(rows.clone(), method);
        let kept = best(samples, ranking, keep);
        let reduction = Reduction::Selected { width: scaling.width(), kept };
        Self::with_reduction(feature_set, rows, scaling, reduction)
    }

    /// A space of a scaling and a reduction found elsewhere; `rows` are raw feature vectors, which tell how far each
    /// coordinate spreads.
    ///
    /// # Panics
    /// If the reduction selects a feature that the scaling, or a row, does not have.
    pub fn with_reduction<'a>(
        feature_set: &str,
        rows: impl Iterator<Item = &'a [f32]>,
        scaling: Scaling,
        reduction: Reduction,
    ) -> Self {
        let spread = vec![0.0; reduction.kept()];
        let mut space = Self { feature_set: feature_set.to_owned(), scaling, reduction, spread };
        let (mut sum, mut squares) = (vec![0.0_f64; space.components()], vec![0.0_f64; space.components()]);
        let mut count = 0.0_f64;
        for features in rows {
            for ((sum, square), x) in sum.iter_mut().zip(&mut squares).zip(space.coordinates(features)) {
                *sum += f64::from(x);
                *square += f64::from(x) * f64::from(x);
            }
            count += 1.0;
        }
        let count = count.max(1.0);
        for ((spread, sum), square) in space.spread.iter_mut().zip(sum).zip(squares) {
            *spread = (square / count - (sum / count).powi(2)).max(0.0).sqrt() as f32;
        }
        space
    }

    /// The name of the raw feature set, such as `hog-1`.
    #[must_use]
    pub fn feature_set(&self) -> &str {
        &self.feature_set
    }

    /// Whether it is of the embeddings of learned eyes. The quality of what those see is how likely it is a hand at all; that of others says how far
    /// an outline is to be trusted.
    #[must_use]
    pub fn is_of_learned_eyes(&self) -> bool {
        self.feature_set.starts_with("embedding-")
    }

    /// How many raw features it takes.
    #[must_use]
    pub fn features(&self) -> usize {
        self.scaling.width()
    }

    /// How many coordinates it gives.
    #[must_use]
    pub fn components(&self) -> usize {
        self.reduction.kept()
    }

    /// Its scaling.
    #[must_use]
    pub fn scaling(&self) -> &Scaling {
        &self.scaling
    }

    /// Its reduction.
    #[must_use]
    pub fn reduction(&self) -> &Reduction {
        &self.reduction
    }

    /// The standard deviation of each coordinate over the samples it was fitted on.
    #[must_use]
    pub fn spread(&self) -> &[f32] {
        &self.spread
    }

    /// The sum of the coordinates' variances over the samples it was fitted on: the natural unit of a squared distance.
    #[must_use]
    pub fn variance(&self) -> f64 {
        self.spread.iter().map(|spread| f64::from(*spread).powi(2)).sum()
    }

    /// The coordinates of a raw feature vector.
    ///
    /// # Errors
    /// See [`ClassifyError`].
    pub fn project(&self, features: &[f32]) -> Result<Vec<f32>, ClassifyError> {
        if features.len() != self.features() {
            return Err(ClassifyError::Length { found: features.len(), expected: self.features() });
        }
        if let Some(component) = features.iter().position(|x| !x.is_finite()) {
            return Err(ClassifyError::NotFinite(component));
        }
        Ok(self.coordinates(features))
    }

    /// The coordinates of a feature vector of the right length.
    pub(crate) fn coordinates(&self, features: &[f32]) -> Vec<f32> {
        let mut scaled = Vec::with_capacity(self.features());
        self.scaling.apply(features, &mut scaled);
        let mut coordinates = Vec::with_capacity(self.components());
        self.reduction.project(&scaled, &mut coordinates);
        coordinates
    }

    /// Names what the coordinates mean: the 64-bit FNV-1a hash of the feature set's name, a zero byte, then means,
    /// factors, the reduction and the spreads, all numbers as little-endian 32 bits.
    #[must_use]
    pub fn id(&self) -> FeatureSpaceId {
        let mut fnv = Fnv1a::default();
        fnv.add(self.feature_set.bytes().chain([0]));
        let numbers = [&self.scaling.mean, &self.scaling.factor].into_iter().flatten();
        fnv.add(numbers.flat_map(|value| value.to_le_bytes()));
        fnv.add(self.reduction.bytes());
        fnv.add(self.spread.iter().flat_map(|value| value.to_le_bytes()));
        FeatureSpaceId(fnv.hash())
    }

    /// Whether all dimensions agree, and all numbers lie where sums of them stay finite.
    pub(crate) fn check(&self) -> Result<(), &'static str> {
        /// Most raw features a space may take.
        const MAX_FEATURES: usize = 65_536;
        let finite = |values: &[f32]| values.iter().all(|v| v.is_finite());
        let width = self.reduction.width();
        if !(1..=64).contains(&self.feature_set.len()) {
            return Err("the name of the feature set is not 1 to 64 bytes");
        }
        if !(1..=MAX_FEATURES).contains(&width)
            || self.scaling.mean.len() != width
            || self.scaling.factor.len() != width
        {
            return Err("scaling and reduction take different numbers of features");
        }
        if !finite(&self.scaling.mean) || !finite(&self.scaling.factor) {
            return Err("a scaling that is not finite");
        }
        self.reduction.check()?;
        if self.spread.len() != self.reduction.kept() || !self.spread.iter().all(|s| (0.0..=1e6).contains(s))
        {
            return Err("a spread that is missing or out of range");
        }
        Ok(())
    }
}
