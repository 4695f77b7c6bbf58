//! The folder of whoever has the authority's key: who is a member, and with which key.

use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use gestalt_link::Certificate;
use gestalt_protocol::{IdError, InstructorId, Keys, RobotId};
use gestalt_trust::{
    Applicant, Identity, Instructor, KeyFileError, Membership, PublicKey, Role, Roles, Roster,
};

use super::super::Failure;
use super::keys::{holder, make, new_identity, remove, until_it_counts};
use super::revoked::Revoked;
use crate::config::{ROSTER_FILE, SwarmName, certificate_file, key_file};

/// The secret of whoever may change the roster.
const AUTHORITY_FILE: &str = "authority.key";

/// How long a folder in which somebody else changes the roster is waited for.
const PATIENCE: Duration = Duration::from_secs(10);

/// A swarm in the hands of its authority.
pub(crate) struct Authority {
    folder: PathBuf,
    identity: Arc<Identity>,
    members: Membership,
    revoked: Revoked,
    /// How many members had keys of those when the folder was opened.
    found_revoked: usize,
    /// Files that take the place of others once the roster is written, which needs them.
    new_files: Vec<(PathBuf, PathBuf)>,
    /// Kept while the roster may change: of two who change it at once, the key of one would stand on it, and that of the other lie here.
    _alone: Option<File>,
}

impl Authority {
    /// Makes a swarm: its authority's key, and a roster without members. Goes on where that was interrupted before there was a roster.
    ///
    /// # Errors
    /// A name that no swarm can have, a folder that has a swarm already, and files that cannot be written.
    pub fn create(folder: &Path, swarm: &str, local: Roles) -> Result<Self, Failure> {
        Self::found(folder, swarm, local)?.ok_or_else(|| {
            let roster = folder.join(ROSTER_FILE);
            format!("{} is there already: this folder has its swarm; choose another", roster.display()).into()
        })
    }

    /// The same, or `None` where the folder has a swarm already; nothing is written then.
    fn found(folder: &Path, swarm: &str, local: Roles) -> Result<Option<Self>, Failure> {
        Keys::new(swarm)?;
        let has_swarm = || folder.join(ROSTER_FILE).exists();
        if has_swarm() {
            return Ok(None);
        }
        make(folder)?;
        let file = folder.join(AUTHORITY_FILE);
        match new_identity(&file) {
            Ok(_) => {}
            // Made by who was interrupted, or does the same just now.
            Err(error) if matches!(error.downcast_ref(), Some(KeyFileError::Exists { .. })) => {}
            Err(error) => return Err(error),
        }
        let alone = alone(&file)?;
        if has_swarm() {
            return Ok(None);
        }
        let mut authority = Self {
            folder: folder.to_owned(),
            identity: Arc::new(Identity::read(&file)?),
            members: Membership { swarm: swarm.to_owned(), local, ..Membership::default() },
            revoked: Revoked::read(folder)?,
            found_revoked: 0,
            new_files: Vec::new(),
            _alone: alone,
        };
        authority.save()?;
        Ok(Some(authority))
    }

    /// Opens the folder of a swarm; nobody else changes it until this is dropped. New keys that are on the roster already take their places, where who made
    /// them was interrupted.
    ///
    /// # Errors
    /// A folder without the authority's key or its roster, or with that of another authority; one that somebody else keeps.
    pub fn open(folder: &Path) -> Result<Self, Failure> {
        let file = folder.join(AUTHORITY_FILE);
        if !file.exists() {
            return Err(format!(
                "{} is not there: name the folder that `gestalt trust new` made, which alone can change who is a member",
                file.display()
            )
            .into());
        }
        let alone = alone(&file)?;
        let identity = Arc::new(Identity::read(&file)?);
        let roster: Roster = Roster::read(&folder.join(ROSTER_FILE))?;
        if roster.authority() != identity.public_key() {
            return Err(format!("{} is of another authority: choose another folder", folder.display()).into());
        }
        let members = roster.members().clone();
        let mut revoked = Revoked::read(folder)?;
        members.expelled.values().for_each(|key| revoked.add(*key));
        let mut authority = Self {
            folder: folder.to_owned(),
            identity,
            members,
            revoked,
            found_revoked: 0,
            new_files: Vec::new(),
            _alone: alone,
        };
        authority.found_revoked = authority.revoked_members().len();
        authority.go_on()?;
        Ok(authority)
    }

