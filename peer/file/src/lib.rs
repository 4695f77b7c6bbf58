//! Files that are written as a whole or not at all, by one at a time.
//!
//! ```
//! # let place = tempfile::tempdir()?;
//! let table = place.path().join("table.csv");
//! gestalt_file::check(&table)?; // before the hour of work whose results it is to hold
//! gestalt_file::write(&table, b"robots,right\n")?;
//! # Ok::<(), std::io::Error>(())
//! ```

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

/// How long a folder that others write to is waited for. Whoever may read a folder can lock it: nobody is kept from writing for longer than that.
const PATIENCE: Duration = Duration::from_secs(2);

/// How often a file that others hold is tried.
const PAUSE: Duration = Duration::from_millis(10);

/// How many links may lead to one another: as many as Linux follows.
const MAX_LINKS: usize = 40;

/// Puts a file in the place of what is there, so that whoever reads at any moment, or after a power cut, finds the one or the other as a whole.
/// A link stays, and what it leads to is replaced; what is no file, such as a pipe or a device, is written to.
///
/// Whoever may by the process's `umask` can read it.
///
/// # Errors
/// What the operating system objects to; what was there is left, and nothing beside it.
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    if is_stream(path) { fs::write(path, bytes) } else { put(path, bytes, 0o666) }
}

/// As [`write`], of a file of the program's own: also what is no file is replaced, as writing to a pipe would wait for its reader.
///
/// # Errors
/// As [`write`].
pub fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    put(path, bytes, 0o666)
}

/// As [`replace`], of a file that its owner alone can read.
///
/// # Errors
/// As [`write`].
pub fn replace_secret(path: &Path, bytes: &[u8]) -> io::Result<()> {
    put(path, bytes, 0o600)
}

/// Makes a file that its owner alone can read, as a whole or not at all, where nothing of that name is.
///
/// # Errors
/// [`io::ErrorKind::AlreadyExists`], and what else the operating system objects to; nothing is left then.
pub fn new_secret(path: &Path, bytes: &[u8]) -> io::Result<()> {
    beside(path, bytes, 0o600)?.persist_noclobber(path).map_err(|refused| refused.error)?;
    keep_name(path).inspect_err(|_| drop(fs::remove_file(path)))
}

/// Finds out whether [`write`] can succeed, before the work is done whose results are to be written. Leaves everything as it was.
///
/// # Errors
/// What the operating system objects to.
pub fn check(path: &Path) -> io::Result<()> {
    if path.is_dir() {
        return Err(io::Error::other("it is a folder"));
    }
    // Opening a pipe would wait for its reader.
    if is_stream(path) {
        return Ok(());
    }
    target(path).and_then(|path| tempfile::tempfile_in(folder(&path))).map(drop)
}

/// The folder that a file is in, whose name may be all that the path says.
#[must_use]
pub fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Opens a file to read. A pipe would keep whoever opens it waiting for its writer, and a device has no end.
///
/// # Errors
/// What the operating system objects to, and what is no regular file.
pub fn open(path: &Path) -> io::Result<fs::File> {
    if !fs::metadata(path)?.is_file() {
        return Err(io::Error::other("it is not a regular file"));
    }
    fs::File::open(path)
}

/// Sees to it that a power cut does not take the names of files in the folder of this one back to what they were.
///
/// # Errors
/// What the operating system objects to.
pub fn keep_name(path: &Path) -> io::Result<()> {
    #[cfg(unix)]
    fs::File::open(folder(path))?.sync_all()?;
    Ok(())
}

/// Keeps others that ask for the same from the files of that one's folder, until what is returned is dropped. `None` where files cannot be locked, or when
/// somebody keeps the lock for two seconds: then nothing but the order of two writers at the same moment is left to chance.
#[must_use]
pub fn lock(path: &Path) -> Option<fs::File> {
    let folder = fs::File::open(folder(path)).ok()?;
    matches!(hold(&folder, PATIENCE), Ok(true)).then_some(folder)
}

/// Keeps others that ask for the same from an open file, until it is dropped; `false` where files cannot be locked.
///
/// # Errors
/// [`io::ErrorKind::WouldBlock`] when somebody else has kept it for so long.
pub fn hold(file: &fs::File, patience: Duration) -> io::Result<bool> {
    let began = Instant::now();
    loop {
        match file.try_lock() {
            Ok(()) => return Ok(true),
            Err(fs::TryLockError::Error(_)) => return Ok(false),
            Err(held) if began.elapsed() >= patience => return Err(held.into()),
            Err(fs::TryLockError::WouldBlock) => thread::sleep(PAUSE),
        }
    }
}

fn put(path: &Path, bytes: &[u8], mode: u32) -> io::Result<()> {
    let path = target(path)?;
    beside(&path, bytes, mode)?.persist(&path).map_err(|refused| refused.error)?;
    keep_name(&path)
}

