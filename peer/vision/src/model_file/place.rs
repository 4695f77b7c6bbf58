//! Where a file is written that takes another's place: at the end of links, which stay.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// How many links may lead to one another: as many as Linux follows.
const MAX_LINKS: usize = 40;

/// Whether a device or a pipe is there: that is written to, not replaced.
pub(super) fn is_stream(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|there| !there.is_file() && !there.is_dir())
}

/// The folder a file is in: a rename within one folder is atomic.
pub(super) fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Where a link leads, through others, though nothing is there; of what is no link, its own path.
pub(super) fn target(path: &Path) -> io::Result<PathBuf> {
    let mut here = path.to_owned();
    for _ in 0..=MAX_LINKS {
        match fs::read_link(&here) {
            Ok(next) => here = folder(&here).join(next),
            Err(_) => return Ok(here),
        }
    }
    Err(io::Error::other("its links lead in a circle"))
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn links_lead_to_what_need_not_be_there_but_in_no_circle() {
        let folder = tempfile::tempdir().unwrap();
        let [first, second, round] = ["first", "second", "round"].map(|name| folder.path().join(name));
        symlink("second", &first).unwrap();
        symlink("no/model", &second).unwrap();
        symlink("round", &round).unwrap();
        assert_eq!(target(&first).unwrap(), folder.path().join("no/model"));
        assert_eq!(target(folder.path()).unwrap(), folder.path());
        assert!(target(&round).is_err());
        assert!(!is_stream(&first) && !is_stream(folder.path()));
        assert_eq!(is_stream(Path::new("/dev/null")), Path::new("/dev/null").exists());
    }
}
