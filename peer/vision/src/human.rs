//! The human before rendered cameras: what they show, round by round or by the clock.

use std::time::Duration;

use gestalt_protocol::RoundId;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub use crate::config::Schedule;
use crate::source::scene::Scene;

/// How long the hand takes to come into its place, and to leave it.
const MOVE: Duration = Schedule::MOVE;

/// From how far away the hand comes, in metres: no camera before it sees that far.
const AWAY_M: f32 = 1.8;

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
        Scene { gesture: Some(self.in_turn(round.counter.saturating_sub(1))), seed: chance.random() }
    }

    /// Each of the gestures once, in some order, before any is shown again: who teaches leaves none out.
    fn in_turn(&self, showing: u32) -> u8 {
        let mut gestures = [0, 1, 2, 3, 4, 5];
        let mut chance = ChaCha8Rng::seed_from_u64(self.seed);
        // Beyond those of single rounds.
        chance.set_stream(1 << 32 | u64::from(showing / 6));
        gestures.shuffle(&mut chance);
        gestures[showing as usize % 6]
    }

    /// What they show at that time since 1970, and how far their hand is from its place, in metres. In every period there is
    /// nobody first; then the hand comes, holds still, and leaves as the period ends.
    #[must_use]
    pub fn shows_at(&self, clock: Duration, schedule: &Schedule) -> (Scene, f32) {
        let (number, into) = schedule.divide(clock);
        let nobody = schedule.nobody();
        let Some(seen) = into.checked_sub(nobody) else {
            return (Scene { gesture: None, seed: 0 }, 0.0);
        };
        let part = |passed: Duration| passed.as_secs_f32() / MOVE.as_secs_f32();
        let away_m = if seen < MOVE {
            AWAY_M * (1.0 - part(seen))
        } else {
            AWAY_M * part(seen.saturating_sub(MOVE + schedule.still))
        };
        let mut chance = ChaCha8Rng::seed_from_u64(self.seed);
        chance.set_stream(number);
        (Scene { gesture: Some(chance.random_range(0..=5)), seed: chance.random() }, away_m)
    }

    /// The gesture of the showing to which a robot's round at that time since 1970 belongs: the last one that was in its
    /// place by then.
    #[must_use]
    pub fn last_shown(&self, clock: Duration, schedule: &Schedule) -> Option<u8> {
        let (_, into) = schedule.divide(clock);
        let back = if into >= schedule.nobody() { Duration::ZERO } else { into + Duration::from_millis(1) };
        let at = clock.checked_sub(back)?;
        self.shows_at(at, schedule).0.gesture
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use gestalt_protocol::RobotId;

    use super::*;

    fn round(counter: u32, opener: u32) -> RoundId {
        RoundId { counter, opener: RobotId(opener), life: 0 }
    }

    #[test]
    fn robots_that_disagree_about_the_opener_see_the_same_hand() {
        assert_eq!(Human::new(3).shows(round(7, 1)), Human::new(3).shows(round(7, 2)));
    }

    #[test]
    fn by_the_clock_a_hand_comes_holds_still_and_leaves() {
        let schedule = Schedule { period: Duration::from_secs(6), still: Duration::from_millis(2500) };
        let human = Human::new(3);
        let at = |ms: u64| human.shows_at(Duration::from_millis(6_000_000 + ms), &schedule);
        assert_eq!(at(0), (Scene { gesture: None, seed: 0 }, 0.0));
        let (scene, far) = at(2600);
        assert!(scene.gesture.is_some() && far > 1.0);
        assert_eq!(at(3000), (scene, 0.0));
        assert_eq!(at(5400), (scene, 0.0));
        assert!(at(5900).1 > 1.0 && at(5900).0 == scene);
        assert_eq!(at(6000).0.gesture, None);
        let last = |ms: u64| human.last_shown(Duration::from_millis(6_000_000 + ms), &schedule);
        assert_eq!((last(3500), last(6000), last(8000)), (scene.gesture, scene.gesture, scene.gesture));
        assert_ne!(at(9100).0.seed, scene.seed);
    }

    #[test]
    fn each_gesture_is_shown_before_any_is_shown_again_in_another_order_each_time() {
        let turn = |n: u32| (1..=6).map(move |k| Human::new(3).shows(round(6 * n + k, 1)).gesture);
        for n in 0..5 {
            assert_eq!(turn(n).collect::<BTreeSet<_>>(), (0..=5).map(Some).collect());
        }
        let orders: BTreeSet<Vec<_>> = (0..5).map(|n| turn(n).collect()).collect();
        assert!(orders.len() > 1, "always in one order: {orders:?}");
    }
}
