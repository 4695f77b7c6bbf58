//! Pictures for people.
//!
//! Everything is drawn as SVG; [`write()`] leaves it so or renders it as PNG, by the file's name. PNGs are rendered with one embedded
//! font, so that the same picture looks the same on every machine. [`Sheet`] draws areas, pictures and text where plotters' charts do not serve.

pub mod confusion;
mod error;
mod file;
mod font;
mod png;
mod sheet;
mod text;

pub use error::DrawError;
pub use file::{Kind, check, save, write};
pub use png::{bgr, png};
pub use sheet::{Anchor, Letters, Place, Sheet, Tone};
pub use text::{escaped, fitting, text_width};
