//! The human before rendered cameras: what they show, round by round.

use gestalt_protocol::RoundId;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::source::Scene;

/// A human who shows a gesture of 0 to 5 fingers in every round. All robots that are told the same seed see the
/// same human, wherever they run: what is shown follows from the seed and the round's counter alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Human {
    seed: u64,
}

impl Human {
    /// The human of that seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self { seed }
    }

    /// What they show in a round.
    #[must_use]
    pub fn shows(&self, round: RoundId) -> Scene {
        let mut chance = ChaCha8Rng::seed_from_u64(self.seed);
        chance.set_stream(u64::from(round.counter));
        Scene { gesture: Some(chance.random_range(0..=5)), seed: chance.random() }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use gestalt_protocol::RobotId;

    use super::*;

    fn round(counter: u32, opener: u32) -> RoundId {
        RoundId { counter, opener: RobotId(opener) }
    }

    #[test]
    fn robots_that_disagree_about_the_opener_see_the_same_hand() {
        assert_eq!(Human::new(3).shows(round(7, 1)), Human::new(3).shows(round(7, 2)));
    }

    #[test]
    fn every_gesture_is_shown_sooner_or_later() {
        let shown: BTreeSet<_> = (0..60).filter_map(|c| Human::new(3).shows(round(c, 1)).gesture).collect();
        assert_eq!(shown, (0..=5).collect());
    }
}
