//! The mind of a Gestalt robot for hosts in other languages: what crosses the border is numbers, JSON and bytes.
//!
//! Pure, as the mind itself: no clock, no entropy, no socket, no file. Time and the seed are arguments. The entry type is
//! [`PortableMind`]; [`ModelFile`] reads and writes classifiers as `gestalt train` does, and [`envelope`] spells what robots
//! say to each other as JSON, so that other languages can read and write it.
//!
//! This crate holds what all bindings have in common; `gestalt-c` and `gestalt-python` only translate. It speaks for robots of
//! open swarms: it neither signs nor checks signatures, which is `gestalt-trust`'s, and it keeps nothing on a disk, which is
//! `gestalt-link`'s.

pub mod envelope;
mod error;
mod model_file;
mod outbox;
mod portable;
mod settings;
mod sight;

pub use error::MindError;
pub use model_file::{MAX_MODEL_FILE, ModelFile, ModelFileError, Origin};
pub use outbox::OutgoingMessage;
pub use portable::PortableMind;
pub use settings::{MAX_SETTINGS, Settings};
