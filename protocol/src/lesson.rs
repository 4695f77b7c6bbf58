//! What instructors said of rounds, as robots keep it and pass it on.

use serde::{Deserialize, Serialize};

use crate::bounded;
use crate::decode::{DecodeError, decode_json};
use crate::id::{ClassId, InstructorId, RoundId};
use crate::instruction::Instruction;
use crate::signature::Signature;

/// The most rounds of which a robot keeps what was said.
pub const MAX_LESSONS: usize = 1024;

/// The longest word that a sealed swarm heeds, in bytes of JSON: its robots keep it and pass it on.
pub const MAX_WORD: usize = 1024;

/// The longest attachment of a word, in bytes.
pub const MAX_ATTACHMENT: usize = 1 + 4 + 8 + Signature::LENGTH;

/// A word to the last byte, and that by which it is known whose it is. Robots of a sealed swarm pass both on as they heard them, so that nobody
/// need trust who does; `gestalt-trust` makes and checks attachments.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct SignedWord {
    /// The JSON of an [`Instruction`], at most [`MAX_WORD`] bytes.
    #[serde(deserialize_with = "bounded::vec::<_, _, MAX_WORD>")]
    pub word: Vec<u8>,
    /// Who signed it, its count and the signature, at most [`MAX_ATTACHMENT`] bytes.
    #[serde(deserialize_with = "bounded::vec::<_, _, MAX_ATTACHMENT>")]
    pub attachment: Vec<u8>,
}

impl SignedWord {
    /// What was said.
    ///
    /// # Errors
    /// As [`decode_json`].
    pub fn instruction(&self) -> Result<Instruction, DecodeError> {
        decode_json(&self.word)
    }
}

/// One instructor's latest word on one round.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Lesson {
    /// The round it is about.
    pub round: RoundId,
    /// Who said it.
    pub instructor: InstructorId,
    /// Of one instructor's words the higher replaces the lower. In a sealed swarm it is the count that was signed with the word. In an open one it is
    /// one more than the highest that was known on this round, from whomever, to the robot that heard it said: there nobody's clock orders words, so
    /// none that is wrong, or claimed, can put one beyond correction.
    pub count: u64,
    /// In an open swarm when, as NTP64: the Zenoh timestamp of the client's message or, where it has none, when it was heard. Orders words of one count,
    /// which were said to robots that did not hear each other. In a sealed one the count again.
    pub at: u64,
    /// What was said.
    pub word: Word,
    /// The word that it is made of, in a sealed swarm. Without it a lesson is believed by nobody but the robot that has it.
    pub said: Option<SignedWord>,
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
