//! An even sample of all that ever came.

use rand::Rng;
use rand::RngExt;

use super::contract::Forgetting;
use crate::sample::HeldSamples;

/// The newest sample, the i-th that ever came, stays with probability T / i in place of any of the T others; else it
/// goes itself. Each sample of the stream is then held with the same probability, whatever its class.
///
/// Algorithm R (Vitter, "Random sampling with a reservoir", ACM TOMS 1985). Cost: the walk to the sample drawn.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reservoir;

impl Forgetting for Reservoir {
    fn victim(&mut self, samples: &HeldSamples, rng: &mut dyn Rng) -> Option<u64> {
        let others = samples.len().checked_sub(1)?;
        // One of the i that came: those beyond the others held stand for the newest going itself.
        let place = rng.random_range(0..samples.arrivals().max(samples.len() as u64));
        let place = usize::try_from(place).map_or(others, |place| place.min(others));
        samples.iter().nth(place).map(|sample| sample.key)
    }
}
