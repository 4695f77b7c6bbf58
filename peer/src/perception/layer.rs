//! The heterogeneity layer: what makes frames of different cameras alike before anything is measured in them.
//!
//! | stage | on | off |
//! |---|---|---|
//! | geometry (`frame`) | the aspect is kept, the hand is looked at closely in 192×192 pixels | every frame is squeezed onto 320×240, and the hand is measured there |
//! | colour (`white_balance`, `colour`) | the background is grey, and the hand is what differs from it | the camera's colours, and a hand is what has more colour than a fixed threshold |
//! | resolution (`resolution`) | blur and noise of the close view are brought to one measure | the hand is measured at the camera's own pixels |
//! | time | evidence counts by the seconds between frames | every frame counts alike; perception only carries this |

use opencv::core::Size;
use thiserror::Error;

pub use crate::config::LayerConfig;

/// A camera whose frames are not those that its model promises. Perception adapts to what comes.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error(
    "camera '{camera}' should give {}×{} pixels and gives {}×{}: adapted; correct camera.model or the camera's format",
    expected.width, expected.height, found.width, found.height
)]
pub struct CameraMismatch {
    /// The camera's name.
    pub camera: String,
    /// The size that its model has.
    pub expected: Size,
    /// The size of its frames.
    pub found: Size,
}
