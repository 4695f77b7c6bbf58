//! The files that a robot needs: model, memory, keys.

use std::fs::{self, File};
use std::io::{ErrorKind, Write};
use std::path::{Path, absolute};

use gestalt_protocol::Status;

use super::{Subject, account, since_1970};
use crate::config::{Config, ROSTER_FILE, key_file};
use crate::doctor::robot::{KeyFacts, MemoryFacts, ROOM, RobotFacts, Room};

/// What the robot's files are like, and what it would say of itself. A memory that is in use is not opened.
pub(super) fn look(subject: &Subject, config: &Config, running: bool) -> (RobotFacts, Status) {
    let mut mine = account(config);
    let mut facts = RobotFacts {
        running,
        described: subject.file.clone(),
        problems: subject.problems.clone(),
        ..RobotFacts::new(config.robot.id, since_1970())
    };
    if subject.file.is_none() {
        return (facts, mine);
    }
    facts.keys = keys(config);
    facts.memory = config.learning.memory.as_deref().filter(|_| config.learning.enabled).map(place);
    judge(config, &mut facts, &mut mine);
    (facts, mine)
}

/// What needs a model: reads it, and tries a copy of the memory with it.
#[cfg(feature = "opencv")]
fn judge(config: &Config, facts: &mut RobotFacts, mine: &mut Status) {
    use gestalt_link::LinkError;
    use gestalt_protocol::LearningStatus;
    use gestalt_strategies::Classify;

    let model = match crate::model::load(&config.model) {
        Ok(Some(model)) => model,
        Ok(None) => return,
        Err(error) => {
            facts.model = Some(Err(error.to_string()));
            return;
        }
    };
    let vocabulary = model.classifier.vocabulary().labels();
    facts.model = Some(Ok(format!(
        "{}: {} gestures, {} features",
        model.name,
        vocabulary.len(),
        model.classifier.space().feature_set()
    )));
    mine.vocabulary = vocabulary.to_vec();
    if config.learning.enabled {
        let space = model.classifier.space().id().to_string();
        mine.learning = Some(LearningStatus { space, ..LearningStatus::default() });
    }
    if let Err(error) = crate::config::check::share_bytes(config, &model) {
        facts.problems.push(error.to_string());
        return;
    }
    // What another process writes to may be read half-written.
    if let Some(memory) = facts.memory.as_mut().filter(|memory| !memory.held && memory.room == Room::Enough) {
        match crate::config::check::memory(config, &model) {
            Err(LinkError::Memory(error)) if error.is_of_the_disk() => {
                memory.room = Room::Unreadable(error.to_string());
            }
            tried => memory.trouble = tried.err().map(|error| crate::config::check::said(&error)),
        }
    }
}

/// Without OpenCV there are no models to look into.
#[cfg(not(feature = "opencv"))]
fn judge(_: &Config, _: &mut RobotFacts, _: &mut Status) {}

/// Whether there is room for a memory, and whether it is in use.
fn place(path: &Path) -> MemoryFacts {
    // Named without a folder, it is another file wherever the robot starts: which one was looked at is said. The room is where a link leads.
    let path = &absolute(path).unwrap_or_else(|_| path.to_owned());
    let room = gestalt_file::target(path).and_then(|end| room(gestalt_file::folder(&end))).and_then(|()| {
        match File::options().append(true).open(path) {
            Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        }
    });
    let room = match room {
        Ok(()) => Room::Enough,
        Err(error) => match error.kind() {
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded => Room::Full,
            ErrorKind::NotFound | ErrorKind::NotADirectory => Room::NoFolder,
            _ => Room::ReadOnly(error.to_string()),
        },
    };
    MemoryFacts { path: path.to_owned(), room, held: is_held(path), trouble: None }
}

/// Writes a file without a name, which is gone as soon as it is closed.
fn room(folder: &Path) -> std::io::Result<()> {
    fs::metadata(folder)?;
    let mut file = tempfile::tempfile_in(folder)?;
    let block = vec![0x55; 1 << 20];
    for _ in 0..ROOM / block.len() {
        file.write_all(&block)?;
    }
    file.sync_data()
}

/// Whether another process has it open: a database holds a lock on its file.
fn is_held(path: &Path) -> bool {
    let Ok(file) = File::open(path) else { return false };
    matches!(file.try_lock(), Err(fs::TryLockError::WouldBlock))
}

fn keys(config: &Config) -> Option<KeyFacts> {
    let folder = config.trust.keys.clone()?;
    let key = key_file(&folder, config.robot.id);
    let exposed = is_exposed(&key);
    let trouble = if exposed { None } else { seal(config).err() };
    // As the number of a start and a newer roster are written: beside what they replace.
    let locked = tempfile::tempfile_in(&folder).err().map(|cause| cause.to_string());
    Some(KeyFacts { exposed, trouble, locked, folder, key })
}

/// Whether the robot is a member of the swarm that its roster is of.
fn seal(config: &Config) -> Result<(), String> {
    let robot = config.robot.id;
    let Some(seal) = config.trust.seal(robot).map_err(|error| error.to_string())? else { return Ok(()) };
    let members = seal.roster.members();
    let roster = config
        .trust
        .keys
        .as_ref()
        .map(|folder| folder.join(ROSTER_FILE).display().to_string())
        .unwrap_or_default();
    if members.swarm != config.swarm.0 {
        return Err(format!(
            "{roster} is of the swarm \"{}\", this robot is of \"{}\"",
            members.swarm, config.swarm.0
        ));
    }
    if members.robots.get(&robot) != Some(&seal.identity.public_key()) {
        return Err(format!("robot {robot} is not on {roster} with the key that it has here"));
    }
    Ok(())
}

#[cfg(unix)]
fn is_exposed(key: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    fs::metadata(key).is_ok_and(|about| about.is_file() && about.mode() & 0o077 != 0)
}

/// Other systems have no such bits.
#[cfg(not(unix))]
fn is_exposed(_: &Path) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_memory_named_without_a_folder_is_said_to_be_where_it_was_looked_for() {
        let memory = place(Path::new("robot.memory"));
        assert!(memory.path.is_absolute() && memory.path.ends_with("robot.memory"), "{memory:?}");
    }

    #[cfg(unix)]
    #[test]
    fn the_room_for_a_memory_is_where_its_link_leads() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("robot.memory");
        std::os::unix::fs::symlink("disk/m", &path).unwrap();
        assert_eq!(place(&path).room, Room::NoFolder);
        fs::create_dir(folder.path().join("disk")).unwrap();
        assert_eq!(place(&path).room, Room::Enough);
    }

    #[test]
    fn a_folder_of_keys_is_tried_by_a_file_without_a_name() {
        let folder = tempfile::tempdir().unwrap();
        let locked = |keys: &Path| {
            let mut config = Config::default();
            config.trust.keys = Some(keys.to_owned());
            super::keys(&config).unwrap().locked
        };
        assert_eq!(locked(folder.path()), None);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        assert!(locked(&folder.path().join("none")).is_some());
    }
}
