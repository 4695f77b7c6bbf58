//! `gestalt keys`: makes a swarm's robots members of it.

use std::path::{Path, PathBuf};

use gestalt_protocol::{Keys, RobotId};
use gestalt_trust::{Identity, Membership, Roster};

use super::Failure;
use crate::config::{ROSTER_FILE, key_file};

/// The secret of whoever may change the roster.
const AUTHORITY_FILE: &str = "authority.key";

/// Make keys for the robots of a sealed swarm, and the roster that names them
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt keys --swarm demo --robots 1,2,3 keys
  gestalt keys --swarm demo --robots 4 keys")]
pub struct Args {
    /// Name of the swarm
    #[arg(long, default_value = "gestalt", value_name = "NAME")]
    swarm: String,
    /// Ids of the robots
    #[arg(long, value_delimiter = ',', required = true, value_name = "ID,…")]
    robots: Vec<u32>,
    /// Folder to write to; keys that are there stay, and the roster names them as well. A robot needs roster.json and its own key;
    /// authority.key can enrol robots: keep it where no robot is
    folder: PathBuf,
}

/// Runs the verb.
///
/// # Errors
/// A name that no swarm can have, and files that cannot be read or written.
pub fn run(args: &Args) -> Result<(), Failure> {
    let roster = enrol(&args.folder, &args.swarm, args.robots.iter().copied().map(RobotId))?;
    let members = roster.members();
    let count = super::show::counted(members.robots.len(), "robot");
    let words = format!(
        "{count} of the swarm \"{}\" in {}, epoch {}",
        members.swarm,
        args.folder.display(),
        members.epoch
    );
    super::show::line(false, &serde_json::Value::Null, &words)
}

/// Makes keys for those robots that have none in that folder, and the next roster, with those of the last one.
///
/// # Errors
/// As [`run`].
pub(super) fn enrol(
    folder: &Path,
    swarm: &str,
    robots: impl IntoIterator<Item = RobotId>,
) -> Result<Roster, Failure> {
    Keys::new(swarm)?;
    std::fs::create_dir_all(folder).map_err(|error| format!("cannot make {}: {error}", folder.display()))?;
    let authority = identity(&folder.join(AUTHORITY_FILE))?;
    let file = folder.join(ROSTER_FILE);
    let mut members = match file.exists() {
        true => {
            let last: Roster = Roster::read(&file)?;
            if last.authority() != authority.public_key() || last.members().swarm != swarm {
                return Err(format!(
                    "{} is of the swarm \"{}\" or of another authority: choose another folder",
                    file.display(),
                    last.members().swarm
                )
                .into());
            }
            last.members().clone()
        }
        false => Membership { swarm: swarm.to_owned(), ..Membership::default() },
    };
    members.epoch += 1;
    for robot in robots {
        members.robots.insert(robot, identity(&key_file(folder, robot))?.public_key());
    }
    let roster = members.sign(&authority)?;
    roster.write(&file)?;
    Ok(roster)
}

/// The key in that file; a new one if there is none.
fn identity(file: &Path) -> Result<Identity, Failure> {
    if file.exists() {
        return Ok(Identity::read(file)?);
    }
    let mut secret = zeroize::Zeroizing::new([0; 32]);
    getrandom::fill(&mut *secret).map_err(|error| format!("the system gives no random numbers: {error}"))?;
    let identity = Identity::from_bytes(&secret);
    identity.write(file)?;
    Ok(identity)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn robots_are_enrolled_one_after_the_other_and_keep_their_keys() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path().join("keys");
        let first = enrol(&folder, "demo", [RobotId(1), RobotId(2)]).unwrap();
        let second = enrol(&folder, "demo", [RobotId(2), RobotId(3)]).unwrap();
        assert!(second.newer_than(&first));
        let (first, second) = (first.members(), second.members());
        assert_eq!((first.robots.len(), second.robots.len(), second.epoch), (2, 3, 2));
        assert_eq!(first.robots[&RobotId(2)], second.robots[&RobotId(2)]);
        assert!(
            enrol(&folder, "other", [RobotId(1)]).unwrap_err().to_string().contains("choose another folder")
        );
        let trust = crate::config::TrustSection { keys: Some(folder) };
        assert_eq!(
            trust.seal(RobotId(3)).unwrap().unwrap().identity.public_key(),
            second.robots[&RobotId(3)]
        );
        let missing = trust.seal(RobotId(4)).unwrap_err().to_string();
        assert!(missing.contains("trust.keys") && missing.contains("robot-4.key"), "{missing}");
        assert_eq!(trust.seal_with_guests(RobotId(3)).unwrap().unwrap().guests.len(), 2);
    }
}
