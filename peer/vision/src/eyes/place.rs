//! Where a hand is.

use std::f32::consts::{PI, TAU};

use opencv::core::Size;

/// The smallest side of a hand worth looking at, in pixels of the camera.
const SMALLEST: f32 = 2.0;

/// Where a hand is in a frame, how large, and which way its fingers point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Centre of the hand, in pixels from the centre of the frame's first pixel to the right.
    pub x: f32,
    /// The same downwards.
    pub y: f32,
    /// Side of the square around the hand, pixels.
    pub side: f32,
    /// Which way its fingers point, radians from up clockwise, `-π..=π`.
    pub up: f32,
}

impl Place {
    /// Whether a hand can be there in a frame of that size.
    pub(super) fn is_within(&self, frame: Size) -> bool {
        let longest = frame.width.max(frame.height) as f32;
        (0.0..frame.width as f32).contains(&self.x)
            && (0.0..frame.height as f32).contains(&self.y)
            && (SMALLEST..2.0 * longest).contains(&self.side)
            && self.up.is_finite()
    }

    /// Whether the centre of another one is within this share of the larger one's side.
    pub(super) fn is_near(&self, other: &Self, share: f32) -> bool {
        (self.x - other.x).hypot(self.y - other.y) <= share * self.side.max(other.side)
    }

    /// The place that far from this one: right and down in its own sides and as it is turned, larger by a factor, turned
    /// clockwise.
    pub(super) fn moved(&self, (right, down): (f32, f32), larger: f32, turned: f32) -> Self {
        let (sin, cos) = self.up.sin_cos();
        let up = self.up + turned;
        Self {
            x: self.x + self.side * (cos * right - sin * down),
            y: self.y + self.side * (sin * right + cos * down),
            side: self.side * larger,
            up: if up.abs() > PI { up - TAU * (up / TAU).round() } else { up },
        }
    }
}
