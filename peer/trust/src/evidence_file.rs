//! Evidence on disk, so that whoever starts again knows who lied: one file for each robot that was convicted.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use gestalt_protocol::RobotId;

use crate::docket::KEPT_BYTES;
use crate::evidence::Evidence;

const EXTENSION: &str = "evidence";

/// How much of a file shows that it is too long to be evidence.
const TOO_LONG: u64 = Evidence::MAX_LENGTH as u64 + 1;

/// What was in a folder of evidence.
#[derive(Debug, Default)]
pub struct KeptEvidence {
    /// What could be read, by the names of the files.
    pub evidence: Vec<Evidence>,
    /// What could not be read, as the system did not let it be or as it is no evidence, and what there was too much of, with the reason.
    pub unread: Vec<(PathBuf, io::Error)>,
}

impl Evidence {
    /// Keeps evidence against that robot in a folder, which is made if there is none, in place of other evidence against it: whoever reads meanwhile, or
    /// after a power cut, finds the whole old one or the whole new one.
    ///
    /// # Errors
    /// Those of the file system.
    pub fn keep(&self, folder: &Path, against: RobotId) -> io::Result<()> {
        fs::create_dir_all(folder)?;
        let path = folder.join(format!("robot-{against}.{EXTENSION}"));
        gestalt_file::replace(&path, &self.encode())
    }

    /// All evidence in that folder, none if there is no such folder; at most 16 MiB of it. What it proves today is found by [`Evidence::check`]: nothing against
    /// whoever has a new key. What cannot be read, or read as evidence, is passed over and named, with its reason, as is what is beyond the 16 MiB.
    ///
    /// # Errors
    /// Those of the file system, where the folder cannot be read.
    pub fn kept_in(folder: &Path) -> io::Result<KeptEvidence> {
        let entries = match fs::read_dir(folder) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(KeptEvidence::default()),
            entries => entries?,
        };
        let mut paths = entries.map(|entry| Ok(entry?.path())).collect::<io::Result<Vec<_>>>()?;
        paths.retain(|path| path.extension().is_some_and(|extension| extension == EXTENSION));
        paths.sort();
        let (mut kept, mut bytes) = (KeptEvidence::default(), 0);
        for path in paths {
            let read = match read(&path) {
                Ok(read) => read,
                Err(error) => {
                    kept.unread.push((path, error));
                    continue;
                }
            };
            bytes += read.len();
            if bytes > KEPT_BYTES {
                let much =
                    "the evidence before it in that folder takes 16 MiB: move away what is no longer needed";
                kept.unread.push((path, io::Error::other(much)));
                break;
            }
            match Self::decode(&read) {
                Ok(evidence) => kept.evidence.push(evidence),
                Err(error) => kept.unread.push((path, io::Error::other(error))),
            }
        }
        Ok(kept)
    }
}

/// As much of a file as may be evidence. A pipe would keep whoever opens it waiting.
fn read(path: &Path) -> io::Result<Vec<u8>> {
    if !fs::metadata(path)?.is_file() {
        return Err(io::Error::other("it is no file"));
    }
    let mut read = Vec::new();
    File::open(path)?.take(TOO_LONG).read_to_end(&mut read)?;
    Ok(read)
}

#[cfg(test)]
mod tests {
    use std::thread;
    use std::time::Duration;

    use super::*;
    use crate::judge::Judge;
    use crate::statement;
    use crate::testing::{authority, members, robot, roster, vote};
    use crate::witness::Witness;

    fn evidence(against: u32) -> Evidence {
        let mut witness = Witness::new(&roster(5));
        let both = [vote(against, 1, 1.0), vote(against, 1, -1.0)];
        let sign = |said: &Vec<u8>| statement::sign(&robot(against), &roster(5).swarm_id(), said);
        let found = both.each_ref().map(|said| witness.observe(said, &sign(said)));
        found.into_iter().flatten().next().expect("two things")
    }

    fn kept_in(folder: &Path) -> Vec<Evidence> {
        let (kept, unread) = kept_and_unread(folder);
        assert!(unread.is_empty(), "{unread:?}");
        kept
    }

    /// And the names of the files that are named.
    fn kept_and_unread(folder: &Path) -> (Vec<Evidence>, Vec<String>) {
        let KeptEvidence { evidence: kept, unread } = Evidence::kept_in(folder).unwrap();
        let name = |(path, _): &(PathBuf, io::Error)| path.file_name().unwrap().to_str().unwrap().to_owned();
        (kept, unread.iter().map(name).collect())
    }

