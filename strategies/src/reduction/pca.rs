//! Principal component analysis.

use nalgebra::{DMatrix, SymmetricEigen};
use rand::Rng;
use serde::{Deserialize, Serialize};

use super::subspace;
use crate::classifier::dot;

/// How many principal components to keep.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Components {
    /// This many, or as many as the data have. At least 1.
    Count(usize),
    /// As few as keep this part of the variance. Range `0.0 < part < 1.0`.
    Variance(f64),
}

/// A basis of orthonormal directions, by falling variance.
///
/// It takes centred vectors ([`crate::Scaling`] centres) and gives their coordinates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pca {
    pub(crate) width: usize,
    /// `kept × width`, a direction a row.
    pub(crate) basis: Vec<f32>,
    /// Part of the variance of the training data that the basis keeps, `0.0..=1.0`.
    pub(crate) explained: f64,
}

/// Up to this many rows and columns an exact decomposition takes a fraction of a second.
const EXACT: usize = 256;

impl Pca {
    /// The principal components of these centred rows, each `width` long; at least two rows.
    ///
    /// The eigenvectors of the covariance, or of the Gram matrix where there are fewer rows than columns. Of
    /// large matrices only the leading ones are sought, by subspace iteration from a random start.
    pub(crate) fn fit(rows: &[f32], width: usize, keep: Components, rng: &mut impl Rng) -> Self {
        let count = rows.len() / width;
        let x = DMatrix::from_row_iterator(count, width, rows.iter().map(|&v| f64::from(v)));
        let total = x.norm_squared();
        let rank = width.min(count - 1).max(1);
        let leading = match keep {
            _ if width.min(count) <= EXACT => exact(&x),
            Components::Count(wanted) => subspace::leading(&x, wanted.min(rank), rng),
            Components::Variance(part) => {
                // How many are needed is known only afterwards: twice as many until they suffice.
                let mut wanted = 32.min(rank);
                loop {
                    let found = subspace::leading(&x, wanted, rng);
                    let kept: f64 = found.iter().map(|(variance, _)| variance).sum();
                    if kept >= part * total {
                        break found;
                    }
                    wanted *= 2;
                    if wanted * 2 > rank {
                        break exact(&x);
                    }
                }
            }
        };
        let kept = match keep {
            Components::Count(wanted) => wanted,
            Components::Variance(part) => {
                let mut sum = 0.0;
                1 + leading
                    .iter()
                    .take_while(|(variance, _)| {
                        sum += variance;
                        sum < part * total
                    })
                    .count()
            }
        };
        // A direction without variance is rounding, not a component; one is kept so that there is a space.
        let real = leading.iter().take_while(|(variance, _)| *variance > 1e-10 * total).count();
        let kept = kept.clamp(1, real.max(1));
        let explained: f64 = leading[..kept].iter().map(|(variance, _)| variance).sum();
        Self {
            width,
            basis: leading[..kept].iter().flat_map(|(_, v)| oriented(v)).collect(),
            explained: if total > 0.0 { (explained / total).min(1.0) } else { 1.0 },
        }
    }

    /// Components of the vectors it takes.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Components of the vectors it gives.
    #[must_use]
    pub fn kept(&self) -> usize {
        self.basis.len() / self.width
    }

    /// Part of the variance of the training data that the kept components carry, `0.0..=1.0`.
    #[must_use]
    pub fn explained(&self) -> f64 {
        self.explained
    }

    /// The kept directions, by falling variance; each of length 1, orthogonal to the others.
    pub fn directions(&self) -> impl Iterator<Item = &[f32]> {
        self.basis.chunks_exact(self.width)
    }

    /// Writes the coordinates of a centred vector over `coordinates`.
    pub(crate) fn project(&self, centred: &[f32], coordinates: &mut Vec<f32>) {
        coordinates.clear();
        coordinates.extend(self.directions().map(|direction| dot(direction, centred)));
    }
}

/// All principal directions with their share of the squared norm of `x`, falling.
fn exact(x: &DMatrix<f64>) -> Vec<(f64, Vec<f64>)> {
    let tall = x.nrows() >= x.ncols();
    let eigen = SymmetricEigen::new(if tall { x.transpose() * x } else { x * x.transpose() });
    let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    order
        .into_iter()
        .map(|i| {
            let vector = eigen.eigenvectors.column(i);
            // G = X·Xᵀ and C = Xᵀ·X share their eigenvalues; u of G is v = Xᵀ·u / |Xᵀ·u| of C.
            let direction = if tall { vector.clone_owned() } else { x.tr_mul(&vector) };
            let norm = direction.norm().max(f64::MIN_POSITIVE);
            (eigen.eigenvalues[i].max(0.0), direction.iter().map(|v| v / norm).collect())
        })
        .collect()
}

/// The direction as f32, turned so that its largest component is positive: ± is arbitrary, and this is the
/// choice that makes two fits equal.
fn oriented(direction: &[f64]) -> impl Iterator<Item = f32> + '_ {
    let largest = direction.iter().fold(0.0_f64, |best, &v| if v.abs() > best.abs() { v } else { best });
    let sign = if largest < 0.0 { -1.0 } else { 1.0 };
    direction.iter().map(move |v| (v * sign) as f32)
}
