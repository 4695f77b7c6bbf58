//! Any sample is as good as another.

use gestalt_rounds::Classify;
use rand::Rng;

use super::contract::Selection;
use crate::sample::{HeldSamples, SetPart, draw};

/// A class K at random among those with personal samples, then one of its personal samples at random.
///
/// The yardstick of the source research. Cost: constant.
#[derive(Clone, Copy, Debug, Default)]
pub struct RandomSelection;

impl Selection for RandomSelection {
    fn select(&mut self, samples: &HeldSamples, _: Option<&dyn Classify>, rng: &mut dyn Rng) -> Option<u64> {
        let class = samples.draw_personal_class(rng)?;
        draw(samples.part_keys(SetPart::Personal, class), rng)
    }
}