    #[test]
    fn who_starts_again_knows_who_lied() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("convicted");
        assert_eq!(kept_in(&place), [], "nobody was yet");
        let mut before = Judge::new(roster(5), |_| false);
        for robot in [1, 2] {
            before.evidence(Duration::ZERO, evidence(robot)).unwrap();
            before.evidence(Duration::ZERO, evidence(robot)).unwrap();
        }
        let unkept = before.unkept();
        assert_eq!(unkept.iter().map(|(robot, _)| robot.0).collect::<Vec<_>>(), [1, 2]);
        assert_eq!(before.unkept(), [], "once each");
        for (robot, evidence) in unkept {
            evidence.keep(&place, robot).unwrap();
            evidence.keep(&place, robot).unwrap();
        }
        assert_eq!(fs::read_dir(&place).unwrap().count(), 2, "nothing is left beside them");

        let again = |roster| {
            let mut judge = Judge::new(roster, |_| false);
            for evidence in kept_in(&place) {
                // It proves nothing against a new key.
                let _ = judge.evidence(Duration::ZERO, evidence);
            }
            judge
        };
        let after = again(roster(5));
        assert!(after.convicts(RobotId(1)) && after.convicts(RobotId(2)) && !after.convicts(RobotId(3)));
        let mut renewed = members(6);
        renewed.robots.insert(RobotId(1), robot(11).public_key());
        let after = again(renewed.sign(&authority()).unwrap());
        assert!(!after.convicts(RobotId(1)) && after.convicts(RobotId(2)));
    }

    #[test]
    fn robots_of_one_process_may_keep_the_same_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let (place, evidence) = (folder.path(), &evidence(1));
        thread::scope(|scope| {
            let writers =
                (0..8).map(|_| scope.spawn(|| (0..10).try_for_each(|_| evidence.keep(place, RobotId(1)))));
            for writer in writers.collect::<Vec<_>>() {
                writer.join().unwrap().unwrap();
            }
        });
        assert_eq!(kept_in(place), std::slice::from_ref(evidence));
        assert_eq!(fs::read_dir(place).unwrap().count(), 1, "nothing is left beside it");
    }

    #[test]
    fn what_is_no_evidence_is_passed_over_and_named_and_so_is_too_much() {
        let folder = tempfile::tempdir().unwrap();
        evidence(1).keep(folder.path(), RobotId(1)).unwrap();
        let whole = fs::read(folder.path().join("robot-1.evidence")).unwrap();
        fs::write(folder.path().join("robot-0.evidence"), &whole[..whole.len() / 2]).unwrap();
        fs::write(folder.path().join("robot-2.evidence"), vec![2; Evidence::MAX_LENGTH + 9]).unwrap();
        // Left by a power cut.
        fs::write(folder.path().join("robot-3.evidence.77-0.new"), &whole).unwrap();
        let none = ["robot-0.evidence", "robot-2.evidence"];
        assert_eq!(kept_and_unread(folder.path()), (vec![evidence(1)], none.map(str::to_owned).to_vec()));
        none.iter().for_each(|name| fs::remove_file(folder.path().join(name)).unwrap());
        let before = |name: &str, length| {
            fs::write(folder.path().join(format!("robot-0{name}.evidence")), vec![2; length]).unwrap();
        };
        let room = KEPT_BYTES - whole.len();
        (0..room / Evidence::MAX_LENGTH).for_each(|n| before(&n.to_string(), Evidence::MAX_LENGTH));
        before("rest", room % Evidence::MAX_LENGTH);
        assert_eq!(kept_and_unread(folder.path()).0, [evidence(1)], "16 MiB, with what comes before it");
        before("rest", room % Evidence::MAX_LENGTH + 1);
        let (kept, unread) = kept_and_unread(folder.path());
        assert_eq!(kept, [], "one byte more");
        assert_eq!(unread.last().map(String::as_str), Some("robot-1.evidence"));
        assert!(Evidence::kept_in(&folder.path().join("robot-1.evidence")).is_err(), "no folder");
    }

    #[test]
    fn what_cannot_be_read_is_named_and_takes_no_other_evidence_with_it() {
        let folder = tempfile::tempdir().unwrap();
        let unreadable = folder.path().join("robot-0.evidence");
        fs::create_dir(&unreadable).unwrap();
        evidence(1).keep(folder.path(), RobotId(1)).unwrap();
        let KeptEvidence { evidence: kept, unread } = Evidence::kept_in(folder.path()).unwrap();
        assert_eq!(kept, [evidence(1)]);
        assert_eq!(unread.into_iter().map(|(path, _)| path).collect::<Vec<_>>(), [unreadable]);
    }
}
