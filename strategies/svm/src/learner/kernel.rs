//! The kernel, and rows of it that grow.

use crate::vector::squared_distance;

/// exp(−γ·‖x − y‖²): the same bits whichever of the two comes first.
pub(super) fn kernel(gamma: f32, x: &[f32], y: &[f32]) -> f32 {
    (-gamma * squared_distance(x, y)).exp()
}

/// Pushes into a vector that grows by an eighth, not by the half: there are as many as samples.
pub(super) fn push(row: &mut Vec<f32>, value: f32) {
    if row.len() == row.capacity() {
        row.reserve_exact(roomy(row.len()) - row.len());
    }
    row.push(value);
}

/// Room for an eighth more.
pub(super) fn roomy(length: usize) -> usize {
    length + length / 8 + 4
}
