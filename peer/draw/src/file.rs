//! A drawing's file: SVG or PNG, by its name.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

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
    let failed = |cause| DrawError::io(path, cause);
    // Opening a pipe would wait for its reader.
    if is_stream(path) {
        return Ok(());
    }
    let target = target(path).map_err(failed)?;
    let was_there = fs::symlink_metadata(&target).is_ok();
    fs::OpenOptions::new().create(true).append(true).open(&target).map_err(failed)?;
    if was_there { Ok(()) } else { fs::remove_file(&target).map_err(failed) }
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
    replace(bytes, path).map_err(|cause| DrawError::io(path, cause))
}

fn replace(bytes: &[u8], path: &Path) -> io::Result<()> {
    if is_stream(path) {
        return fs::write(path, bytes);
    }
    let path = target(path)?;
    let mut file = tempfile::Builder::new();
    #[cfg(unix)]
    file.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = file.tempfile_in(folder(&path))?;
    file.write_all(bytes)?;
    file.persist(path).map(drop).map_err(|refused| refused.error)
}

/// Whether a device or a pipe is there: that is written to, not replaced.
fn is_stream(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|there| !there.is_file() && !there.is_dir())
}

fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// How many links may lead to one another: as many as Linux follows.
const MAX_LINKS: usize = 40;

/// Where a link leads, through others, though nothing is there; of what is no link, its own path.
fn target(path: &Path) -> io::Result<PathBuf> {
    let mut here = path.to_owned();
    for _ in 0..=MAX_LINKS {
        match fs::read_link(&here) {
            Ok(next) => here = folder(&here).join(next),
            Err(_) => return Ok(here),
        }
    }
    Err(io::Error::other("its links lead in a circle"))
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
    fn asking_leaves_everything_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("round.svg");
        check(&path).unwrap();
        assert!(!path.exists());
        save(b"mine", &path).unwrap();
        check(&path).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"mine");
        assert!(matches!(check(&folder.path().join("round.gif")), Err(DrawError::Name(_))));
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_and_what_it_leads_to_is_replaced() {
        use std::os::unix::fs::symlink;

        let folder = tempfile::tempdir().unwrap();
        let [old, kept, link, round] =
            ["old.svg", "kept.svg", "link.svg", "round.svg"].map(|name| folder.path().join(name));
        symlink("old.svg", &link).unwrap();
        symlink("round.svg", &round).unwrap();
        check(&link).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink() && !old.exists());
        assert!(check(&round).is_err() && save(b"x", &round).is_err());
        fs::write(&old, "old").unwrap();
        fs::hard_link(&old, &kept).unwrap();
        save(b"new", &link).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!((fs::read(&old).unwrap(), fs::read(&kept).unwrap()), (b"new".to_vec(), b"old".to_vec()));
    }

    #[cfg(unix)]
    #[test]
    fn asking_does_not_wait_for_who_reads_a_pipe() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe.svg");
        if std::process::Command::new("mkfifo").arg(&pipe).status().is_ok_and(|made| made.success()) {
            check(&pipe).unwrap();
        }
    }
}
