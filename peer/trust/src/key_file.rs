//! A secret key on disk.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use gestalt_protocol::hex::{self, HexError};
use thiserror::Error;
use zeroize::Zeroizing;

use crate::identity::Identity;

/// A key file that cannot be used, or not be made. None of them repeats what is in the file.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum KeyFileError {
    /// It is there already; it was left as it is.
    #[error("{path}: a file is there already and is never overwritten: move it away, or choose another path")]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// It could not be written; what had been written of it is gone.
    #[error(
        "{path}: the key could not be written: {source}: make sure that its folder exists, can be written to and has room"
    )]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// It could not be read.
    #[error(
        "{path}: the key could not be read: {source}: check the path, and that the file belongs to who runs the robot"
    )]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A folder, a pipe, a device.
    #[error("{path}: no ordinary file: name the file that holds the key")]
    NoFile {
        /// What is there instead.
        path: PathBuf,
    },
    /// Others on this computer can read or change it, so the key may not be secret any more.
    #[error(
        "{path}: other users can use this key (mode {mode:04o}): make a new key; if nobody else was ever on this \
         computer, chmod 600 {path}"
    )]
    Exposed {
        /// The file.
        path: PathBuf,
        /// Its permission bits.
        mode: u32,
    },
    /// Not 64 hexadecimal digits and a line break.
    #[error(
        "{path}: no key file, which is one line of 64 hexadecimal digits ({reason}): restore it, or make a new key"
    )]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What is wrong with its text.
        reason: HexError,
    },
}

/// The longest key file looked into: the digits, and line breaks of any system.
const MAX_KEY_FILE: u64 = 128;

impl Identity {
    /// Writes the secret to a new file that only its owner can read and write (mode 0600): 64 hexadecimal digits and a line
    /// break. It is on disk when this returns.
    ///
    /// # Errors
    /// [`KeyFileError::Exists`] and [`KeyFileError::Write`].
    pub fn write(&self, path: &Path) -> Result<(), KeyFileError> {
        // Half a key, whatever kept the rest of it off the disk, would stand in the way of the next attempt.
        gestalt_file::new_secret(path, self.text().as_ref()).map_err(|source| match source.kind() {
            io::ErrorKind::AlreadyExists => KeyFileError::Exists { path: path.to_owned() },
            _ => KeyFileError::Write { path: path.to_owned(), source },
        })
    }

    /// Reads what [`Identity::write`] wrote.
    ///
    /// # Errors
    /// Every other [`KeyFileError`]; a file that other users can use is refused, unread.
    pub fn read(path: &Path) -> Result<Self, KeyFileError> {
        let unreadable = |source| KeyFileError::Read { path: path.to_owned(), source };
        // Looked at before it is opened: opening a pipe would wait for somebody to write to it.
        if !fs::metadata(path).map_err(unreadable)?.is_file() {
            return Err(KeyFileError::NoFile { path: path.to_owned() });
        }
        let file = File::open(path).map_err(unreadable)?;
        refuse_exposed(path, &file)?;
        // Room for all of it from the start: growing would leave copies of the secret behind.
        let mut text = Zeroizing::new(Vec::with_capacity(2 * MAX_KEY_FILE as usize));
        file.take(MAX_KEY_FILE).read_to_end(&mut text).map_err(unreadable)?;
        let text = str::from_utf8(text.trim_ascii_end())
            .map_err(|error| HexError::Digit { position: error.valid_up_to() + 1 });
        let bytes = text
            .and_then(hex::parse)
            .map_err(|reason| KeyFileError::Malformed { path: path.to_owned(), reason })?;
        Ok(Self::from_bytes(&Zeroizing::new(bytes)))
    }

    /// The key file's content.
    fn text(&self) -> Zeroizing<[u8; 65]> {
        let digit = |value: u8| b"0123456789abcdef"[usize::from(value)];
        let mut text = Zeroizing::new([b'\n'; 65]);
        for (place, byte) in self.to_bytes().iter().enumerate() {
            text[2 * place] = digit(byte >> 4);
            text[2 * place + 1] = digit(byte & 15);
        }
        text
    }
}

