//! A drawing's file: SVG or PNG, by its name.

use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::png;

/// Why there is no drawing.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DrawError {
    /// A name that ends in neither `.svg` nor `.png`.
    #[error("the drawing {}: give it a name that ends in .svg or .png", .0.display())]
    Name(PathBuf),
    /// The folder it would go into does not exist.
    #[error("the drawing {}: there is no folder {}", .0.display(), .0.parent().unwrap_or(.0).display())]
    NoFolder(PathBuf),
    /// The drawing is no SVG that can be rendered.
    #[error("cannot draw: {0}")]
    Svg(String),
    /// The file cannot be written.
    #[error("cannot write the drawing {}: {cause}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: std::io::Error,
    },
}

/// What a drawing is written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// As it was drawn: text stays text.
    Svg,
    /// As pixels.
    Png,
}

impl Kind {
    /// What a file of that name holds.
    ///
    /// # Errors
    /// [`DrawError::Name`].
    pub fn of(path: &Path) -> Result<Self, DrawError> {
        match path.extension().map(|extension| extension.to_ascii_lowercase()) {
            Some(extension) if extension == "svg" => Ok(Self::Svg),
            Some(extension) if extension == "png" => Ok(Self::Png),
            _ => Err(DrawError::Name(path.to_owned())),
        }
    }
}

/// Whether a drawing can be written there, asked before the work that is to be drawn is done.
///
/// # Errors
/// [`DrawError::Name`], [`DrawError::NoFolder`].
pub fn check(path: &Path) -> Result<(), DrawError> {
    Kind::of(path)?;
    match path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        Some(folder) if !folder.is_dir() => Err(DrawError::NoFolder(path.to_owned())),
        _ => Ok(()),
    }
}

/// Writes an SVG drawing to a file, as SVG or PNG.
///
/// # Errors
/// See [`DrawError`].
pub fn write(svg: &str, path: &Path) -> Result<(), DrawError> {
    let bytes = match Kind::of(path)? {
        Kind::Svg => svg.as_bytes().to_vec(),
        Kind::Png => png(svg)?,
    };
    std::fs::write(path, bytes).map_err(|cause| DrawError::Write { path: path.to_owned(), cause })
}
