//! Whom a robot believes, as its configuration file says it.

use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use gestalt_link::{Bearer, Certificate, Credentials, LinkError, Seal, SealError, boot_number, counted_boot};
use gestalt_protocol::{InstructorId, RobotId};
use gestalt_trust::{FrameSigner, Identity, Roster};
use serde::{Deserialize, Serialize};

/// The roster in a folder of keys.
pub const ROSTER_FILE: &str = "roster.json";

/// A robot's key in a folder of keys.
#[must_use]
pub fn key_file(folder: &Path, robot: RobotId) -> PathBuf {
    folder.join(format!("robot-{robot}.key"))
}

/// A client's key in a folder of keys.
#[must_use]
pub fn client_key_file(folder: &Path, client: &InstructorId) -> PathBuf {
    folder.join(format!("client-{client}.key"))
}

/// The number of a robot's last start, beside its key.
fn starts_file(key: &Path) -> PathBuf {
    key.with_extension("starts")
}

/// The count of the last word that a client said with a key, beside it.
fn words_file(key: &Path) -> PathBuf {
    key.with_extension("words")
}

/// Among how many centres the numbers of a robot's starts are shared out.
const SHARES: u32 = 16;

/// The time whose [`boot_number`] that is.
fn time_of(boot: u32) -> SystemTime {
    const YEAR_2026: Duration = Duration::from_secs(1_767_225_600);
    UNIX_EPOCH + YEAR_2026 + Duration::from_millis(100) * boot
}

/// The certificate beside a key.
#[must_use]
pub fn certificate_file(key: &Path) -> PathBuf {
    key.with_extension("crt")
}

/// Whom a robot believes.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TrustSection {
    /// The folder with `roster.json`, this robot's `robot-<id>.key` and its certificate, as `gestalt trust` writes them. Without one the swarm is
    /// open: robots are who they say they are.
    pub keys: Option<PathBuf>,
    /// Lets an open robot listen beyond its own computer, where it believes whoever reaches it.
    pub insecure: bool,
}

impl TrustSection {
    /// What makes this robot one of a sealed swarm; `None` in an open one.
    ///
    /// # Errors
    /// [`LinkError::Config`] names the file, what is wrong with it, and the mend.
    pub fn seal(&self, robot: RobotId) -> Result<Option<Seal>, LinkError> {
        let Some(folder) = &self.keys else { return Ok(None) };
        let file = folder.join(ROSTER_FILE);
        let roster = Roster::read(&file).map_err(wrong)?;
        let key = key_file(folder, robot);
        let identity = Arc::new(Identity::read(&key).map_err(wrong)?);
        let certificate = Certificate::read(&certificate_file(&key)).map_err(wrong)?;
        Ok(Some(Seal { identity, certificate, roster, roster_file: Some(file) }))
    }

    /// The number of a start of this robot that happens now: see [`boot_number`] and, where it has a key, [`counted_boot`].
    #[must_use]
    pub fn boot(&self, robot: RobotId, now: SystemTime) -> u32 {
        match &self.keys {
            Some(folder) => counted_boot(&starts_file(&key_file(folder, robot)), now),
            None => boot_number(now),
        }
    }

    /// The number of a start of a robot that happens now at a centre that votes for it. Where it has a key, one number of every sixteen is that
    /// centre's: two centres that start it by one clock would say two things under one stamp, which convicts it for good.
    #[must_use]
    pub fn boot_at(&self, centre: RobotId, robot: RobotId, now: SystemTime) -> u32 {
        let counted = self.boot(robot, now);
        let ahead = (centre.0 % SHARES).wrapping_sub(counted) % SHARES;
        if self.keys.is_none() || ahead == 0 {
            return counted;
        }
        // Counted as if it were as late as that: it is kept, and the next one is higher.
        self.boot(robot, time_of(counted.saturating_add(ahead)))
    }

    /// The key of a robot that votes through another; `None` in an open swarm.
    ///
    /// # Errors
    /// [`LinkError::Config`] when it is not in the folder, or cannot be read.
    pub fn identity(&self, robot: RobotId) -> Result<Option<Arc<Identity>>, LinkError> {
        let Some(folder) = &self.keys else { return Ok(None) };
        Ok(Some(Arc::new(Identity::read(&key_file(folder, robot)).map_err(wrong)?)))
    }

