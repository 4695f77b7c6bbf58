//! The members of a swarm, and which of them can be members together.

use std::collections::BTreeMap;

use gestalt_protocol::{InstructorId, Keys, MAX_ROBOTS, RobotId};
use serde::{Deserialize, Serialize};

use crate::public_key::PublicKey;
use crate::request::Applicant;
use crate::roles::Roles;
use crate::roster_error::{Member, RosterError};

/// Stands first under every signature of a roster.
pub const ROSTER_DOMAIN: &[u8; 17] = b"gestalt-roster-2\0";

/// The most instructors one roster can name.
pub const MAX_INSTRUCTORS: usize = 256;

/// Somebody with a key who is no robot: an instructor, or a program that listens.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Instructor {
    /// The key that the instructor's words are signed with.
    pub key: PublicKey,
    /// What they may do.
    pub roles: Roles,
}

/// The members of a swarm as its authority puts them together, before it signs.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Membership {
    /// The swarm's name, as in [`Keys::new`].
    pub swarm: String,
    /// Which version of the roster it is: higher than every one before it.
    pub epoch: u64,
    /// The robots, at most [`MAX_ROBOTS`], each with a key of its own.
    pub robots: BTreeMap<RobotId, PublicKey>,
    /// The clients, at most [`MAX_INSTRUCTORS`], each with a key of its own, and what they may do.
    pub instructors: BTreeMap<InstructorId, Instructor>,
    /// What whoever works on a robot's own computer may do, without a key: the robot signs for them.
    pub local: Roles,
    /// The keys that robots lost their trust with, at most [`MAX_ROBOTS`]. A robot comes back with a new key alone.
    pub expelled: BTreeMap<RobotId, PublicKey>,
}

impl Membership {
    /// The key that a member has.
    #[must_use]
    pub fn key(&self, who: &Applicant) -> Option<PublicKey> {
        match who {
            Applicant::Robot(robot) => self.robots.get(robot).copied(),
            Applicant::Client(name) => self.instructors.get(name).map(|held| held.key),
        }
    }

    /// [`ROSTER_DOMAIN`], then authority and members in postcard: sorted maps have one spelling.
    pub(crate) fn signed_bytes(&self, authority: &PublicKey) -> Vec<u8> {
        postcard::to_extend(&(authority, self), ROSTER_DOMAIN.to_vec())
            .expect("memory is the only thing that writing to a vector can lack")
    }

    /// Whether all of them can be members together.
    pub(crate) fn check(&self) -> Result<(), RosterError> {
        Keys::new(&self.swarm)?;
        for (what, length, limit) in [
            ("robots", self.robots.len(), MAX_ROBOTS),
            ("instructors", self.instructors.len(), MAX_INSTRUCTORS),
            ("expelled robots", self.expelled.len(), MAX_ROBOTS),
        ] {
            if length > limit {
                return Err(RosterError::TooMany { what, limit });
            }
        }
        let robots = self.robots.iter().map(|(robot, key)| (Member::Robot(*robot), key));
        let instructors =
            self.instructors.iter().map(|(name, it)| (Member::Instructor(name.clone()), &it.key));
        let mut members: BTreeMap<PublicKey, Member> = BTreeMap::new();
        for (member, key) in robots.chain(instructors) {
            if let Some(first) = members.insert(*key, member.clone()) {
                return Err(RosterError::SharedKey { first, second: member });
            }
        }
        match self.expelled.iter().find_map(|(robot, key)| Some((*robot, members.get(key)?))) {
            Some((robot, member)) => Err(RosterError::ExpelledKey { member: member.clone(), robot }),
            None => Ok(()),
        }
    }
}