    /// Opens the folder, or makes a swarm there: of that name, else of the usual one.
    ///
    /// # Errors
    /// As [`Authority::create`] and [`Authority::open`]; a folder of another swarm.
    pub fn open_or_create(folder: &Path, swarm: Option<&str>) -> Result<Self, Failure> {
        // Whoever works on a robot's own computer could as well show it gestures.
        let (usual, local) = (SwarmName::default().0, Roles::up_to(Role::Teach));
        if let Some(new) = Self::found(folder, swarm.unwrap_or(&usual), local)? {
            return Ok(new);
        }
        let authority = Self::open(folder)?;
        let of = &authority.members.swarm;
        match swarm {
            Some(other) if other != of => Err(format!(
                "{} is of the swarm \"{of}\": say --swarm {of}, or choose another folder",
                folder.display()
            )
            .into()),
            _ => Ok(authority),
        }
    }

    /// The authority's own key.
    pub fn identity(&self) -> Arc<Identity> {
        self.identity.clone()
    }

    /// Makes a robot a member, whose key is in this folder, or is made here now.
    ///
    /// # Errors
    /// Files that cannot be read or written.
    pub fn enrol_here(&mut self, robot: RobotId) -> Result<(), Failure> {
        let file = key_file(&self.folder, robot);
        if !file.exists() && self.key(&Applicant::Robot(robot)).is_some() {
            return Err(format!(
                "robot {robot} is a member, and its key is elsewhere: `gestalt trust rekey {robot}` makes another here"
            )
            .into());
        }
        let identity = if file.exists() { Identity::read(&file)? } else { new_identity(&file)? };
        self.enrol(&Applicant::Robot(robot), identity.public_key(), Roles::NONE)?;
        self.certify(&Applicant::Robot(robot), &identity.public_key())?.write(&certificate_file(&file))?;
        Ok(())
    }

    /// Makes a robot or a client a member with that key.
    ///
    /// # Errors
    /// One that is a member already with another key, a key that was taken off the roster before, a client whose name is a number.
    pub fn enrol(&mut self, applicant: &Applicant, key: PublicKey, roles: Roles) -> Result<(), Failure> {
        if let Applicant::Client(name) = applicant {
            client_name(&name.to_string())?;
        }
        let held = self.key(applicant);
        if held.is_some_and(|held| held != key) {
            let (who, mend) = (
                said(applicant),
                match applicant {
                    Applicant::Robot(robot) => format!("rekey {robot}` takes"),
                    Applicant::Client(name) => format!("expel {name}`, and enrolling it then, takes"),
                },
            );
            return Err(format!(
                "{who} is a member with another key: if it was given a new one, `gestalt trust {mend} the old one's trust away"
            )
            .into());
        }
        if held.is_none() && self.revoked.contains(&key) {
            let again = match applicant {
                Applicant::Robot(robot) if self.members.expelled.contains_key(robot) => {
                    format!("`gestalt trust rekey {robot}`, or ")
                }
                _ => String::new(),
            };
            return Err(format!(
                "the key of {} was taken off the roster before: make another, by {again}`gestalt trust request --anew` where it is",
                said(applicant)
            )
            .into());
        }
        match applicant {
            Applicant::Robot(robot) => {
                self.members.robots.insert(*robot, key);
            }
            Applicant::Client(name) => {
                self.members.instructors.insert(name.clone(), Instructor { key, roles });
            }
        }
        Ok(())
    }

