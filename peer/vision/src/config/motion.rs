//! How a camera's motion is watched, as its configuration says it.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Parameters no motion detector can work with; each names the field and its range.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum MotionConfigError {
    /// A share or a factor outside its range.
    #[error("{field} is {value}: choose a value from {low} to {high}")]
    Range {
        /// The field.
        field: &'static str,
        /// Its value.
        value: f64,
        /// The least it may be.
        low: f64,
        /// The most it may be.
        high: f64,
    },
    /// A duration outside its range.
    #[error("{field} is {value:?}: choose a value from {low:?} to {high:?}")]
    Duration {
        /// The field.
        field: &'static str,
        /// Its value.
        value: Duration,
        /// The least it may be.
        low: Duration,
        /// The most it may be.
        high: Duration,
    },
}

/// How motion is told from rest, and a person from the empty scene. All in seconds and in shares of the frame, so that the
/// same values serve cameras of 2 to 30 frames per second and of any size.
///
/// A robot that watches motion opens rounds by itself: when a hand has moved and is then at rest. Its camera must not move;
/// in front of one that flies everything moves, and no round ever opens.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MotionConfig {
    /// Whether motion is watched at all. Default: false.
    pub enabled: bool,
    /// A frame is compared with one this much older, or with the one before when frames come slower. Default 60 ms,
    /// range 10 ms to 1 s.
    #[serde(with = "humantime_serde")]
    pub compare: Duration,
    /// How long something must move before it counts: shorter, it is a flicker. One frame of a slow camera is longer than
    /// that. Default 80 ms, range 0 to 1 s.
    #[serde(with = "humantime_serde")]
    pub react: Duration,
    /// How long nothing must move for a hand to be at rest; people pause for less within a movement. One frame of a
    /// camera of 2 frames per second. Default 500 ms, range 100 ms to 5 s.
    #[serde(with = "humantime_serde")]
    pub hold: Duration,
    /// The share of the frame that must change for a movement to begin; it lasts while half of that changes. Between frames
    /// more than 250 ms apart it is three times as much. A hand 1.6 m in front of a Foot-bot covers 0.01. Default 0.001, range 0.0002 to 0.2.
    pub area: f64,
    /// The share of the frame that must differ from the empty scene for a person to be present. Default 0.002, range
    /// 0.0002 to 0.5.
    pub presence: f64,
    /// How many standard deviations of its own noise a pixel must change by. Default 5, range 2 to 20.
    pub noise: f64,
    /// A scene in which nothing has moved for this long since the start is taken for empty. Default 3 s, range 500 ms to
    /// 1 h.
    #[serde(with = "humantime_serde")]
    pub learn: Duration,
    /// How fast the picture of the empty scene follows slow changes of it. Default 10 s, range 1 s to 1 h.
    #[serde(with = "humantime_serde")]
    pub adapt: Duration,
    /// What differs from the empty scene and does not move at all for this long is furniture, and belongs to it from then
    /// on. Default 60 s, range 2 s to 24 h.
    #[serde(with = "humantime_serde")]
    pub absorb: Duration,
}

impl Default for MotionConfig {
    fn default() -> Self {
        Self {
            enabled: false,
            compare: Duration::from_millis(60),
            react: Duration::from_millis(80),
            hold: Duration::from_millis(500),
            area: 0.001,
            presence: 0.002,
            noise: 5.0,
            learn: Duration::from_secs(3),
            adapt: Duration::from_secs(10),
            absorb: Duration::from_secs(60),
        }
    }
}

impl MotionConfig {
    /// The defaults, switched on.
    #[must_use]
    pub fn watching() -> Self {
        Self { enabled: true, ..Self::default() }
    }

    /// Checks every field against its range.
    ///
    /// # Errors
    /// [`MotionConfigError`] for the first field outside its range.
    pub fn validate(&self) -> Result<(), MotionConfigError> {
        const HOUR: u64 = 3_600_000;
        let numbers = [
            ("area", self.area, 0.0002, 0.2),
            ("presence", self.presence, 0.0002, 0.5),
            ("noise", self.noise, 2.0, 20.0),
        ];
        for (field, value, low, high) in numbers {
            if !(low..=high).contains(&value) {
                return Err(MotionConfigError::Range { field, value, low, high });
            }
        }
        let durations = [
            ("compare", self.compare, 10, 1000),
            ("react", self.react, 0, 1000),
            ("hold", self.hold, 100, 5000),
            ("learn", self.learn, 500, HOUR),
            ("adapt", self.adapt, 1000, HOUR),
            ("absorb", self.absorb, 2000, 24 * HOUR),
        ];
        for (field, value, low, high) in durations {
            let (low, high) = (Duration::from_millis(low), Duration::from_millis(high));
            if !(low..=high).contains(&value) {
                return Err(MotionConfigError::Duration { field, value, low, high });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_out_of_range_is_named() {
        assert_eq!(MotionConfig::default().validate(), Ok(()));
        let message = |config: MotionConfig| config.validate().unwrap_err().to_string();
        assert!(message(MotionConfig { area: 0.0, ..MotionConfig::default() }).contains("area is 0"));
        assert!(message(MotionConfig { noise: f64::NAN, ..MotionConfig::default() }).contains("noise"));
        assert!(message(MotionConfig { hold: Duration::ZERO, ..MotionConfig::default() }).contains("hold"));
    }
}
