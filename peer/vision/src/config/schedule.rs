//! When the person in front of rendered cameras shows gestures.

use std::time::Duration;

use serde::{Deserialize, Serialize};

/// Gestures by the clock of the machine: the same for every process whose clock is right, so that rounds can begin by what
/// is seen. In every period the scene is empty first; then a hand comes in within half a second, holds a gesture still, and
/// leaves within half a second.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Schedule {
    /// From one gesture to the next. Range: `still` and 2 s more, to 1 h.
    #[serde(with = "humantime_serde")]
    pub period: Duration,
    /// How long the hand holds still. Range 1 s to 10 min.
    #[serde(with = "humantime_serde")]
    pub still: Duration,
}

impl Schedule {
    /// How long the hand takes to come into its place, and to leave it.
    pub const MOVE: Duration = Duration::from_millis(500);

    /// How long the scene is empty.
    #[must_use]
    pub fn nobody(&self) -> Duration {
        self.period.saturating_sub(self.still + 2 * Self::MOVE)
    }

    /// The number of the period at that time, and how much of it has passed.
    #[must_use]
    pub fn divide(&self, clock: Duration) -> (u64, Duration) {
        let period = self.period.as_nanos().max(1);
        let number = clock.as_nanos() / period;
        let passed = clock.as_nanos() % period;
        (number as u64, Duration::from_nanos(passed as u64))
    }

    /// Checks that a gesture fits into its period, with a second of an empty scene.
    ///
    /// # Errors
    /// What is wrong, and the range.
    pub fn validate(&self) -> Result<(), String> {
        if !(Duration::from_secs(1)..=Duration::from_secs(600)).contains(&self.still) {
            return Err(format!("still is {:?}: choose a value from 1s to 10min", self.still));
        }
        let least = self.still + 2 * Self::MOVE + Duration::from_secs(1);
        if !(least..=Duration::from_secs(3600)).contains(&self.period) {
            return Err(format!("period is {:?}: choose a value from {least:?} to 1h", self.period));
        }
        Ok(())
    }
}
