//! Any sample can be spared as well as another.

use rand::Rng;

use super::contract::Forgetting;
use crate::sample::{HeldSamples, draw};

/// Of the class with the most samples (ties at random) any one goes.
///
/// From the source research, where it was the best. Cost: constant.
#[derive(Clone, Copy, Debug, Default)]
pub struct RandomForgetting;

impl Forgetting for RandomForgetting {
    fn victim(&mut self, samples: &HeldSamples, rng: &mut dyn Rng) -> Option<u64> {
        let class = samples.draw_largest_class(rng)?;
        draw(samples.class_keys(class), rng)
    }
}
