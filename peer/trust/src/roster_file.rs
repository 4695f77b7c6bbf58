//! A roster on disk.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::roster::{MAX_ROSTER, Roster};
use crate::roster_error::RosterError;
use crate::scheme::Scheme;

impl<S: Scheme> Roster<S> {
    /// Reads and checks a roster file.
    ///
    /// # Errors
    /// [`RosterError::File`]; [`RosterError::Contents`] for those of [`Roster::parse`].
    pub fn read(path: &Path) -> Result<Self, RosterError> {
        let unreadable = |source| RosterError::File { path: path.to_owned(), verb: "read", source };
        let file = File::open(path).map_err(unreadable)?;
        let mut json = Vec::new();
        file.take(MAX_ROSTER as u64 + 1).read_to_end(&mut json).map_err(unreadable)?;
        Self::parse(&json)
            .map_err(|cause| RosterError::Contents { path: path.to_owned(), cause: Box::new(cause) })
    }

    /// Writes a roster file in place of the one that is there: whoever reads meanwhile, or after a power cut, finds the whole old
    /// one or the whole new one. A newer one of the same swarm stays: robots that share a folder are told at different times.
    ///
    /// # Errors
    /// [`RosterError::File`]; [`RosterError::Older`] and [`RosterError::Contradiction`] say that the one that is there stays.
    pub fn write(&self, path: &Path) -> Result<(), RosterError> {
        let _alone = gestalt_file::lock(path);
        // What is no roster, or one of another swarm, keeps nobody from writing this one.
        if let Ok(there) = Self::read(path) {
            match there.is_succeeded_by(self) {
                Ok(true) | Err(RosterError::OtherSwarm) => {}
                Ok(false) => return Ok(()),
                Err(stays) => return Err(stays),
            }
        }
        gestalt_file::replace(path, self.to_json().as_bytes()).map_err(|source| RosterError::File {
            path: path.to_owned(),
            verb: "written",
            source,
        })
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::{fs, thread};

    use super::*;
    use crate::testing::{authority, members, robot, roster};

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
    fn robots_that_share_a_folder_keep_the_newest_roster_and_read_no_other_than_whole_ones() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("roster.json");
        roster(1).write(&path).unwrap();
        let (path, over) = (path.as_path(), &AtomicBool::new(false));
        thread::scope(|scope| {
            let reads = scope.spawn(move || {
                let mut newest = 0;
                while !over.load(Ordering::Relaxed) {
                    let epoch = Roster::<crate::Ed25519>::read(path).unwrap().members().epoch;
                    assert!(epoch >= newest, "back from {newest} to {epoch}");
                    newest = epoch;
                }
                newest
            });
            let writers: Vec<_> = (0..8)
                .map(|writer| {
                    scope.spawn(move || {
                        for epoch in (2..=100).filter(|epoch| epoch % 8 == writer) {
                            match roster(epoch).write(path) {
                                Ok(()) | Err(RosterError::Older { .. }) => {}
                                Err(error) => panic!("{error}"),
                            }
                        }
                    })
                })
                .collect();
            let failed = writers.into_iter().filter_map(|writer| writer.join().err()).count();
            over.store(true, Ordering::Relaxed);
            assert_eq!((failed, reads.join().is_ok()), (0, true));
        });
        assert_eq!(Roster::<crate::Ed25519>::read(path).unwrap(), roster(100));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left beside it");
    }

    #[test]
    fn a_newer_roster_stays_and_one_of_another_swarm_does_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("roster.json");
        roster(5).write(&path).unwrap();
        roster(5).write(&path).unwrap();
        let older = roster(4).write(&path).unwrap_err();
        assert!(matches!(older, RosterError::Older { held: 5, offered: 4 }), "{older}");
        let mut other = members(5);
        other.robots.insert(gestalt_protocol::RobotId(9), robot(9).public_key());
        let other = other.sign(&authority()).unwrap().write(&path).unwrap_err();
        assert!(matches!(other, RosterError::Contradiction { epoch: 5 }), "{other}");
        assert_eq!(Roster::<crate::Ed25519>::read(&path).unwrap(), roster(5));

        let mut elsewhere = members(1);
        elsewhere.swarm = "elsewhere".to_owned();
        let elsewhere = elsewhere.sign(&authority()).unwrap();
        elsewhere.write(&path).unwrap();
        assert_eq!(Roster::<crate::Ed25519>::read(&path).unwrap(), elsewhere);
        fs::write(&path, "half a ros").unwrap();
        roster(1).write(&path).unwrap();
        assert_eq!(Roster::<crate::Ed25519>::read(&path).unwrap(), roster(1));
    }

    #[test]
    fn a_file_that_is_no_roster_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("roster.json");
        let error = Roster::<crate::Ed25519>::read(&missing).unwrap_err();
        assert!(matches!(error, RosterError::File { verb: "read", .. }), "{error}");
        let error = roster(1).write(&folder.path().join("no/roster.json")).unwrap_err();
        assert!(matches!(error, RosterError::File { verb: "written", .. }), "{error}");
        assert!(error.to_string().contains("No such file"), "the system's reason: {error}");
        fs::write(&missing, vec![b' '; MAX_ROSTER + 1]).unwrap();
        let error = Roster::<crate::Ed25519>::read(&missing).unwrap_err();
        let RosterError::Contents { path, cause } = error else { panic!("{error}") };
        assert!(path == missing && matches!(*cause, RosterError::TooLong { .. }), "{cause}");
    }
}