    /// What signs the frames of a robot whose camera is here, and whose mind elsewhere; `None` in an open swarm.
    ///
    /// # Errors
    /// As [`TrustSection::seal`].
    pub fn frame_signer(&self, robot: RobotId) -> Result<Option<FrameSigner>, LinkError> {
        let Some(folder) = &self.keys else { return Ok(None) };
        let roster = Roster::read(&folder.join(ROSTER_FILE)).map_err(wrong)?;
        let identity = Arc::new(Identity::read(&key_file(folder, robot)).map_err(wrong)?);
        if roster.members().robots.get(&robot) != Some(&identity.public_key()) {
            return Err(wrong(SealError::NotEnrolled(robot)));
        }
        Ok(Some(FrameSigner::new(robot, identity, roster)))
    }

    /// The swarm of a client: that of its roster, if none is `named`; `None` where there is no roster.
    ///
    /// # Errors
    /// [`LinkError::Config`] for a roster that cannot be read, or is of another swarm than the one that is named.
    pub fn client_swarm(&self, named: Option<&str>) -> Result<Option<String>, LinkError> {
        let Some(folder) = &self.keys else { return Ok(None) };
        let file = folder.join(ROSTER_FILE);
        let roster: Roster = Roster::read(&file).map_err(wrong)?;
        let of = &roster.members().swarm;
        match named.filter(|named| named != of) {
            None => Ok(Some(of.clone())),
            Some(named) => Err(wrong(format_args!(
                "{} is of the swarm \"{of}\", and not of \"{named}\": write --swarm {of}, or --keys with the folder of \"{named}\"",
                file.display()
            ))),
        }
    }

    /// What a program shows to be let in that is no robot: the one client's key in the folder, or else this robot's own.
    ///
    /// # Errors
    /// As [`TrustSection::seal`].
    pub fn credentials(&self, robot: RobotId) -> Result<Option<Credentials>, LinkError> {
        let Some(folder) = &self.keys else { return Ok(None) };
        let roster = Roster::read(&folder.join(ROSTER_FILE)).map_err(wrong)?;
        let clients = roster.members().instructors.keys();
        let mut clients = clients.filter(|name| client_key_file(folder, name).exists());
        let (holder, key) = match (clients.next(), clients.next()) {
            (Some(one), None) => (Bearer::Client(one.clone()), client_key_file(folder, one)),
            (Some(one), Some(other)) if !key_file(folder, robot).exists() => {
                let folder = folder.display();
                return Err(wrong(format_args!(
                    "{folder} has the keys of the clients {one} and {other}: name a folder with one of them"
                )));
            }
            _ => (Bearer::Robot(robot), key_file(folder, robot)),
        };
        let identity = Arc::new(Identity::read(&key).map_err(wrong)?);
        let certificate = Certificate::read(&certificate_file(&key)).map_err(wrong)?;
        let credentials = Credentials::new(&roster, holder, identity, certificate).map_err(wrong)?;
        Ok(Some(credentials.counting_in(words_file(&key))))
    }
}

fn wrong(error: impl Display) -> LinkError {
    LinkError::Config { key: "trust.keys".to_owned(), cause: error.to_string() }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn starts_at_two_centres_have_no_number_in_common_and_those_at_each_grow() {
        let (robot, now) = (RobotId(2), SystemTime::now());
        let folders = [100, 101].map(|centre| (RobotId(centre), tempfile::tempdir().unwrap()));
        let numbers = folders.each_ref().map(|(centre, folder)| {
            let trust = TrustSection { keys: Some(folder.path().to_owned()), insecure: false };
            // At one moment, by one clock, again and again; by a clock without a battery; and later.
            let late = now + Duration::from_secs(3600);
            let times = (0..40).map(|_| now).chain([UNIX_EPOCH, UNIX_EPOCH, late]);
            let numbers: Vec<u32> = times.map(|time| trust.boot_at(*centre, robot, time)).collect();
            assert!(numbers.is_sorted_by(|one, next| one < next), "{numbers:?}");
            assert!(numbers[0].abs_diff(boot_number(now)) < 16, "{}", numbers[0]);
            // Started on its own in the same folder it counts on.
            assert!(trust.boot(robot, now) > numbers[42]);
            numbers.into_iter().collect::<BTreeSet<u32>>()
        });
        assert!(numbers[0].is_disjoint(&numbers[1]), "{numbers:?}");
    }

    #[test]
    fn a_time_is_that_of_its_number() {
        for boot in [1, 16, 290_000_000, u32::MAX] {
            assert_eq!(boot_number(time_of(boot)), boot);
        }
    }
}