    /// Gives a robot another key; the old one is never believed again.
    ///
    /// # Errors
    /// A robot that is no member, files that cannot be written.
    pub fn rekey(&mut self, robot: RobotId, key: Option<PublicKey>) -> Result<(), Failure> {
        let old = self.members.robots.get(&robot).or_else(|| self.members.expelled.get(&robot)).copied();
        let old =
            old.ok_or_else(|| format!("robot {robot} was never a member: gestalt trust enrol makes it one"))?;
        self.members.robots.remove(&robot);
        self.members.expelled.insert(robot, old);
        self.revoked.add(old);
        let who = Applicant::Robot(robot);
        let Some(key) = key else {
            let (new, _) = self.new_key_file(robot);
            remove(&new)?;
            let key = new_identity(&new)?.public_key();
            self.enrol(&who, key, Roles::NONE)?;
            self.certify(&who, &key)?.write(&certificate_file(&new))?;
            self.will_take_its_place(robot);
            return Ok(());
        };
        self.enrol(&who, key, Roles::NONE)
    }

    /// Where a robot's new key lies until the roster has it, and where it is to lie then.
    fn new_key_file(&self, robot: RobotId) -> (PathBuf, PathBuf) {
        let file = key_file(&self.folder, robot);
        (until_it_counts(&file), file)
    }

    /// The key last: while the new one lies beside the old one, it is known that this was not done.
    fn will_take_its_place(&mut self, robot: RobotId) {
        let (new, file) = self.new_key_file(robot);
        self.new_files.push((certificate_file(&new), certificate_file(&file)));
        self.new_files.push((new, file));
    }

    /// Does what was left to do when the roster had been written.
    fn go_on(&mut self) -> Result<(), Failure> {
        for (robot, key) in self.members.robots.clone() {
            let (new, _) = self.new_key_file(robot);
            if new.exists() && Identity::read(&new)?.public_key() == key {
                self.will_take_its_place(robot);
            }
        }
        self.put_new_files()
    }

    fn put_new_files(&mut self) -> Result<(), Failure> {
        for (new, file) in self.new_files.drain(..) {
            match fs::rename(&new, &file) {
                // Done before it was interrupted.
                Err(error) if error.kind() == ErrorKind::NotFound && file.exists() => {}
                renamed => renamed.map_err(|error| {
                    format!(
                        "the roster is written, but not {}: {error}; rename {} to it",
                        file.display(),
                        new.display()
                    )
                })?,
            }
        }
        Ok(())
    }

    /// The key that a member has.
    #[must_use]
    pub fn key(&self, who: &Applicant) -> Option<PublicKey> {
        self.members.key(who)
    }

    /// Refuses members whose keys were taken off the roster before, where it was restored from an older copy, or a command was interrupted; not while they become
    /// fewer, as each is expelled, or given another key, by itself.
    fn check_revoked(&mut self) -> Result<(), Failure> {
        let revoked = self.revoked_members();
        match revoked.first() {
            Some(who) if revoked.len() >= self.found_revoked => Err(format!(
                "{who} is a member with a key that was taken off the roster before: `gestalt trust expel` it first, or give a robot another by `gestalt trust rekey`"
            )
            .into()),
            _ => {
                self.found_revoked = revoked.len();
                Ok(())
            }
        }
    }

    fn revoked_members(&self) -> Vec<String> {
        let robots = self.members.robots.iter().map(|(robot, key)| (Applicant::Robot(*robot), key));
        let clients = self.members.instructors.iter();
        let clients = clients.map(|(name, it)| (Applicant::Client(name.clone()), &it.key));
        let revoked = robots.chain(clients).filter(|(_, key)| self.revoked.contains(key));
        revoked.map(|(who, _)| said(&who)).collect()
    }

    /// Whether that key was taken off the roster once.
    #[must_use]
    pub fn is_revoked(&self, key: &PublicKey) -> bool {
        self.revoked.contains(key)
    }

