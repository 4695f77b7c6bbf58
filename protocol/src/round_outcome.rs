//! What a round came to, in a word, and why.

use serde::{Deserialize, Serialize};

use crate::id::ClassId;

/// What a round came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RoundOutcome {
    /// A gesture that the swarm knows.
    Gesture,
    /// A gesture that nobody taught, or none at all.
    Unknown,
    /// The robots could not tell.
    Undecided,
}

impl RoundOutcome {
    /// As it is written in JSON.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Gesture => "gesture",
            Self::Unknown => "unknown",
            Self::Undecided => "undecided",
        }
    }
}

/// Why a round came to that. In JSON an object whose field `kind` names it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Reason {
    /// Enough robots are sure enough of one gesture.
    Sure,
    /// It looks less like the nearest gesture than like something else.
    FarFromAll {
        /// The gesture that it is still likest.
        nearest: ClassId,
        /// How far that is, in nats: by how much the log-probability of "unknown" exceeds that of the gesture.
        nats: f64,
    },
    /// No robot that took part saw a hand.
    NothingSeen,
    /// Fewer robots took part, or gave evidence, than a decision needs.
    TooFewRobots {
        /// How many did.
        counted: u32,
        /// How many it needs.
        needed: u32,
    },
    /// Robots see different gestures.
    Disagreement {
        /// The two that most robots are for, the likelier first.
        between: [ClassId; 2],
        /// How many robots find each of them likeliest.
        robots: [u32; 2],
    },
    /// They are for one gesture, and not sure enough.
    Unsure {
        /// Which one.
        nearest: ClassId,
        /// How likely it is, `0.0..=1.0`.
        probability: f64,
    },
}
