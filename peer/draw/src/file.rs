//! A drawing's file: SVG or PNG, by its name.

use std::path::Path;

use crate::error::DrawError;
use crate::png::png;

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

/// Whether a drawing can be written there, asked before the work that is to be drawn is done. Leaves everything as it was.
///
/// # Errors
/// See [`DrawError`].
pub fn check(path: &Path) -> Result<(), DrawError> {
    Kind::of(path)?;
    gestalt_file::check(path).map_err(|cause| DrawError::io(path, cause))
}

/// Writes an SVG drawing to a file, as SVG or PNG.
///
/// # Errors
/// See [`DrawError`].
pub fn write(svg: &str, path: &Path) -> Result<(), DrawError> {
    match Kind::of(path)? {
        Kind::Svg => save(svg.as_bytes(), path),
        Kind::Png => save(&png(svg)?, path),
    }
}

/// Writes the bytes of a picture that is drawn already. Where they cannot all be written, what was there before stays. A link stays, and what it
/// leads to is replaced.
///
/// # Errors
/// A [`DrawError`] that names the path and what to do about it.
pub fn save(bytes: &[u8], path: &Path) -> Result<(), DrawError> {
    gestalt_file::write(path, bytes).map_err(|cause| DrawError::io(path, cause))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_cannot_be_written_is_named_with_what_to_do() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("no/round.png");
        for refused in [save(b"x", &missing), check(&missing)] {
            let refused = refused.unwrap_err().to_string();
            assert!(refused.contains("no/round.png") && refused.contains("mkdir"), "{refused}");
        }
        assert!(matches!(save(b"x", folder.path()), Err(DrawError::Write { .. })));
        if Path::new("/dev/full").exists() {
            let full = save(b"x", Path::new("/dev/full")).unwrap_err();
            assert!(matches!(full, DrawError::DiskFull(_)), "{full}");
        }
    }

    #[test]
    fn what_is_asked_for_by_a_wrong_name_is_not_begun() {
        assert!(matches!(check(Path::new("round.gif")), Err(DrawError::Name(_))));
    }
}
