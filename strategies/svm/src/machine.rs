//! One-vs-one support vector machines with an RBF kernel.

use serde::{Deserialize, Serialize};

use crate::vector::squared_distance;

/// Coordinates of support vectors lie within ± this, so that their squared distances are finite.
pub(crate) const MAX_COORDINATE: f32 = 1e6;

/// A soft-margin machine for every pair of classes, over K(x, y) = exp(−γ·|x − y|²).
///
/// A support vector serves all pairs of its class, so its kernel value is computed once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Machine {
    /// γ.
    pub gamma: f32,
    /// Components of a support vector.
    pub width: usize,
    /// The support vectors, `width` components each, by class.
    pub vectors: Vec<f32>,
    /// How many support vectors each class has.
    pub counts: Vec<usize>,
    /// For each pair (i < j): a weight for every support vector of i, then of j.
    pub weights: Vec<f32>,
    /// For each pair the offset ρ: the decision is Σ weight·K − ρ, positive for the first class.
    pub offsets: Vec<f64>,
}

/// The pairs (i < j) of so many classes, in the order used everywhere.
pub(crate) fn pairs(classes: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..classes).flat_map(move |i| (i + 1..classes).map(move |j| (i, j)))
}

impl Machine {
    /// Writes the decision value of each pair for `x` over `decisions`.
    pub fn decide(&self, x: &[f32], decisions: &mut Vec<f64>) {
        let vectors = self.vectors.chunks_exact(self.width);
        let kernel: Vec<f32> = vectors.map(|v| (-self.gamma * squared_distance(v, x)).exp()).collect();
        let mut start = 0;
        let of_class: Vec<&[f32]> = self
            .counts
            .iter()
            .map(|&count| {
                start += count;
                &kernel[start - count..start]
            })
            .collect();

        decisions.clear();
        let mut rest = self.weights.as_slice();
        for ((i, j), offset) in pairs(self.counts.len()).zip(&self.offsets) {
            let mut sum = -offset;
            for kernel in [of_class[i], of_class[j]] {
                let (weights, tail) = rest.split_at(kernel.len());
                rest = tail;
                sum += weights.iter().zip(kernel).map(|(&w, &k)| f64::from(w * k)).sum::<f64>();
            }
            decisions.push(sum);
        }
    }
}
