//! A file that is written whole or not at all, by however many at once: robots of one computer may share a folder.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

/// How often a folder that others write to is tried, and how long each time is waited. Whoever may read a folder can lock it: nobody is kept from
/// writing for longer than that.
const TRIES: usize = 200;
const PAUSE: Duration = Duration::from_millis(10);

/// Puts a file in the place of what is there: whoever reads meanwhile, or after a power cut, finds the whole old one or the whole new one.
///
/// # Errors
/// Those of the file system; what was there is left, and nothing beside it.
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    put(path, bytes, &mut OpenOptions::new())
}

/// The same, of a file that its owner alone can read.
///
/// # Errors
/// As [`write`].
pub fn write_secret(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut options = OpenOptions::new();
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    put(path, bytes, &mut options)
}

fn put(path: &Path, bytes: &[u8], options: &mut OpenOptions) -> io::Result<()> {
    let (beside, mut file) = create_beside(path, options)?;
    let written = file.write_all(bytes).and_then(|()| file.sync_all());
    drop(file);
    written.and_then(|()| fs::rename(&beside, path)).inspect_err(|_| {
        let _ = fs::remove_file(&beside);
    })?;
    // Without this, a power cut soon after could bring the old one back.
    #[cfg(unix)]
    File::open(folder_of(path))?.sync_all()?;
    Ok(())
}

/// Keeps others that ask for the same from writing beside that file, until what is returned is dropped. `None` where files cannot be locked, or when
/// somebody keeps the lock: then nothing but the order of two writers at the same moment is left to chance.
pub(crate) fn lock(path: &Path) -> Option<File> {
    let folder = File::open(folder_of(path)).ok()?;
    for _ in 0..TRIES {
        match folder.try_lock() {
            Ok(()) => return Some(folder),
            Err(fs::TryLockError::WouldBlock) => thread::sleep(PAUSE),
            Err(fs::TryLockError::Error(_)) => return None,
        }
    }
    None
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// A new file of a name that nobody else has: what another one is writing, or was when the power went, is left alone.
fn create_beside(path: &Path, options: &mut OpenOptions) -> io::Result<(PathBuf, File)> {
    static COUNT: AtomicUsize = AtomicUsize::new(0);
    loop {
        let mut beside = path.as_os_str().to_owned();
        beside.push(format!(".{}-{}.new", process::id(), COUNT.fetch_add(1, Ordering::Relaxed)));
        match options.write(true).create_new(true).open(&beside) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            opened => return opened.map(|file| (beside.into(), file)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_written_leaves_nothing_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let taken = folder.path().join("taken");
        fs::create_dir(&taken).unwrap();
        assert!(write(&taken, b"x").is_err(), "a folder of that name");
        assert!(write(&folder.path().join("no/file"), b"x").is_err());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_name_that_is_taken_is_passed_over() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        for count in 0..300 {
            fs::write(format!("{}.{}-{count}.new", path.display(), process::id()), b"of somebody else")
                .unwrap();
        }
        write(&path, b"whole").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"whole");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 301);
    }

    #[test]
    fn a_file_that_is_named_alone_lies_where_one_is() {
        assert_eq!(folder_of(Path::new("roster")), Path::new("."));
        assert_eq!(folder_of(Path::new("keys/roster")), Path::new("keys"));
    }

    #[test]
    fn who_keeps_the_lock_keeps_nobody_from_writing_for_long() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let kept = lock(&path);
        assert!(kept.is_some() && lock(&path).is_none());
        drop(kept);
        assert!(lock(&path).is_some());
    }
}
