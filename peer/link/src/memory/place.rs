//! Where a memory lies: a file that appears whole or not at all. A trait, so that a test can be a disk that fails.

use std::fmt::Debug;
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Read};
use std::path::{Path, PathBuf};

use redb::backends::FileBackend;

use super::bytes::Bytes;
use super::error::StoreError;

/// The longest file that is copied into this process's memory, in bytes: many times what a robot knows at most.
const MAX_COPY: u64 = 1 << 28;

/// Fills the bytes of a new memory, and has them on the disk when it returns.
pub(crate) type Fill<'a> = &'a dyn Fn(Bytes) -> Result<(), StoreError>;

/// Where a memory lies.
pub(crate) trait Place: Debug + Send + Sync {
    /// Its name for people.
    fn path(&self) -> &Path;

    /// Whether a file is there.
    fn is_there(&self) -> io::Result<bool>;

    /// Opens the file that is there, and says which it is.
    fn open(&self) -> io::Result<(Bytes, FileId)>;

    /// A copy of the file that is there, in this process's memory: for a disk that cannot be written, and for trying what is to stay as it is.
    fn copy(&self) -> io::Result<(Bytes, FileId)>;

    /// Makes a file that `fill` has filled: until it is complete and on the disk, none is there. One that appears
    /// meanwhile stays.
    fn make(&self, fill: Fill<'_>) -> Result<(), StoreError>;

    /// Which file is there now; `None` when there is none.
    fn present(&self) -> io::Result<Option<FileId>>;
}

/// Tells a file from another of the same name: device and number on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FileId(pub u64, pub u64);

/// A file of a file system.
#[derive(Debug)]
pub(crate) struct FilePlace(PathBuf);

impl FilePlace {
    pub fn new(path: PathBuf) -> Self {
        Self(path)
    }

    fn make_draft(&self, end: &Path, draft: &Path, fill: Fill<'_>) -> Result<(), StoreError> {
        let system = |cause: io::Error| StoreError::of_system(&self.0, &cause);
        match fs::remove_file(draft) {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(system(error)),
            // What a power cut left half-filled is nobody's.
            _ => {}
        }
        let file = OpenOptions::new().read(true).write(true).create_new(true).open(draft).map_err(system)?;
        let bytes = FileBackend::new(file)
            .map_err(|error| StoreError::of_database(&self.0, redb::Error::from(error)))?;
        fill(Bytes::new(bytes))?;
        File::open(draft).and_then(|file| file.sync_all()).map_err(system)?;
        // Unlike a renaming, a second name never takes the place of a file that has appeared meanwhile.
        match fs::hard_link(draft, end) {
            Ok(()) => {}
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            // A file system without second names, such as FAT.
            Err(_) => fs::rename(draft, end).map_err(system)?,
        }
        gestalt_file::keep_name(end).map_err(system)
    }
}

impl Place for FilePlace {
    fn path(&self) -> &Path {
        &self.0
    }

    fn is_there(&self) -> io::Result<bool> {
        self.0.try_exists()
    }

    fn open(&self) -> io::Result<(Bytes, FileId)> {
        let file = OpenOptions::new().read(true).write(true).open(&self.0)?;
        let id = file_id(&file.metadata()?);
        let bytes = FileBackend::new(file).map_err(io::Error::other)?;
        Ok((Bytes::new(bytes), id))
    }

    fn copy(&self) -> io::Result<(Bytes, FileId)> {
        // What is no file, such as a pipe, could keep whoever reads it waiting.
        if !fs::metadata(&self.0)?.is_file() {
            return Err(io::Error::other("it is no file"));
        }
        let file = File::open(&self.0)?;
        let id = file_id(&file.metadata()?);
        let mut bytes = Vec::new();
        file.take(MAX_COPY + 1).read_to_end(&mut bytes)?;
        if bytes.len() as u64 > MAX_COPY {
            return Err(io::Error::other(format!("it has more than {} MB", MAX_COPY >> 20)));
        }
        Ok((Bytes::in_memory(&bytes)?, id))
    }

    fn make(&self, fill: Fill<'_>) -> Result<(), StoreError> {
        // Of a link that leads to no file yet, the file is made where it leads.
        let end = gestalt_file::target(&self.0).map_err(|cause| StoreError::of_system(&self.0, &cause))?;
        let draft = draft(&end);
        let made = self.make_draft(&end, &draft, fill);
        // Gone already where it was renamed; what a full disk holds back is removed at the next attempt.
        let _ = fs::remove_file(&draft);
        made
    }

    fn present(&self) -> io::Result<Option<FileId>> {
        match fs::metadata(&self.0) {
            Ok(metadata) => Ok(Some(file_id(&metadata))),
            Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => Ok(None),
            Err(error) => Err(error),
        }
    }
}

/// Where a new memory is filled, before it has its name.
fn draft(end: &Path) -> PathBuf {
    let mut name = end.to_owned().into_os_string();
    name.push(".new");
    PathBuf::from(name)
}

#[cfg(unix)]
fn file_id(metadata: &fs::Metadata) -> FileId {
    use std::os::unix::fs::MetadataExt;
    FileId(metadata.dev(), metadata.ino())
}

/// Other systems do not let an open file be removed.
#[cfg(not(unix))]
fn file_id(_: &fs::Metadata) -> FileId {
    FileId(0, 0)
}
