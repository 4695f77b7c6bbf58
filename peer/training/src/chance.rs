//! Random numbers of the kinds that pictures are made with.

use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

pub fn normal(rng: &mut impl Rng) -> f32 {
    rng.sample(StandardNormal)
}

pub fn uniform(rng: &mut impl Rng, low: f32, high: f32) -> f32 {
    if low < high { rng.random_range(low..high) } else { low }
}

pub fn chance(rng: &mut impl Rng, share: f32) -> bool {
    rng.random::<f32>() < share
}

pub fn log_uniform(rng: &mut impl Rng, low: f32, high: f32) -> f32 {
    uniform(rng, low.ln(), high.ln()).exp()
}

pub fn sign(rng: &mut impl Rng) -> f32 {
    if rng.random() { 1.0 } else { -1.0 }
}
