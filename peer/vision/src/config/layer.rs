//! What is done to frames so that different cameras show the same hand alike.

use std::time::Duration;

use gestalt_strategies::MindConfig;
use serde::{Deserialize, Serialize};

/// The stages of the heterogeneity layer, each on unless switched off: an ablation, never an improvement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LayerConfig {
    /// Square pixels and a close view of the hand of one size. Off: every frame is squeezed onto one canvas of
    /// 320×240, whatever its shape, and the hand is measured there.
    pub geometry: bool,
    /// White balance and exposure from the background. Off: colours are taken as the camera gives them, and a hand is
    /// whatever is colourful beyond a fixed threshold.
    pub colour: bool,
    /// Blur and noise of the close view made comparable. Off: the hand is measured at the camera's own pixels.
    pub resolution: bool,
    /// Evidence counts by the seconds between frames. Off: every frame counts alike, however many per second. Perception
    /// only carries this: it is the mind that weighs.
    pub time: bool,
}

impl LayerConfig {
    /// Every stage on.
    pub const ALL: Self = Self { geometry: true, colour: true, resolution: true, time: true };
    /// Every stage off.
    pub const NONE: Self = Self { geometry: false, colour: false, resolution: false, time: false };

    /// Makes a mind weigh what it sees as the stage of time has it: with it off, every frame is a look of its own.
    pub fn weigh(self, mind: &mut MindConfig) {
        if !self.time {
            mind.decorrelation = Duration::from_nanos(1);
            mind.discount_repeats = false;
        }
    }
}

impl Default for LayerConfig {
    fn default() -> Self {
        Self::ALL
    }
}
