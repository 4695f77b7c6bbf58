//! The numbers that are learned, and how they go downhill.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// One of the tensors of [`Parameters`].
#[derive(Clone, Copy, Debug)]
pub struct Parameter(usize);

#[derive(Clone, Debug)]
struct Tensor {
    values: Vec<f32>,
    /// Weights are drawn towards zero; biases and what normalises are not.
    decays: bool,
    /// The first and second moment of its gradient.
    moments: [Vec<f32>; 2],
}

/// All tensors of a network.
#[derive(Clone, Debug)]
pub struct Parameters {
    tensors: Vec<Tensor>,
    rng: ChaCha8Rng,
    steps: i32,
}

impl Parameters {
    /// None yet; what will be random is drawn from that seed.
    pub fn new(seed: u64) -> Self {
        Self { tensors: Vec::new(), rng: ChaCha8Rng::seed_from_u64(seed), steps: 0 }
    }

    fn add(&mut self, values: Vec<f32>, decays: bool) -> Parameter {
        let zeros = vec![0.0; values.len()];
        self.tensors.push(Tensor { values, decays, moments: [zeros.clone(), zeros] });
        Parameter(self.tensors.len() - 1)
    }

    /// Weights that begin uniform within ±1/√`inputs`, `inputs` being how many go into a sum.
    pub fn weights(&mut self, count: usize, inputs: usize) -> Parameter {
        let bound = 1.0 / (inputs as f32).sqrt();
        let values = (0..count).map(|_| self.rng.random_range(-bound..bound)).collect();
        self.add(values, true)
    }

    /// Numbers that begin all the same.
    pub fn constant(&mut self, count: usize, value: f32) -> Parameter {
        self.add(vec![value; count], false)
    }

    pub fn get(&self, parameter: Parameter) -> &[f32] {
        &self.tensors[parameter.0].values
    }

    pub fn get_mut(&mut self, parameter: Parameter) -> &mut [f32] {
        &mut self.tensors[parameter.0].values
    }

    /// Zeros for the gradient of each.
    pub fn no_gradient(&self) -> Gradient {
        Gradient(self.tensors.iter().map(|tensor| vec![0.0; tensor.values.len()]).collect())
    }

    /// Begins to learn anew from where it is: what was known of gradients is forgotten.
    pub fn rest(&mut self) {
        self.steps = 0;
        for moments in self.tensors.iter_mut().flat_map(|tensor| &mut tensor.moments) {
            moments.fill(0.0);
        }
    }
}

/// How a loss changes with each number of [`Parameters`].
#[derive(Debug)]
pub struct Gradient(Vec<Vec<f32>>);

impl Gradient {
    pub fn of(&mut self, parameter: Parameter) -> &mut [f32] {
        &mut self.0[parameter.0]
    }

    #[cfg(test)]
    pub fn get(&self, parameter: Parameter) -> &[f32] {
        &self.0[parameter.0]
    }
}

/// AdamW (I. Loshchilov, F. Hutter, "Decoupled weight decay regularization", 2019).
#[derive(Clone, Copy, Debug)]
pub struct Descent {
    /// Share of a weight that is taken away in a step of rate 1.
    pub decay: f32,
    /// Longest gradient, all numbers together: a longer one is shortened.
    pub longest: f32,
}

impl Descent {
    const MOMENTUM: f32 = 0.9;
    const SCALE: f32 = 0.999;
    const LEAST: f32 = 1e-8;

    pub fn step(&self, parameters: &mut Parameters, gradient: &Gradient, rate: f32) {
        let squares: f64 = gradient.0.iter().flatten().map(|g| f64::from(*g).powi(2)).sum();
        let shorter = (f64::from(self.longest) / squares.sqrt().max(1e-12)).min(1.0) as f32;
        parameters.steps += 1;
        let unbiased = |factor: f32| 1.0 / (1.0 - factor.powi(parameters.steps));
        let (first, second) = (unbiased(Self::MOMENTUM), unbiased(Self::SCALE));
        for (tensor, gradient) in parameters.tensors.iter_mut().zip(&gradient.0) {
            let [mean, square] = &mut tensor.moments;
            let kept = if tensor.decays { 1.0 - rate * self.decay } else { 1.0 };
            for (((value, g), m), s) in tensor.values.iter_mut().zip(gradient).zip(mean).zip(square) {
                let g = g * shorter;
                *m = Self::MOMENTUM * *m + (1.0 - Self::MOMENTUM) * g;
                *s = Self::SCALE * *s + (1.0 - Self::SCALE) * g * g;
                *value = *value * kept - rate * *m * first / ((*s * second).sqrt() + Self::LEAST);
            }
        }
    }
}
