//! Why there is no drawing.

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

/// Why there is no drawing.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DrawError {
    /// A name that ends in neither `.svg` nor `.png`.
    #[error("the drawing {}: give it a name that ends in .svg or .png", .0.display())]
    Name(PathBuf),
    /// The folder it would go into does not exist.
    #[error("cannot write {}: its folder does not exist; make it with mkdir -p", .0.display())]
    NoFolder(PathBuf),
    /// The file or its folder may not be written.
    #[error("no permission to write {}: choose another folder, or grant it with chmod", .0.display())]
    Permission(PathBuf),
    /// The disk has no room left.
    #[error("cannot write {}: the disk is full; free some space or choose another folder", .0.display())]
    DiskFull(PathBuf),
    /// The drawing is no SVG that can be rendered.
    #[error("cannot draw: {0}")]
    Svg(String),
    /// Anything else the operating system objects to.
    #[error("cannot write {}: {cause}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: io::Error,
    },
}

impl DrawError {
    pub(crate) fn io(path: &Path, cause: io::Error) -> Self {
        match cause.kind() {
            io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
                Self::Permission(path.into())
            }
            io::ErrorKind::NotFound => Self::NoFolder(path.into()),
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => Self::DiskFull(path.into()),
            _ => Self::Write { path: path.into(), cause },
        }
    }
}
