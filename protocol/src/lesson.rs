//! What instructors said of rounds, as robots keep it and pass it on.

use serde::{Deserialize, Serialize};

use crate::id::{ClassId, InstructorId, RoundId};

/// The most rounds of which a robot keeps what was said.
pub const MAX_LESSONS: usize = 1024;

/// One instructor's latest word on one round.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Lesson {
    /// The round it is about.
    pub round: RoundId,
    /// Who said it.
    pub instructor: InstructorId,
    /// One more than the highest that was known on this round, from whomever, to the robot that heard it said: the higher
    /// replaces the lower. No clock orders words, so none that is wrong, or claimed, can put one beyond correction.
    pub count: u64,
    /// When, as NTP64: the Zenoh timestamp of the client's message or, where it has none, when it was heard. Orders words of one count, which were said
    /// to robots that did not hear each other.
    pub at: u64,
    /// What was said.
    pub word: Word,
}

/// What an instructor can say of the gesture of a round.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Word {
    /// It was this one.
    Was(ClassId),
    /// It was any but this one.
    Not(ClassId),
    /// Nothing: what this instructor had said is taken back.
    Retracted,
}
