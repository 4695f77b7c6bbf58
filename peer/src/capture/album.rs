//! Where captured pictures are kept: the folder tree that training reads. Nothing that is there is ever written over.

use std::fs;
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

use gestalt_vision::dataset::has_image_name;
use thiserror::Error;

/// The longest name of a gesture, in bytes; as a vocabulary has it.
const MAX_NAME: usize = 64;

/// Pictures of one gesture that cannot be kept. Those kept before stay.
#[derive(Debug, Error)]
pub enum AlbumError {
    /// A gesture that could be no folder.
    #[error(
        "'{0}' is no name for a gesture: 1 to 64 bytes without '/', '\\' and control characters, not beginning with a dot"
    )]
    Name(String),
    /// The folder cannot be made or read, or the file not be written.
    #[error("cannot write to {}: {cause}: make sure that the folder can be written and the disk has room", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// What the system says.
        cause: io::Error,
    },
}

/// The pictures of one gesture: `DIR/GESTURE/s001_0001.jpg`.
#[derive(Debug)]
pub struct Album {
    folder: PathBuf,
    person: Option<u32>,
    next: u32,
}

impl Album {
    /// Opens the folder of a gesture in a dataset, which may have pictures already, or makes both. `person`: who shows the
    /// gesture, so that training keeps the pictures of one person together.
    ///
    /// # Errors
    /// See [`AlbumError`].
    pub fn open(dataset: &Path, gesture: &str, person: Option<u32>) -> Result<Self, AlbumError> {
        let fits = (1..=MAX_NAME).contains(&gesture.len())
            && !gesture.starts_with('.')
            && !gesture.contains(['/', '\\'])
            && !gesture.contains(char::is_control);
        if !fits {
            return Err(AlbumError::Name(gesture.chars().take(MAX_NAME).collect()));
        }
        let folder = dataset.join(gesture);
        let failed = |cause| AlbumError::Write { path: folder.clone(), cause };
        fs::create_dir_all(&folder).map_err(failed)?;
        let mut last = 0;
        for entry in fs::read_dir(&folder).map_err(failed)? {
            last = last.max(number(&entry.map_err(failed)?.path()).unwrap_or(0));
        }
        Ok(Self { folder, person, next: last.saturating_add(1) })
    }

    /// The folder.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Keeps a JPEG under the next number; gives its file.
    ///
    /// # Errors
    /// [`AlbumError::Write`]; nothing is left of a picture that could not be written whole.
    pub fn keep(&mut self, jpeg: &[u8]) -> Result<PathBuf, AlbumError> {
        loop {
            let number = self.next;
            let person = self.person.map_or(String::new(), |person| format!("s{person:03}_"));
            let path = self.folder.join(format!("{person}{number:04}.jpg"));
            self.next = number.saturating_add(1);
            return match whole(&path, jpeg) {
                Ok(()) => Ok(path),
                // Another program captures here too.
                Err(error) if error.kind() == ErrorKind::AlreadyExists && number < u32::MAX => continue,
                Err(cause) => Err(AlbumError::Write { path, cause }),
            };
        }
    }
}

/// Makes a new file that is whole as soon as it is there: half a picture would stop the training. Whoever may by the process's `umask` can read it.
fn whole(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = gestalt_file::folder(path);
    let mut beside = tempfile::Builder::new();
    #[cfg(unix)]
    beside.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = beside.tempfile_in(folder)?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    file.persist_noclobber(path).map_err(|refused| refused.error)?;
    gestalt_file::keep_name(path)
}

/// The number that an image's name ends with.
fn number(path: &Path) -> Option<u32> {
    let stem = path.file_stem()?.to_str().filter(|_| has_image_name(path))?;
    stem.rsplit(|c: char| !c.is_ascii_digit()).next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_numbered_on_and_none_is_written_over() {
        let dataset = tempfile::tempdir().unwrap();
        let fist = dataset.path().join("fist");
        fs::create_dir(&fist).unwrap();
        for (name, text) in
            [("s007_0041.png", "old"), ("s001_0043.jpg", "other"), ("notes-99.txt", "no picture")]
        {
            fs::write(fist.join(name), text).unwrap();
        }
        let mut album = Album::open(dataset.path(), "fist", Some(1)).unwrap();
        fs::write(fist.join("s001_0044.jpg"), "meanwhile").unwrap();
        assert_eq!(album.keep(b"new").unwrap(), fist.join("s001_0045.jpg"));
        assert_eq!(fs::read(fist.join("s001_0043.jpg")).unwrap(), b"other");
        assert_eq!(fs::read(fist.join("s001_0044.jpg")).unwrap(), b"meanwhile");
        assert_eq!(fs::read_dir(&fist).unwrap().count(), 5, "nothing is left beside them");
        let mut anew = Album::open(dataset.path(), "palm", None).unwrap();
        assert_eq!(anew.keep(b"x").unwrap(), dataset.path().join("palm/0001.jpg"));
    }

    #[test]
    fn a_gesture_is_a_folder_of_its_own_and_nothing_else() {
        let dataset = tempfile::tempdir().unwrap();
        for name in ["", ".", "..", "../fist", "a/b", "a\\b", ".hidden", "a\nb", &"x".repeat(65)] {
            let error = Album::open(dataset.path(), name, None).unwrap_err();
            assert!(matches!(error, AlbumError::Name(_)), "{name}: {error}");
        }
        assert!(Album::open(dataset.path(), "thumb up", None).is_ok());
        let taken = dataset.path().join("file");
        fs::write(&taken, "").unwrap();
        let error = Album::open(dataset.path(), "file", None).unwrap_err().to_string();
        assert!(error.contains(&taken.display().to_string()), "{error}");
    }
}
