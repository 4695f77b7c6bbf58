//! How a hand is held, as a drawn hand can be told.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// How a hand is held. What is left out is a fist, upright, its palm towards the camera.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HandPose {
    /// The thumb.
    pub thumb: Thumb,
    /// The fingers.
    pub index: Finger,
    /// …
    pub middle: Finger,
    /// …
    pub ring: Finger,
    /// …
    pub little: Finger,
    /// How far straight fingers are spread: 1 as in a relaxed open hand, 0 side by side. Range `0.0..=2.0`.
    pub spread: f32,
    /// How far the hand is turned in the picture, anticlockwise. Range `-180.0..=180.0` degrees; the arm follows it half-way.
    pub roll_deg: f32,
    /// How far its fingers lean towards the camera. Range `-60.0..=60.0` degrees.
    pub tilt_deg: f32,
    /// How far it is turned about the line of its fingers. Range `-90.0..=90.0` degrees.
    pub turn_deg: f32,
    /// Which hand it is.
    pub hand: Which,
}

/// How a finger is held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Finger {
    /// Into the fist.
    #[default]
    Folded,
    /// Stretched.
    Straight,
    /// Bent at its second joint, as a claw.
    Hooked,
    /// Towards the camera.
    Forward,
    /// Its tip at the thumb's.
    Pinched,
}

/// How the thumb is held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Thumb {
    /// Across the palm, or across folded fingers.
    #[default]
    Folded,
    /// Stretched sideways, as when counting.
    Out,
    /// Stretched at a right angle to the hand.
    Wide,
    /// Along the hand's edge.
    Beside,
    /// Its tip at the index finger's.
    Pinched,
}

/// Which hand shows a gesture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Which {
    /// Each person's own: three in ten are left-handed.
    #[default]
    Either,
    /// The right one.
    Right,
    /// The left one.
    Left,
}

/// A hand that cannot be held so.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{field} is {value}: set it within {low}..={high}")]
pub struct HandPoseError {
    /// The field.
    pub field: &'static str,
    /// Its value.
    pub value: f32,
    /// The smallest value allowed.
    pub low: f32,
    /// The largest value allowed.
    pub high: f32,
}

impl Default for HandPose {
    fn default() -> Self {
        Self {
            thumb: Thumb::Folded,
            index: Finger::Folded,
            middle: Finger::Folded,
            ring: Finger::Folded,
            little: Finger::Folded,
            spread: 1.0,
            roll_deg: 0.0,
            tilt_deg: 0.0,
            turn_deg: 0.0,
            hand: Which::Either,
        }
    }
}

impl HandPose {
    /// The four long fingers, from the index finger on.
    #[must_use]
    pub fn fingers(&self) -> [Finger; 4] {
        [self.index, self.middle, self.ring, self.little]
    }

    /// Checks every number against its range.
    ///
    /// # Errors
    /// [`HandPoseError`] for the first outside it; what is no number is in no range.
    pub fn validate(&self) -> Result<(), HandPoseError> {
        let fields = [
            ("spread", self.spread, 0.0, 2.0),
            ("roll_deg", self.roll_deg, -180.0, 180.0),
            ("tilt_deg", self.tilt_deg, -60.0, 60.0),
            ("turn_deg", self.turn_deg, -90.0, 90.0),
        ];
        for (field, value, low, high) in fields {
            if !(low..=high).contains(&value) {
                return Err(HandPoseError { field, value, low, high });
            }
        }
        Ok(())
    }
}
