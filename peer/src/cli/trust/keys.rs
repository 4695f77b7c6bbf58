//! The files of members' keys.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use gestalt_link::Bearer;
use gestalt_trust::{Applicant, Identity};

use super::super::Failure;
use crate::config::{client_key_file, key_file};

/// The key of a robot or client in that folder, made now if there is none.
///
/// # Errors
/// Files that cannot be read or written.
pub(super) fn key_of(folder: &Path, who: &Applicant, anew: bool) -> Result<Identity, Failure> {
    // To make another is the cure of one that cannot be read.
    if !anew && let Some(here) = key_here(folder, who)? {
        return Ok(here);
    }
    make(folder)?;
    let file = key_path(folder, who);
    // One that is there stays until there is another.
    let new = until_it_counts(&file);
    remove(&new)?;
    let identity = new_identity(&new)?;
    fs::rename(&new, &file).map_err(|error| format!("cannot write {}: {error}", file.display()))?;
    Ok(identity)
}

/// The key of a robot or client in that folder, if it has one there.
///
/// # Errors
/// A file that cannot be read.
pub(super) fn key_here(folder: &Path, who: &Applicant) -> Result<Option<Identity>, Failure> {
    let file = key_path(folder, who);
    Ok(if file.exists() { Some(Identity::read(&file)?) } else { None })
}

/// Where the key that will lie there lies before.
pub(super) fn until_it_counts(key: &Path) -> PathBuf {
    key.with_extension("new.key")
}

/// Whose certificate it is.
pub(super) fn holder(who: &Applicant) -> Bearer {
    match who {
        Applicant::Robot(robot) => Bearer::Robot(*robot),
        Applicant::Client(name) => Bearer::Client(name.clone()),
    }
}

/// Where a member's key lies.
pub(super) fn key_path(folder: &Path, who: &Applicant) -> PathBuf {
    match who {
        Applicant::Robot(robot) => key_file(folder, *robot),
        Applicant::Client(name) => client_key_file(folder, name),
    }
}

pub(super) fn remove(file: &Path) -> Result<(), Failure> {
    match fs::remove_file(file) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            Err(format!("cannot remove {}: {error}", file.display()).into())
        }
        _ => Ok(()),
    }
}

pub(super) fn make(folder: &Path) -> Result<(), Failure> {
    fs::create_dir_all(folder).map_err(|error| format!("cannot make {}: {error}", folder.display()).into())
}

pub(super) fn new_identity(file: &Path) -> Result<Identity, Failure> {
    let mut secret = zeroize::Zeroizing::new([0; 32]);
    getrandom::fill(&mut *secret).map_err(|error| format!("the system gives no random numbers: {error}"))?;
    let identity = Identity::from_bytes(&secret);
    identity.write(file)?;
    Ok(identity)
}
