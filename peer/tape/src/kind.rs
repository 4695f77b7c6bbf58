//! What is recorded, and under which name.

use gestalt_protocol::Topic;
use serde::{Deserialize, Serialize};

/// What a recorded message is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A robot's vote.
    Vote,
    /// Samples that a robot shares.
    Sample,
    /// Which decision a robot holds.
    Holding,
    /// A decision, announced for the swarm.
    Decision,
    /// A question of the swarm to its instructor.
    Question,
    /// A robot's account of itself.
    Status,
    /// A robot came or left.
    Alive,
    /// An instructor's word.
    Feedback,
    /// The swarm's answer to it.
    Answer,
    /// Proof that a member of a sealed swarm said two things.
    Evidence,
    /// A picture that a robot streamed.
    Frame,
    /// What came under a key of the swarm and is no message of that key.
    Unreadable,
    /// What happened, one line each: the recorder's own words.
    Log,
    /// What the recorder received, wrote and lost so far.
    Recorder,
}

/// The first part of the name of every schema that is Gestalt's own.
const OWN: &str = "gestalt.";

impl Kind {
    /// All of them.
    pub const ALL: [Self; 14] = [
        Self::Vote,
        Self::Sample,
        Self::Holding,
        Self::Decision,
        Self::Question,
        Self::Status,
        Self::Alive,
        Self::Feedback,
        Self::Answer,
        Self::Evidence,
        Self::Frame,
        Self::Unreadable,
        Self::Log,
        Self::Recorder,
    ];

    /// Whether it is the recorder's own, and nothing that was said in the swarm.
    #[must_use]
    pub fn is_recorders(self) -> bool {
        matches!(self, Self::Log | Self::Recorder)
    }

    /// The kind of what is said under that key; `None` for what is not recorded.
    #[must_use]
    pub fn of(topic: &Topic) -> Option<Self> {
        Some(match topic {
            Topic::Vote(_) => Self::Vote,
            Topic::Sample(_) => Self::Sample,
            Topic::RobotDecision(_) => Self::Holding,
            Topic::Decision => Self::Decision,
            Topic::Question => Self::Question,
            Topic::Status(_) => Self::Status,
            Topic::Alive(_) => Self::Alive,
            Topic::Feedback(_) => Self::Feedback,
            Topic::Answer(_) => Self::Answer,
            Topic::Evidence => Self::Evidence,
            Topic::Frame(_) => Self::Frame,
            Topic::Repair(_) | Topic::Taken(_) | Topic::Roster | Topic::RosterFor(_) | Topic::Word(_) => {
                return None;
            }
        })
    }

    /// The kind of the messages of that schema; `None` for another program's.
    #[must_use]
    pub fn of_schema(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.schema() == name)
    }

    /// The name of its schema.
    #[must_use]
    pub fn schema(self) -> &'static str {
        match self {
            Self::Vote => "gestalt.Vote",
            Self::Sample => "gestalt.Samples",
            Self::Holding => "gestalt.Holding",
            Self::Decision => "gestalt.Decision",
            Self::Question => "gestalt.Question",
            Self::Status => "gestalt.Status",
            Self::Alive => "gestalt.Alive",
            Self::Feedback => "gestalt.Feedback",
            Self::Answer => "gestalt.Answer",
            Self::Evidence => "gestalt.Evidence",
            Self::Frame => "foxglove.CompressedImage",
            Self::Unreadable => "gestalt.Unreadable",
            Self::Log => "foxglove.Log",
            Self::Recorder => "gestalt.Recorder",
        }
    }

    /// Whether its messages are JSON; the others are protobuf, as the viewers know them.
    #[must_use]
    pub fn is_json(self) -> bool {
        self.schema().starts_with(OWN)
    }

    /// How its messages are written: `json`, or `protobuf`.
    #[must_use]
    pub fn encoding(self) -> &'static str {
        if self.is_json() { "json" } else { "protobuf" }
    }

    /// Its name in tables and metadata.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Vote => "vote",
            Self::Sample => "sample",
            Self::Holding => "holding",
            Self::Decision => "decision",
            Self::Question => "question",
            Self::Status => "status",
            Self::Alive => "alive",
            Self::Feedback => "feedback",
            Self::Answer => "answer",
            Self::Evidence => "evidence",
            Self::Frame => "frame",
            Self::Unreadable => "unreadable",
            Self::Log => "log",
            Self::Recorder => "recorder",
        }
    }
}
