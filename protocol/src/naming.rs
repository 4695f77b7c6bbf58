//! Gestures that instructors name while the swarm works, as robots keep that and pass it on.

use serde::{Deserialize, Serialize};

use crate::bounded;
use crate::decode::DecodeError;
use crate::id::{ClassId, InstructorId};
use crate::lesson::SignedWord;

/// The most gestures of which a robot keeps that they were named: retired ones, and those that became another, among them.
pub const MAX_NAMED: usize = 256;

/// The longest label, in bytes.
pub const MAX_LABEL: usize = 64;

/// The most bytes of what a gesture is called: its label, and where another has the same, in brackets who named it.
pub const MAX_TITLE: usize = MAX_LABEL + " ()".len() + InstructorId::MAX_LENGTH;

/// A gesture that somebody named, and what was said of it last. Nothing of it is ever taken out: what was retired can be restored.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Naming {
    /// Who named it.
    pub by: InstructorId,
    /// How: 1 to 64 bytes. With `by` it makes the gesture's number.
    pub label: String,
    /// The higher replaces the lower. In a sealed swarm it is the count that was signed with the latest word on it. In an open one it is one more than
    /// the highest that was known of this gesture to the robot that heard that word.
    pub count: u64,
    /// In an open swarm when that was said, as NTP64. Orders words of one count, which were said to robots that did not hear each other. In a sealed one
    /// the count again.
    pub at: u64,
    /// Who said it: any instructor may.
    pub said_by: InstructorId,
    /// What became of it.
    pub fate: Fate,
    /// The word that says so, as in a [`Lesson`](crate::Lesson).
    pub said: Option<SignedWord>,
}

/// What became of a gesture that was named.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Fate {
    /// It is a gesture of its own.
    InUse,
    /// It is the same as that one, under another name.
    Same(ClassId),
    /// It is shown no more.
    Retired,
}

impl Naming {
    /// Which gesture it names.
    #[must_use]
    pub fn gesture(&self) -> ClassId {
        ClassId::named(&self.by, &self.label)
    }

    fn check(&self) -> Result<(), DecodeError> {
        if !(1..=MAX_LABEL).contains(&self.label.len()) {
            return Err(DecodeError::Impossible("a label that is empty or longer than 64 bytes"));
        }
        match self.fate {
            Fate::Same(other) if !other.is_possible() => {
                Err(DecodeError::Impossible("a gesture that can be none"))
            }
            _ => Ok(()),
        }
    }
}

/// To one neighbour: all that instructors named.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Namings {
    /// One for each gesture.
    #[serde(deserialize_with = "bounded::vec::<_, _, MAX_NAMED>")]
    pub namings: Vec<Naming>,
}

impl Namings {
    pub(crate) fn check(&self) -> Result<(), DecodeError> {
        self.namings.iter().try_for_each(Naming::check)
    }
}
