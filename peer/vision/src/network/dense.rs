//! A layer in which every value out depends on every value in.

use super::tensors::{Tensors, WeightsError};

/// Sums are kept in so many parts, which the machine adds up side by side.
const LANES: usize = 16;

/// A matrix of weights, and biases.
#[derive(Clone, Debug)]
pub struct Dense {
    /// `[out][in]`.
    weights: Vec<f32>,
    bias: Vec<f32>,
    rectified: bool,
}

impl Dense {
    /// The next two tensors of a file, for a layer from so many values to so many.
    pub fn decode(
        (from, to): (usize, usize),
        rectified: bool,
        tensors: &mut Tensors,
    ) -> Result<Self, WeightsError> {
        Ok(Self { weights: tensors.take(from * to)?, bias: tensors.take(to)?, rectified })
    }

    /// Fills `output`.
    pub fn run(&self, input: &[f32], output: &mut [f32]) {
        debug_assert_eq!((input.len() * output.len(), output.len()), (self.weights.len(), self.bias.len()));
        let least = if self.rectified { 0.0 } else { f32::NEG_INFINITY };
        for ((value, weights), bias) in
            output.iter_mut().zip(self.weights.chunks_exact(input.len())).zip(&self.bias)
        {
            *value = (product(input, weights) + bias).max(least);
        }
    }
}

fn product(a: &[f32], b: &[f32]) -> f32 {
    let (mut a, mut b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let mut sums = [0.0; LANES];
    for (a, b) in a.by_ref().zip(b.by_ref()) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    let rest: f32 = a.remainder().iter().zip(b.remainder()).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f32>() + rest
}
