//! What a human says to the swarm, and what the swarm answers.

use std::fmt;

use serde::de::{Deserializer, Error, Unexpected, Visitor};
use serde::{Deserialize, Serialize};

use crate::id::{ClassId, RobotId, RoundId};

/// A human's word to the swarm, JSON on `instructor/<id>/feedback`. For example:
///
/// ```json
/// {"say": "open"}
/// {"say": "was", "round": {"counter": 5, "opener": 2, "life": 1067057607}, "class": 3}
/// {"say": "was", "round": {"counter": 5, "opener": 2, "life": 1067057607}, "class": "three"}
/// {"say": "right", "round": {"counter": 5, "opener": 2, "life": 1067057607}, "of": 3}
/// {"say": "wrong", "round": {"counter": 5, "opener": 2, "life": 1067057607}, "of": "three"}
/// {"say": "retract", "round": {"counter": 5, "opener": 2, "life": 1067057607}}
/// {"say": "new", "label": "circle"}
/// {"say": "new", "label": "circle", "round": {"counter": 5, "opener": 2, "life": 1067057607}}
/// {"say": "same", "class": "ring", "of": "circle"}
/// {"say": "retire", "class": "circle"}
/// {"say": "restore", "class": "circle"}
/// ```
///
/// The round is named as in the [`Decision`](crate::Decision) it is about, and "right" and "wrong" name the gesture that they confirm or deny:
/// robots that held another decision at that moment understand the same. A later word of the same instructor on the
/// same round replaces the earlier one; each word but `open` is answered, see [`Answer`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "say", rename_all = "snake_case", try_from = "Read")]
pub enum Instruction {
    /// "Look now": open a round. Without effect while one is open, and for half a second after one was opened: a copy
    /// of the request for that one may still be on its way.
    Open,
    /// "It was this gesture": full feedback.
    Was {
        /// The round.
        round: RoundId,
        /// The gesture, by class or by label.
        class: Gesture,
    },
    /// "Right": the gesture was the one decided.
    Right {
        /// The round.
        round: RoundId,
        /// The gesture that was decided.
        of: Gesture,
    },
    /// "Wrong": the gesture was any but the one decided. Partial feedback.
    Wrong {
        /// The round.
        round: RoundId,
        /// The gesture that was decided.
        of: Gesture,
    },
    /// "I said nothing": takes back what this instructor said of the round.
    Retract {
        /// The round.
        round: RoundId,
    },
    /// "This is a new gesture": names one, for all robots, while they work; nothing else changes until it is shown. To name it again restores it.
    New {
        /// What it is called: 1 to 64 bytes. Two instructors who choose one label name two gestures; `circle (ana)` says whose.
        label: String,
        /// The round that it was shown in, if it was: full feedback on that.
        #[serde(skip_serializing_if = "Option::is_none")]
        round: Option<RoundId>,
    },
    /// "These two are one": what was seen of the first is learned as the second.
    Same {
        /// One that was named.
        class: Gesture,
        /// What it is.
        of: Gesture,
    },
    /// "This is shown no more": robots do not look for it any longer.
    Retire {
        /// One that was named.
        class: Gesture,
    },
    /// Takes `same` or `retire` back.
    Restore {
        /// One that was named.
        class: Gesture,
    },
}

/// A gesture as people name it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(untagged)]
pub enum Gesture {
    /// By its index in the vocabulary.
    Class(ClassId),
    /// By its label.
    Label(String),
}

impl fmt::Display for Gesture {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Class(class) => write!(f, "class {class}"),
            Self::Label(label) => write!(f, "'{label}'"),
        }
    }
}

/// A number or a text. Serde's own reading of what has no tag would first take up whatever stands there, of any size.
impl<'de> Deserialize<'de> for Gesture {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Named;

        impl Visitor<'_> for Named {
            type Value = Gesture;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a class, or a label")
            }

            fn visit_u64<E: Error>(self, class: u64) -> Result<Gesture, E> {
                let possible = u32::try_from(class).ok().map(ClassId).filter(|class| class.is_possible());
                possible
                    .map(Gesture::Class)
                    .ok_or_else(|| E::invalid_value(Unexpected::Unsigned(class), &self))
            }

            fn visit_str<E: Error>(self, label: &str) -> Result<Gesture, E> {
                Ok(Gesture::Label(label.to_owned()))
            }
        }

        deserializer.deserialize_any(Named)
    }
}

/// How an [`Instruction`] is read: key by key, whichever comes first. Serde's own reading of what has a tag among its keys would
/// take up all of them, of any size, until it has found the tag.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Read {
    say: Say,
    #[serde(default, deserialize_with = "given")]
    round: Option<RoundId>,
    #[serde(default, deserialize_with = "given")]
    class: Option<Gesture>,
    #[serde(default, deserialize_with = "given")]
    of: Option<Gesture>,
    #[serde(default, deserialize_with = "given")]
    label: Option<String>,
}

#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Say {
    Open,
    Was,
    Right,
    Wrong,
    Retract,
    New,
    Same,
    Retire,
    Restore,
}

/// Left out or not: `null` is no value.
fn given<'de, D: Deserializer<'de>, T: Deserialize<'de>>(deserializer: D) -> Result<Option<T>, D::Error> {
    T::deserialize(deserializer).map(Some)
}

