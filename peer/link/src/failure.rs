//! The parts of a robot that can fail one by one, and what becomes of the robot then.

use std::fmt;

use thiserror::Error;

/// A part of a running robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Part {
    /// Decides, and serves all the others. Without it the robot ends.
    Mind,
    /// The program's own classifier. Without it the robot is blind, and nobody waits for what it sees.
    Classifier,
    /// Trains the classifier. It begins anew with all samples.
    Training,
    /// Writes the memory. It opens the file anew; what was not written yet is kept for it.
    Memory,
    /// Sends samples and repairs. It goes on with the next; neighbours repeat what is lost.
    Speaking,
    /// Finds other robots and keeps links to some of them. It begins anew.
    Links,
    /// Makes links anew over which nothing is heard. It begins anew.
    Deafness,
    /// Asks who is alive after links have changed. It begins anew.
    Census,
    /// The addresses that others find it by. Who is alone is found at none that came after the start of its program.
    Network,
    /// In a sealed swarm, tells neighbours of its roster and hangs up who is on it no more. It begins anew.
    Roster,
    /// Lets others see that this robot is alive. It declares itself anew.
    Presence,
    /// The Zenoh session. Without it the robot ends.
    Session,
    /// The robot that a guest votes through. Without it the guest ends.
    Host,
}

impl Part {
    /// All of them.
    pub const ALL: [Self; 13] = [
        Self::Mind,
        Self::Classifier,
        Self::Training,
        Self::Memory,
        Self::Speaking,
        Self::Links,
        Self::Deafness,
        Self::Census,
        Self::Network,
        Self::Roster,
        Self::Presence,
        Self::Session,
        Self::Host,
    ];

    /// One word, as it stands in counters (`failed_training`).
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Mind => "mind",
            Self::Classifier => "classifier",
            Self::Training => "training",
            Self::Memory => "memory",
            Self::Speaking => "speaking",
            Self::Links => "links",
            Self::Deafness => "deafness",
            Self::Census => "census",
            Self::Network => "network",
            Self::Roster => "roster",
            Self::Presence => "presence",
            Self::Session => "session",
            Self::Host => "host",
        }
    }

    /// What becomes of the robot without it, and what is to be done.
    fn outcome(self) -> &'static str {
        match self {
            Self::Mind => "the robot ends: start it again, and report this",
            Self::Classifier => "the robot is blind until it is given another classifier: mend its Classify",
            Self::Training => "it begins anew with all samples; the robot judges as before until then",
            Self::Memory => "it is opened anew, and what waits is written then",
            Self::Speaking => "it goes on with the next; neighbours repeat what is lost",
            Self::Links | Self::Deafness | Self::Census | Self::Roster | Self::Presence => "it begins anew",
            Self::Network => "no robot is found there: restart this program",
            Self::Session => "the robot ends: start it again, once its network is up",
            Self::Host => "the guest ends: start it again with its host",
        }
    }
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// Why a part of a robot failed.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{part} failed: {cause}; {}", part.outcome())]
pub struct Failure {
    /// Which part.
    pub part: Part,
    /// What it said, most often in a panic.
    pub cause: String,
}
