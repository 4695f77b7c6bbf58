//! Pictures for training: which of a camera's frames are worth keeping, and where they are kept.
//!
//! ```text
//! frame ─► Judge: hand? cut off? light? sharp? new? ─┬─► Album: DIR/GESTURE/s001_0001.jpg ─► gestalt train --dataset DIR
//!                                                    └─► why not
//! ```

mod album;
mod judge;

pub use album::{Album, AlbumError};
pub use judge::{Judge, JudgeError, Unfit};
