//! Whom a robot believes, as its configuration file says it.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use gestalt_link::{LinkError, Seal};
use gestalt_protocol::RobotId;
use gestalt_trust::{Identity, Roster};
use serde::{Deserialize, Serialize};

/// The roster in a folder of keys.
pub const ROSTER_FILE: &str = "roster.json";

/// A robot's key in a folder of keys.
#[must_use]
pub fn key_file(folder: &Path, robot: RobotId) -> PathBuf {
    folder.join(format!("robot-{robot}.key"))
}

/// Whom a robot believes.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TrustSection {
    /// The folder with `roster.json` and this robot's `robot-<id>.key`, as `gestalt keys` writes them. Without one the swarm is open: robots
    /// are who they say they are.
    pub keys: Option<PathBuf>,
}

impl TrustSection {
    /// What makes this robot one of a sealed swarm; `None` in an open one.
    ///
    /// # Errors
    /// [`LinkError::Config`] names the file, what is wrong with it, and the mend.
    pub fn seal(&self, robot: RobotId) -> Result<Option<Seal>, LinkError> {
        let Some(folder) = &self.keys else { return Ok(None) };
        let roster = Roster::read(&folder.join(ROSTER_FILE)).map_err(wrong)?;
        let identity = Arc::new(Identity::read(&key_file(folder, robot)).map_err(wrong)?);
        Ok(Some(Seal { identity, roster, guests: BTreeMap::new() }))
    }

    /// The same for a robot through which others vote: with the keys of all others that are in the folder.
    ///
    /// # Errors
    /// As [`TrustSection::seal`].
    pub fn seal_with_guests(&self, robot: RobotId) -> Result<Option<Seal>, LinkError> {
        let (Some(mut seal), Some(folder)) = (self.seal(robot)?, &self.keys) else { return Ok(None) };
        let others: Vec<RobotId> =
            seal.roster.members().robots.keys().copied().filter(|id| *id != robot).collect();
        for guest in others {
            let file = key_file(folder, guest);
            if file.exists() {
                seal.guests.insert(guest, Arc::new(Identity::read(&file).map_err(wrong)?));
            }
        }
        Ok(Some(seal))
    }
}

fn wrong(error: impl Display) -> LinkError {
    LinkError::Config { key: "trust.keys".to_owned(), cause: error.to_string() }
}
