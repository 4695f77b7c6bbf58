//! A roster on disk.

use std::fs::{self, File};
use std::io::{Read, Write};
use std::path::Path;

use crate::roster::{MAX_ROSTER, Roster};
use crate::roster_error::RosterError;
use crate::scheme::Scheme;

impl<S: Scheme> Roster<S> {
    /// Reads and checks a roster file.
    ///
    /// # Errors
    /// [`RosterError::File`], and those of [`Roster::parse`].
    pub fn read(path: &Path) -> Result<Self, RosterError> {
        let unreadable = |source| RosterError::File { path: path.to_owned(), verb: "read", source };
        let file = File::open(path).map_err(unreadable)?;
        let mut json = Vec::new();
        file.take(MAX_ROSTER as u64 + 1).read_to_end(&mut json).map_err(unreadable)?;
        Self::parse(&json)
    }

    /// Writes a roster file in place of the one that is there: whoever reads meanwhile, or after a power cut, finds the whole old
    /// one or the whole new one.
    ///
    /// # Errors
    /// [`RosterError::File`].
    pub fn write(&self, path: &Path) -> Result<(), RosterError> {
        let mut beside = path.as_os_str().to_owned();
        beside.push(".new");
        let written = File::create(&beside).and_then(|mut file| {
            file.write_all(self.to_json().as_bytes())?;
            file.sync_all()?;
            fs::rename(&beside, path)
        });
        written.map_err(|source| RosterError::File { path: path.to_owned(), verb: "written", source })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::roster;

    #[test]
    fn the_newest_roster_takes_the_place_of_the_old_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("roster.json");
        for epoch in 1..=2 {
            roster(epoch).write(&path).unwrap();
            let read: Roster = Roster::read(&path).unwrap();
            assert_eq!(read, roster(epoch));
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left beside it");
    }

    #[test]
    fn a_file_that_is_no_roster_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("roster.json");
        let error = Roster::<crate::Ed25519>::read(&missing).unwrap_err();
        assert!(matches!(error, RosterError::File { verb: "read", .. }), "{error}");
        let error = roster(1).write(&folder.path().join("no/roster.json")).unwrap_err();
        assert!(matches!(error, RosterError::File { verb: "written", .. }), "{error}");
        fs::write(&missing, vec![b' '; MAX_ROSTER + 1]).unwrap();
        let error = Roster::<crate::Ed25519>::read(&missing).unwrap_err();
        assert!(matches!(error, RosterError::TooLong { .. }), "{error}");
    }
}