/// All of that on the disk, in a file beside the one that it is to become.
fn beside(path: &Path, bytes: &[u8], mode: u32) -> io::Result<tempfile::NamedTempFile> {
    let mut beside = tempfile::Builder::new();
    #[cfg(unix)]
    beside.permissions(std::os::unix::fs::PermissionsExt::from_mode(mode));
    let mut file = beside.tempfile_in(folder(path))?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    Ok(file)
}

/// Whether something is there that is written to, not replaced.
fn is_stream(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|there| !there.is_file() && !there.is_dir())
}

/// Where a link leads, through others, though nothing is there; of what is no link, its own path.
///
/// # Errors
/// Links that lead in a circle.
pub fn target(path: &Path) -> io::Result<PathBuf> {
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
    fn a_file_is_replaced_as_a_whole_and_leaves_nothing_beside_it() {
        let place = tempfile::tempdir().unwrap();
        let [path, taken] = ["file", "taken"].map(|name| place.path().join(name));
        fs::create_dir(&taken).unwrap();
        for text in ["one", "two"] {
            check(&path).unwrap();
            write(&path, text.as_bytes()).unwrap();
            assert_eq!(fs::read_to_string(&path).unwrap(), text);
        }
        for refused in [taken, place.path().join("no/file")] {
            assert!(check(&refused).is_err() && write(&refused, b"x").is_err(), "{refused:?}");
        }
        assert_eq!(fs::read_dir(place.path()).unwrap().count(), 2);
    }

    #[test]
    fn asking_leaves_everything_as_it_was() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("file");
        check(&path).unwrap();
        assert_eq!(fs::read_dir(place.path()).unwrap().count(), 0);
        write(&path, b"mine").unwrap();
        check(&path).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"mine");
    }

    #[test]
    fn who_keeps_the_lock_keeps_nobody_from_writing_for_long() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("roster.json");
        let kept = lock(&path);
        assert!(kept.is_some() && lock(&path).is_none());
        drop(kept);
        assert!(lock(&path).is_some());
    }

    #[test]
    fn a_full_disk_is_named_as_such() {
        if Path::new("/dev/full").exists() {
            assert_eq!(write(Path::new("/dev/full"), b"x").unwrap_err().kind(), io::ErrorKind::StorageFull);
        }
    }

    #[test]
    fn a_file_that_is_named_alone_lies_where_one_is() {
        assert_eq!(folder(Path::new("roster")), Path::new("."));
        assert_eq!(folder(Path::new("keys/roster")), Path::new("keys"));
    }

    #[cfg(unix)]
    #[test]
    fn a_secret_is_its_owners_alone_also_where_there_was_none_before() {
        use std::os::unix::fs::PermissionsExt;

        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("key");
        let mode = || fs::metadata(&path).unwrap().permissions().mode() & 0o777;
        write(&path, b"for all").unwrap();
        assert_ne!(mode() & 0o400, 0);
        replace_secret(&path, b"mine").unwrap();
        assert_eq!(mode(), 0o600);
        assert_eq!(new_secret(&path, b"new").unwrap_err().kind(), io::ErrorKind::AlreadyExists);
        assert_eq!(fs::read(&path).unwrap(), b"mine");
        fs::remove_file(&path).unwrap();
        new_secret(&path, b"new").unwrap();
        assert_eq!((mode(), fs::read_dir(place.path()).unwrap().count()), (0o600, 1));
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_and_what_it_leads_to_is_replaced() {
        use std::os::unix::fs::symlink;

        let place = tempfile::tempdir().unwrap();
        let [old, kept, first, second, round] =
            ["old", "kept", "first", "second", "round"].map(|name| place.path().join(name));
        symlink("second", &first).unwrap();
        symlink("old", &second).unwrap();
        symlink("round", &round).unwrap();
        assert!(check(&round).is_err() && write(&round, b"x").is_err());
        // What a link leads to need not be there.
        assert_eq!(target(&first).unwrap(), old);
        check(&first).unwrap();
        write(&first, b"old").unwrap();
        fs::hard_link(&old, &kept).unwrap();
        write(&first, b"new").unwrap();
        assert!(fs::symlink_metadata(&first).unwrap().is_symlink());
        assert!(fs::symlink_metadata(&second).unwrap().is_symlink());
        assert_eq!((fs::read(&old).unwrap(), fs::read(&kept).unwrap()), (b"new".to_vec(), b"old".to_vec()));
    }

    #[cfg(unix)]
    #[test]
    fn nobody_waits_for_who_reads_a_pipe() {
        let place = tempfile::tempdir().unwrap();
        let pipe = place.path().join("pipe");
        if std::process::Command::new("mkfifo").arg(&pipe).status().is_ok_and(|made| made.success()) {
            check(&pipe).unwrap();
            assert!(is_stream(&pipe));
            replace(&pipe, b"state").unwrap();
            assert_eq!(fs::read(&pipe).unwrap(), b"state");
        }
    }
}
