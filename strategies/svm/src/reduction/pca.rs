//! Principal component analysis.

use nalgebra::{DMatrix, SymmetricEigen};
use rand::Rng;
use serde::{Deserialize, Serialize};

use super::subspace;
use crate::vector::dot;

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

    /// Whether it holds directions of one length, and not too many.
    pub(crate) fn check(&self) -> Result<(), &'static str> {
        if self.basis.is_empty() || !self.basis.len().is_multiple_of(self.width) || self.kept() > self.width {
            return Err("principal components of uneven length");
        }
        if !self.basis.iter().all(|v| v.abs() <= 1.001) || !(0.0..=1.0).contains(&self.explained) {
            return Err("principal components that are no directions");
        }
        Ok(())
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

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;

    use super::*;

    fn centred(count: usize, width: usize, value: impl Fn(usize, usize) -> f64) -> Vec<f32> {
        let mut x = DMatrix::from_fn(count, width, value);
        for mut column in x.column_iter_mut() {
            let mean = column.mean();
            column.add_scalar_mut(-mean);
        }
        x.transpose().iter().map(|v| *v as f32).collect()
    }

    fn fit(rows: &[f32], width: usize, keep: Components) -> Pca {
        Pca::fit(rows, width, keep, &mut ChaCha8Rng::seed_from_u64(1))
    }

    #[test]
    fn it_agrees_with_scikit_learn() {
        // sklearn.decomposition.PCA(svd_solver="full") 1.9.1 on the same 8×4 matrix, signs as in `oriented`.
        let rows = centred(8, 4, |i, j| ((1 + 3 * i + 7 * j + i * j) as f64).sin());
        let pca = fit(&rows, 4, Components::Count(2));
        let expected =
            [0.080_301, 0.854_495, 0.476_829, -0.189_798, -0.101_624, -0.487_119, 0.865_143, -0.062_571];
        assert!(pca.basis.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5), "{:?}", pca.basis);
        assert!((pca.explained() - 0.726_150).abs() < 1e-5, "{}", pca.explained());
    }

    #[test]
    fn fewer_rows_than_columns_give_the_same_components() {
        // The rows once, and four times over: the first by the Gram matrix, the second by the covariance.
        let rows = centred(6, 20, |i, j| ((i * i + 3 * j + i * j) as f64).sin() * (1 + i) as f64);
        let (wide, tall) =
            (fit(&rows, 20, Components::Count(3)), fit(&rows.repeat(4), 20, Components::Count(3)));
        assert_eq!(wide.kept(), 3);
        assert!(wide.basis.iter().zip(&tall.basis).all(|(a, b)| (a - b).abs() < 1e-5));
    }

    #[test]
    fn a_large_matrix_gives_the_components_of_the_exact_decomposition() {
        // Spectrum falling by 3 % a step, as slowly as that of real gradients.
        let (count, width) = (300, 400);
        let rows = centred(count, width, |i, j| {
            (0..60)
                .map(|k| {
                    let (u, v) = ((i * (2 * k + 3)) as f64, (j * (2 * k + 5)) as f64);
                    0.97_f64.powi(k as i32) * (u * 0.11).sin() * (v * 0.07).cos()
                })
                .sum()
        });
        let x = DMatrix::from_row_iterator(count, width, rows.iter().map(|&v| f64::from(v)));
        let exact = exact(&x);
        let total: f64 = exact.iter().map(|(variance, _)| variance).sum();
        let leading: f64 = exact[..20].iter().map(|(variance, _)| variance).sum();
        let pca = fit(&rows, width, Components::Count(20));
        assert!((pca.explained() - leading / total).abs() < 1e-6, "{}", pca.explained());
        for (found, (_, direction)) in pca.directions().zip(&exact).take(10) {
            let cosine: f64 = found.iter().zip(direction).map(|(&a, b)| f64::from(a) * b).sum();
            assert!(cosine.abs() > 0.999_9, "{cosine}");
        }
        let part = leading / total;
        let kept = fit(&rows, width, Components::Variance(part - 1e-6)).kept();
        assert_eq!(kept, 20, "as few as keep {part}");
    }

    #[test]
    fn no_more_components_are_kept_than_the_data_have() {
        let flat = centred(10, 5, |i, j| (i * (j + 1)) as f64);
        assert_eq!(fit(&flat, 5, Components::Count(5)).kept(), 1, "all rows lie on one line");
    }

    #[test]
    fn directions_are_orthonormal() {
        let rows = centred(40, 12, |i, j| ((i * 7 + j * j * 3) as f64).sin());
        let pca = fit(&rows, 12, Components::Variance(0.95));
        for (i, a) in pca.directions().enumerate() {
            for (j, b) in pca.directions().enumerate() {
                let expected = if i == j { 1.0 } else { 0.0 };
                assert!((dot(a, b) - expected).abs() < 1e-5, "{i} {j}");
            }
        }
    }
}