impl TryFrom<Read> for Instruction {
    type Error = &'static str;

    fn try_from(read: Read) -> Result<Self, &'static str> {
        let Read { say, round, class, of, label } = read;
        Ok(match (say, round, class, of, label) {
            (Say::Open, None, None, None, None) => Self::Open,
            (Say::Was, Some(round), Some(class), None, None) => Self::Was { round, class },
            (Say::Right, Some(round), None, Some(of), None) => Self::Right { round, of },
            (Say::Wrong, Some(round), None, Some(of), None) => Self::Wrong { round, of },
            (Say::Retract, Some(round), None, None, None) => Self::Retract { round },
            (Say::New, round, None, None, Some(label)) => Self::New { label, round },
            (Say::Same, None, Some(class), Some(of), None) => Self::Same { class, of },
            (Say::Retire, None, Some(class), None, None) => Self::Retire { class },
            (Say::Restore, None, Some(class), None, None) => Self::Restore { class },
            (Say::Open, ..) => return Err("open has nothing beside it"),
            (Say::Was, ..) => return Err("was has round and class beside it"),
            (Say::Right | Say::Wrong, ..) => return Err("right and wrong have round and of beside them"),
            (Say::Retract, ..) => return Err("retract has round beside it"),
            (Say::New, ..) => return Err("new has label beside it, and may have round"),
            (Say::Same, ..) => return Err("same has class and of beside it"),
            (Say::Retire | Say::Restore, ..) => return Err("retire and restore have class beside them"),
        })
    }
}

impl Instruction {
    /// The round it is about, if any.
    #[must_use]
    pub fn round(&self) -> Option<RoundId> {
        match self {
            Self::Open | Self::Same { .. } | Self::Retire { .. } | Self::Restore { .. } => None,
            Self::New { round, .. } => *round,
            Self::Was { round, .. }
            | Self::Right { round, .. }
            | Self::Wrong { round, .. }
            | Self::Retract { round } => Some(*round),
        }
    }
}

/// What the swarm answers to an instructor's word, JSON on `instructor/<id>/answer`: one message each, from the live
/// robot of the smallest id that can answer.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Answer {
    /// Who answers.
    pub robot: RobotId,
    /// The time of the word that is answered, as NTP64: the Zenoh timestamp of its message, if its client gave it one.
    pub at: u64,
    /// The word that is answered.
    pub to: Instruction,
    /// What became of it.
    pub outcome: Outcome,
    /// The gesture that the round's samples now stand for, if one is known, or that was named.
    pub class: Option<ClassId>,
    /// Of a gesture that was named: the one that the swarm took what was shown for, if any. Two that look alike are hard to tell apart.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub looks_like: Option<ClassId>,
    /// How many samples of that round the answering robot holds and trains on.
    pub samples: u32,
}

/// What became of an instructor's word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// It is known from now on, and what was seen in that round is labelled by it, or, where it says only what it was not, kept until its gesture is said.
    Learned,
    /// It was known already: nothing changed.
    Known,
    /// Noted, but the robot that answers holds nothing that was seen in that round: it came too late, or saw nothing.
    NothingSeen,
    /// No such round is known, or it is too long ago.
    UnknownRound,
    /// There is no such gesture, or several of that label: `circle (ana)` says whose is meant.
    UnknownGesture,
    /// As many gestures are known as can be told apart: retire one that is shown no more. Or it can have no such label: of 1 to 64 bytes, that does not end as
    /// `circle (ana)` does.
    NoRoom,
    /// The robots have no memory for samples: learning is not configured.
    NotLearning,
    /// In a sealed swarm: who said it may not do that. It changed nothing.
    NotAllowed,
}

impl Outcome {
    /// Whether nothing was learned of the round that the word is about, nor was it known before.
    #[must_use]
    pub fn is_refusal(self) -> bool {
        match self {
            Self::Learned | Self::Known | Self::NothingSeen => false,
            Self::UnknownRound
            | Self::UnknownGesture
            | Self::NoRoom
            | Self::NotLearning
            | Self::NotAllowed => true,
        }
    }

    /// The outcome in words.
    #[must_use]
    pub fn describe(self) -> &'static str {
        match self {
            Self::Learned => "learned",
            Self::Known => "known already; nothing changed",
            Self::NothingSeen => "noted, but nothing seen in that round is held",
            Self::UnknownRound => "no such round is known, or it is too long ago",
            Self::UnknownGesture => {
                "there is no such gesture to do that with: a gesture of the list stays as it is, and of several of one label say whose is meant, \
                 as 'LABEL (INSTRUCTOR)'"
            }
            Self::NoRoom => {
                "no room for another gesture: retire one that is shown no more; or no label for one: choose 1 to 64 bytes that do not end in \
                 '(INSTRUCTOR)'"
            }
            Self::NotLearning => {
                "the robots are not set up to learn: learning.enabled in their configuration"
            }
            Self::NotAllowed => {
                "not allowed: ask whoever has the swarm's authority key for the role (gestalt trust roster shows who may do what, gestalt trust \
                 enrol --client gives it); under a name that has a key nothing may be said without it (--keys)"
            }
        }
    }
}
