//! Pictures for people: of one round, with what every robot saw and what the swarm decided; in [`stages`], of one frame on
//! its way through perception; in [`view`], of what one robot sees now; in [`vocabulary`], of gestures to show. All are SVG, frames and all; [`gestalt_draw::write`]
//! makes PNG of them.

mod frame;
mod round;
pub mod stages;
mod tone;
pub mod view;
pub mod vocabulary;

use thiserror::Error;

pub use frame::write_png;
pub use round::{MAX_PANELS, Panel, round};

/// Why there is no picture.
#[derive(Debug, Error)]
pub enum PictureError {
    /// It cannot be rendered or written.
    #[error(transparent)]
    Draw(#[from] gestalt_draw::DrawError),
    /// A frame is empty or of another type, or OpenCV cannot encode it.
    #[error("OpenCV: {0}")]
    OpenCv(#[from] opencv::Error),
}
