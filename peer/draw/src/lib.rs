//! Pictures for people.
//!
//! Everything is drawn as SVG; [`write`] leaves it so or renders it as PNG, by the file's name. PNGs are rendered with one embedded
//! font, so that the same picture looks the same on every machine.

pub mod confusion;
mod file;
mod png;

pub use file::{DrawError, Kind, check, write};
pub use png::png;