    /// What a client may do as yet.
    #[must_use]
    pub fn roles(&self, who: &Applicant) -> Roles {
        match who {
            Applicant::Robot(_) => Roles::NONE,
            Applicant::Client(name) => {
                self.members.instructors.get(name).map_or(Roles::NONE, |held| held.roles)
            }
        }
    }

    /// Takes a robot or a client off the roster. Says whether it was on it: a robot that was expelled before is none already.
    ///
    /// # Errors
    /// One that was never a member, as far as is known: of clients nothing is kept.
    pub fn expel(&mut self, who: &Applicant) -> Result<bool, Failure> {
        let key = self.key(who);
        key.into_iter().for_each(|key| self.revoked.add(key));
        let before = match who {
            Applicant::Robot(robot) => {
                self.members.robots.remove(robot);
                let before = self.members.expelled.contains_key(robot);
                self.members.expelled.extend(key.map(|key| (*robot, key)));
                before
            }
            Applicant::Client(name) => {
                self.members.instructors.remove(name);
                false
            }
        };
        if key.is_some() || before {
            return Ok(key.is_some());
        }
        let words = "is no member: gestalt trust roster shows who is, and gestalt trust tell says it to a swarm that runs";
        Err(format!("{} {words}", said(who)).into())
    }

    /// The roster as it is written.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn roster(&self) -> Result<Roster, Failure> {
        Ok(Roster::read(&self.folder.join(ROSTER_FILE))?)
    }

    /// The certificate of a member.
    ///
    /// # Errors
    /// What keeps a certificate from being made.
    pub fn certify(&self, who: &Applicant, key: &PublicKey) -> Result<Certificate, Failure> {
        Ok(Certificate::issue(&self.identity, &self.members.swarm, holder(who), key)?)
    }

    /// Signs the next roster and writes it; then new keys take the place of old ones.
    ///
    /// # Errors
    /// Members that exclude each other, and a file that cannot be written.
    pub fn save(&mut self) -> Result<Roster, Failure> {
        self.check_revoked()?;
        self.members.epoch += 1;
        let roster = self.members.clone().sign(&self.identity)?;
        // Before the roster: no key that was taken off it is ever unknown here.
        self.revoked.write()?;
        roster.write(&self.folder.join(ROSTER_FILE))?;
        self.put_new_files()?;
        Ok(roster)
    }
}

/// Keeps others that ask for the same out, until what is returned is dropped. `None` where files cannot be locked.
fn alone(file: &Path) -> Result<Option<File>, Failure> {
    let held = File::open(file).map_err(|error| format!("cannot read {}: {error}", file.display()))?;
    let is_held = gestalt_file::hold(&held, PATIENCE).map_err(|_| {
        format!("somebody else changes the roster in {} all the time", file.with_file_name("").display())
    })?;
    Ok(is_held.then_some(held))
}

/// The member in words.
pub(super) fn said(who: &Applicant) -> String {
    match who {
        Applicant::Robot(robot) => format!("robot {robot}"),
        Applicant::Client(name) => format!("client {name}"),
    }
}

/// A robot by its number, a client by its name; either as an [`Applicant`] is written.
pub(super) fn applicant(text: &str) -> Result<Applicant, String> {
    let robot = |text: &str| text.parse().map(Applicant::Robot);
    let client = |text: &str| text.parse().map(Applicant::Client);
    let who: Result<Applicant, IdError> = match text.split_once(':') {
        Some(("robot", number)) => robot(number),
        Some(("client", name)) => client(name),
        _ => robot(text).or_else(|_| client(text)),
    };
    who.map_err(|error| error.to_string())
}

/// A client's name: one that no robot could have.
pub(super) fn client_name(text: &str) -> Result<InstructorId, String> {
    if text.parse::<RobotId>().is_ok() {
        return Err(format!(
            "client {text} would be taken for robot {text}: choose a name that is no number"
        ));
    }
    text.parse().map_err(|error: IdError| error.to_string())
}

#[cfg(test)]
mod tests;