#[cfg(unix)]
fn refuse_exposed(path: &Path, file: &File) -> Result<(), KeyFileError> {
    let metadata = file.metadata().map_err(|source| KeyFileError::Read { path: path.to_owned(), source })?;
    let mode = std::os::unix::fs::MetadataExt::mode(&metadata) & 0o777;
    if mode & 0o077 == 0 { Ok(()) } else { Err(KeyFileError::Exposed { path: path.to_owned(), mode }) }
}

#[cfg(not(unix))]
fn refuse_exposed(_: &Path, _: &File) -> Result<(), KeyFileError> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use tempfile::TempDir;

    use super::*;

    fn folder() -> (TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("robot.key");
        (folder, path)
    }

    #[test]
    fn what_is_written_is_read() {
        let (_folder, path) = folder();
        let identity = Identity::from_bytes(&[0x1f; 32]);
        identity.write(&path).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "1f".repeat(32) + "\n");
        assert_eq!(Identity::read(&path).unwrap().to_bytes(), identity.to_bytes());
    }

    #[test]
    fn a_key_is_never_overwritten() {
        let (_folder, path) = folder();
        Identity::from_bytes(&[1; 32]).write(&path).unwrap();
        let error = Identity::from_bytes(&[2; 32]).write(&path).unwrap_err();
        assert!(matches!(error, KeyFileError::Exists { .. }), "{error}");
        assert_eq!(*Identity::read(&path).unwrap().to_bytes(), [1; 32]);
    }

    #[cfg(unix)]
    #[test]
    fn a_key_that_others_can_use_is_refused() {
        use std::os::unix::fs::PermissionsExt;
        let (_folder, path) = folder();
        Identity::from_bytes(&[1; 32]).write(&path).unwrap();
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        for mode in [0o644, 0o640, 0o602, 0o601] {
            fs::set_permissions(&path, fs::Permissions::from_mode(mode)).unwrap();
            let error = Identity::read(&path).unwrap_err();
            assert!(matches!(error, KeyFileError::Exposed { mode: found, .. } if found == mode), "{error}");
        }
        fs::set_permissions(&path, fs::Permissions::from_mode(0o400)).unwrap();
        assert!(Identity::read(&path).is_ok());
    }

    #[test]
    fn what_is_no_key_file_is_named_and_not_repeated() {
        let (folder, path) = folder();
        let missing = Identity::read(&path).unwrap_err();
        assert!(matches!(missing, KeyFileError::Read { .. }), "{missing}");
        let no_file = Identity::read(folder.path()).unwrap_err();
        assert!(matches!(no_file, KeyFileError::NoFile { .. }), "{no_file}");
        let nowhere = Identity::from_bytes(&[1; 32]).write(&folder.path().join("no/such.key")).unwrap_err();
        assert!(matches!(nowhere, KeyFileError::Write { .. }), "{nowhere}");

        let digits = "5e".repeat(32);
        let of_third = [&digits.as_bytes()[..2], &[0xff; 62]].concat();
        // The character that is no digit, where it is one.
        let bad: [(Vec<u8>, Option<usize>); 7] = [
            (Vec::new(), None),
            (digits.as_bytes()[..63].to_vec(), None),
            (format!("{digits}5").into(), None),
            (format!("{digits}\n{digits}").into(), None),
            (digits.to_uppercase().into(), Some(2)),
            (vec![0xff; 64], Some(1)),
            (of_third, Some(3)),
        ];
        for (text, wrong) in bad {
            Identity::from_bytes(&[1; 32]).write(&path).unwrap();
            fs::write(&path, text).unwrap();
            let error = Identity::read(&path).unwrap_err();
            let KeyFileError::Malformed { reason, .. } = &error else { panic!("{error}") };
            let at = if let HexError::Digit { position } = reason { Some(*position) } else { None };
            assert_eq!(at, wrong, "{error}");
            let shown = format!("{error} {error:?}");
            assert!(shown.contains("robot.key") && !shown.to_lowercase().contains("5e5e"), "{shown}");
            fs::remove_file(&path).unwrap();
        }
    }
}
