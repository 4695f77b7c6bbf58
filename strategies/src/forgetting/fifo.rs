//! First in, first out.

use rand::Rng;

use super::contract::Forgetting;
use crate::sample::HeldSamples;

/// The oldest sample of the whole set goes, whatever its class.
///
/// From the source research: follows a drift, and loses a class that is not shown for a while. Cost: constant.
#[derive(Clone, Copy, Debug, Default)]
pub struct Fifo;

impl Forgetting for Fifo {
    fn victim(&mut self, samples: &HeldSamples, _: &mut dyn Rng) -> Option<u64> {
        samples.iter().next().map(|oldest| oldest.key)
    }
}
