//! The leading principal directions of a large matrix, without decomposing all of it.
//!
//! Randomised subspace iteration: N. Halko, P. G. Martinsson, J. A. Tropp, "Finding structure with randomness",
//! SIAM Review 53 (2011), algorithms 4.4 and 5.1.

use nalgebra::DMatrix;
use rand::{Rng, RngExt};

/// Directions sought beyond those wanted: they take up what the wanted ones would otherwise mix with.
const OVERSAMPLING: usize = 16;
/// Power iterations: each squares the ratio between wanted and unwanted singular values.
const ITERATIONS: usize = 8;

/// The `wanted` leading right singular vectors of `x`, each with its squared singular value, falling.
pub(super) fn leading(x: &DMatrix<f64>, wanted: usize, rng: &mut impl Rng) -> Vec<(f64, Vec<f64>)> {
    let block = (wanted + OVERSAMPLING).min(x.nrows()).min(x.ncols());
    let start = DMatrix::from_fn(x.ncols(), block, |_, _| rng.random_range(-1.0..1.0));
    // Transposed once: nalgebra's `tr_mul` takes column by column, ten times slower than its blocked product.
    let transposed = x.transpose();
    // Without an orthonormal basis in between, all columns would turn towards the first direction.
    let mut range = (x * start).qr().q();
    for _ in 0..ITERATIONS {
        range = (x * (&transposed * range)).qr().q();
    }
    // The small matrix B = Qᵀ·X has the leading singular values and right vectors of X.
    let small = range.transpose() * x;
    let eigen = (&small * small.transpose()).symmetric_eigen();
    let mut order: Vec<usize> = (0..block).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    order
        .into_iter()
        .take(wanted)
        .map(|i| {
            let direction = small.tr_mul(&eigen.eigenvectors.column(i));
            let norm = direction.norm().max(f64::MIN_POSITIVE);
            (eigen.eigenvalues[i].max(0.0), direction.iter().map(|v| v / norm).collect())
        })
        .collect()
}
