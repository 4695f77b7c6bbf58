//! What can be wrong with a roster.

use std::fmt;
use std::io;
use std::path::PathBuf;

use gestalt_protocol::{InstructorId, RobotId, SwarmNameError};
use thiserror::Error;

/// Somebody with a key on a roster.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Member {
    /// Who signs the roster.
    Authority,
    /// A robot.
    Robot(RobotId),
    /// An instructor.
    Instructor(InstructorId),
}

impl fmt::Display for Member {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Authority => f.write_str("the authority"),
            Self::Robot(robot) => write!(f, "robot {robot}"),
            Self::Instructor(name) => write!(f, "instructor {name}"),
        }
    }
}

/// A roster that is not accepted. What a robot held before, it goes on holding.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RosterError {
    /// Longer than any roster; it was not looked into.
    #[error("a roster of {length} bytes, at most {limit} are accepted")]
    TooLong {
        /// How long it is.
        length: usize,
        /// How long it may be.
        limit: usize,
    },
    /// Not the JSON of a roster.
    #[error("no roster: {0}; take the file that the authority wrote, unchanged")]
    Malformed(String),
    /// A swarm name that could not stand in a key expression.
    #[error(transparent)]
    Name(#[from] SwarmNameError),
    /// More members than a swarm can have.
    #[error("more than {limit} {what}: divide the swarm, or take off those who left")]
    TooMany {
        /// Members of which kind.
        what: &'static str,
        /// How many there may be.
        limit: usize,
    },
    /// More rosters than are checked. It may well be true.
    #[error("more rosters than are checked: it is looked at when it comes again")]
    TooFast,
    /// Not signed by the authority that it names.
    #[error(
        "the signature is not its authority's: it was changed after signing; sign it again, or take the original"
    )]
    Forged,
    /// A key that nobody should trust: not on the curve, of small order, or not in its shortest spelling.
    #[error("the key of {member} is none that can be trusted: make a new identity for it")]
    Key {
        /// Whose it is.
        member: Member,
    },
    /// Two members with one key.
    #[error("{first} and {second} have the same key: make a new identity for one of them")]
    SharedKey {
        /// One of them.
        first: Member,
        /// The other.
        second: Member,
    },
    /// A key that was expelled before.
    #[error("{member} has the key that robot {robot} was expelled with: make a new identity for it")]
    ExpelledKey {
        /// Who has it now.
        member: Member,
        /// Who had it.
        robot: RobotId,
    },
    /// Of another swarm, or another authority.
    #[error(
        "a roster of another swarm or another authority: this robot stays with the one it was enrolled in"
    )]
    OtherSwarm,
    /// Of an epoch before the one that is held.
    #[error("epoch {offered} is older than epoch {held}, which this robot holds: a swarm never goes back")]
    Older {
        /// The epoch of the roster that is held.
        held: u64,
        /// The epoch of the roster that was offered.
        offered: u64,
    },
    /// Two rosters of one epoch: the authority wrote both.
    #[error("two different rosters of epoch {epoch}: sign the right one again, with a higher epoch")]
    Contradiction {
        /// The epoch of both.
        epoch: u64,
    },
    /// What a file holds is none that is accepted.
    #[error("{path}: {cause}")]
    Contents {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: Box<RosterError>,
    },
    /// The file could not be read or written.
    #[error(
        "{path}: the roster could not be {verb}: {source}: check the path, whose file it is, and the room on the disk"
    )]
    File {
        /// The file.
        path: PathBuf,
        /// `read` or `written`.
        verb: &'static str,
        /// What the system says.
        source: io::Error,
    },
}
