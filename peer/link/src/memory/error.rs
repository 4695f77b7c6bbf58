//! Why a memory cannot be opened, read or written.

use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use gestalt_protocol::RobotId;
use gestalt_strategies::MemoryError;
use thiserror::Error;

/// Why a memory cannot be opened, read or written. Nothing that was written before is changed by it.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StoreError {
    /// The folder is not there: most often a disk that is not mounted yet.
    #[error("memory {0}: its folder is not there: mount the disk or make the folder; it is tried again")]
    NoFolder(PathBuf),
    /// No room on the disk.
    #[error("memory {0}: the disk is full: make room; it is tried again")]
    Full(PathBuf),
    /// No right to write.
    #[error(
        "memory {path}: cannot be written: {cause}: mount the disk for writing and let the robot's user write; it is tried again"
    )]
    ReadOnly {
        /// Which file.
        path: PathBuf,
        /// What the system says.
        cause: String,
    },
    /// No right to read.
    #[error(
        "memory {path}: cannot be read: {cause}: let the robot's user read and write it; it is tried again"
    )]
    Unreadable {
        /// Which file.
        path: PathBuf,
        /// What the system says.
        cause: String,
    },
    /// The disk fails otherwise.
    #[error(
        "memory {path}: the disk fails: {cause}: check the disk, or give the robot another file; it is tried again"
    )]
    Disk {
        /// Which file.
        path: PathBuf,
        /// What the system or the database says.
        cause: String,
    },
    /// The file was there, and went while the robot ran.
    #[error("memory {0}: removed while running; all that the robot knows is written anew")]
    Removed(PathBuf),
    /// The file was there, and another took its place while the robot ran.
    #[error(
        "memory {0}: another file took its place while running (a disk mounted over it?); nothing is remembered: restart the robot to take that file up, or remove it to have all written anew"
    )]
    Replaced(PathBuf),
    /// Another process has it open.
    #[error("memory {0} is in use by another process: give each robot a file of its own")]
    InUse(PathBuf),
    /// Written by another release.
    #[error(
        "memory {path} has schema {found}, this release reads {expected}: move the file away, or run the release that wrote it"
    )]
    Schema {
        /// Which file.
        path: PathBuf,
        /// The schema found.
        found: u64,
        /// The schema this release reads.
        expected: u64,
    },
    /// Another robot's.
    #[error("memory {path} is robot {found}'s, this is robot {expected}: give each robot a file of its own")]
    Robot {
        /// Which file.
        path: PathBuf,
        /// Whose it is.
        found: u64,
        /// Who opened it.
        expected: RobotId,
    },
    /// No robot's memory: another program's file.
    #[error("{0} is no robot's memory: give the robot another file, or move this one away")]
    Foreign(PathBuf),
    /// Bytes of it are not those that were written.
    #[error("memory {path} is damaged: {cause}: restore a copy, or move the file away to begin a new memory")]
    Damaged {
        /// Which file.
        path: PathBuf,
        /// What does not fit.
        cause: String,
    },
    /// A sound memory, but not of what this robot learns.
    #[error("memory {path}: {cause}")]
    Content {
        /// Which file.
        path: PathBuf,
        /// What is wrong.
        cause: MemoryError,
    },
}

impl StoreError {
    /// Whether the disk is at fault, and not what stands on it: a robot starts without, says so, and goes on trying.
    #[must_use]
    pub fn is_of_the_disk(&self) -> bool {
        use StoreError::{Disk, Full, NoFolder, ReadOnly, Unreadable};
        matches!(self, NoFolder(_) | Full(_) | ReadOnly { .. } | Unreadable { .. } | Disk { .. })
    }

    /// What the operating system's refusal means.
    pub(super) fn of_system(path: &Path, cause: &io::Error) -> Self {
        let path = path.to_owned();
        match cause.kind() {
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded => Self::Full(path),
            ErrorKind::ReadOnlyFilesystem | ErrorKind::PermissionDenied => {
                Self::ReadOnly { path, cause: cause.to_string() }
            }
            ErrorKind::NotFound | ErrorKind::NotADirectory => Self::NoFolder(path),
            ErrorKind::UnexpectedEof | ErrorKind::InvalidData => {
                Self::Damaged { path, cause: cause.to_string() }
            }
            _ => Self::Disk { path, cause: cause.to_string() },
        }
    }

    /// What the operating system's refusal means where a file is read alone.
    pub(super) fn of_reading(path: &Path, cause: &io::Error) -> Self {
        match Self::of_system(path, cause) {
            Self::ReadOnly { path, cause } => Self::Unreadable { path, cause },
            other => other,
        }
    }

    /// What the database's refusal means.
    pub(super) fn of_database(path: &Path, cause: redb::Error) -> Self {
        use redb::Error::{
            Corrupted, DatabaseAlreadyOpen, Io, TableDoesNotExist, TableIsMultimap, TableIsNotMultimap,
            TableTypeMismatch, TypeDefinitionChanged, UpgradeRequired,
        };
        match cause {
            Io(cause) => Self::of_system(path, &cause),
            DatabaseAlreadyOpen => Self::InUse(path.to_owned()),
            Corrupted(_)
            // No robot ever wrote the older format that this asks to be brought up to date.
            | UpgradeRequired(_)
            | TableTypeMismatch { .. }
            | TableIsMultimap(_)
            | TableIsNotMultimap(_)
            | TypeDefinitionChanged { .. }
            | TableDoesNotExist(_) => Self::damaged(path, cause.to_string()),
            other => Self::Disk { path: path.to_owned(), cause: other.to_string() },
        }
    }

    pub(super) fn damaged(path: &Path, cause: impl Into<String>) -> Self {
        Self::Damaged { path: path.to_owned(), cause: cause.into() }
    }
}
