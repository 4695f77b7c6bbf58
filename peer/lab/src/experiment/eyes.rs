//! The eyes of a robot in an experiment: at one place, before the hands of a pool.

use std::sync::Arc;

use gestalt_protocol::ClassId;
use gestalt_strategies::{Classify, Observation};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::pool::Pool;
use super::setting::Moments;
use super::split::Split;
use crate::emulation::Observer;

/// Sees, at each frame, a moment of the gesture shown.
#[derive(Clone, Debug)]
pub struct PoolEyes {
    /// What there is to be seen.
    pub pool: Arc<Pool>,
    /// Of it, what is shown.
    pub split: Arc<Split>,
    /// Where the robot stands.
    pub place: usize,
    /// Whether all robots see the same moment.
    pub moments: Moments,
    /// The showing after which the hands are those after the drift.
    pub drift_after: Option<u32>,
    /// The run.
    pub seed: u64,
    /// Seconds between two frames.
    pub period: f64,
    /// How many gestures were shown, which one last, and how many frames of it were taken.
    pub shown: (u32, ClassId, u64),
}

impl Observer for PoolEyes {
    fn classifier(&self) -> Option<Arc<dyn Classify>> {
        None
    }

    fn period(&self) -> f64 {
        self.period
    }

    fn show(&mut self, shown: ClassId, _: &mut dyn rand::Rng) {
        self.shown = (self.shown.0 + 1, shown, 0);
    }

    fn frame(&mut self, rng: &mut dyn rand::Rng) -> Option<Observation> {
        let (showing, class, frame) = self.shown;
        self.shown.2 += 1;
        let after = usize::from(self.drift_after.is_some_and(|last| showing > last));
        let taught = &self.split.taught[after][class.index()];
        let draw = match self.moments {
            Moments::Own => rng.random_range(0..taught.len() as u64),
            Moments::Common => {
                let mut common = ChaCha8Rng::seed_from_u64(self.seed);
                common.set_stream(u64::from(showing) << 32 | frame);
                common.random_range(0..taught.len() as u64)
            }
        };
        self.pool.view(taught[draw as usize], self.place)
    }
}
