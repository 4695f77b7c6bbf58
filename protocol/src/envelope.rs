//! The envelope around every message between robots, and the bounded reading of it.

use serde::{Deserialize, Serialize, de::DeserializeOwned};
use thiserror::Error;

use crate::{ClassId, Decision, Message, RobotId, Stamp, Vote};

/// The version byte in front of every envelope. Another version is refused, not guessed at.
pub const PROTOCOL_VERSION: u8 = 2;

/// The longest envelope accepted, in bytes.
pub const MAX_MESSAGE: usize = 512 * 1024;

/// The longest JSON document accepted, in bytes.
pub const MAX_JSON: usize = 1024 * 1024;

/// The most memory that reading one message can allocate, in bytes, whatever the message claims: a message of
/// [`MAX_MESSAGE`] bytes, each element of which is larger in memory than on the wire.
pub const MAX_ALLOCATION: usize = 64 * MAX_MESSAGE;

/// Bytes that are no message. Nothing of a refused message is kept.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum DecodeError {
    /// No bytes at all.
    #[error("empty message")]
    Empty,
    /// Longer than the limit; it was not looked into.
    #[error("message of {length} bytes, at most {limit} are accepted")]
    TooLong {
        /// How long it is.
        length: usize,
        /// How long it may be.
        limit: usize,
    },
    /// Written by another version of the protocol.
    #[error(
        "protocol version {found}, this robot speaks {PROTOCOL_VERSION}: run the same release on all robots"
    )]
    Version {
        /// The version byte found.
        found: u8,
    },
    /// Not the encoding of any message, or cut short.
    #[error("malformed message: {0}")]
    Malformed(String),
    /// A message followed by further bytes.
    #[error("{0} bytes after the end of the message")]
    Trailing(usize),
    /// Well-formed, but with a value no robot may say.
    #[error("impossible value: {0}")]
    Impossible(&'static str),
}

/// A message with its author's name and stamp on it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Envelope {
    /// Who says it.
    pub author: RobotId,
    /// Its place among all this author says.
    pub stamp: Stamp,
    /// What is said.
    pub message: Message,
}

impl Envelope {
    /// The bytes that travel: the version byte, then the envelope in postcard.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        postcard::to_extend(self, vec![PROTOCOL_VERSION])
            .expect("memory is the only thing that writing to a vector can lack")
    }

    /// Reads what [`Envelope::encode`] wrote.
    ///
    /// # Errors
    /// See [`DecodeError`]; the check of the values is part of the decoding.
    pub fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        if bytes.len() > MAX_MESSAGE {
            return Err(DecodeError::TooLong { length: bytes.len(), limit: MAX_MESSAGE });
        }
        let (&version, body) = bytes.split_first().ok_or(DecodeError::Empty)?;
        if version != PROTOCOL_VERSION {
            return Err(DecodeError::Version { found: version });
        }
        let (envelope, rest) = postcard::take_from_bytes::<Self>(body)
            .map_err(|error| DecodeError::Malformed(error.to_string()))?;
        if !rest.is_empty() {
            return Err(DecodeError::Trailing(rest.len()));
        }
        envelope.message.check()?;
        Ok(envelope)
    }
}

/// Reads a JSON document of at most [`MAX_JSON`] bytes, as clients and instructors write it.
///
/// # Errors
/// [`DecodeError::TooLong`] and [`DecodeError::Malformed`].
pub fn decode_json<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, DecodeError> {
    if bytes.is_empty() {
        return Err(DecodeError::Empty);
    }
    if bytes.len() > MAX_JSON {
        return Err(DecodeError::TooLong { length: bytes.len(), limit: MAX_JSON });
    }
    serde_json::from_slice(bytes).map_err(|error| DecodeError::Malformed(error.to_string()))
}

impl Message {
    fn check(&self) -> Result<(), DecodeError> {
        match self {
            Self::Vote(vote) => vote.check(),
            Self::Have(_) => Ok(()),
            Self::Samples(samples) => samples.check(),
            Self::Know(know) => know.check(),
            Self::Lessons(lessons) => lessons.check(),
            Self::Give(give) => {
                give.decision.iter().try_for_each(Decision::check)?;
                give.votes.iter().try_for_each(|held| held.vote.check())
            }
        }
    }
}

impl Vote {
    /// Whether every value is one that a robot may say.
    ///
    /// # Errors
    /// [`DecodeError::Impossible`] names what is wrong.
    pub fn check(&self) -> Result<(), DecodeError> {
        if self.evidence.len() == 1 {
            return Err(DecodeError::Impossible("evidence over a single class"));
        }
        if !self.evidence.iter().all(|e| e.is_finite()) {
            return Err(DecodeError::Impossible("evidence that is not finite"));
        }
        if !(self.looks.is_finite() && self.looks >= 0.0) {
            return Err(DecodeError::Impossible("a negative or infinite number of looks"));
        }
        Ok(())
    }
}

impl Decision {
    /// Whether every value is one that a robot may say.
    ///
    /// # Errors
    /// [`DecodeError::Impossible`] names what is wrong.
    pub fn check(&self) -> Result<(), DecodeError> {
        let probability = |p: f64| (0.0..=1.0).contains(&p);
        let classes = self.certificate.probabilities.len();
        let known = |class: ClassId| class.index() < classes;
        if !(probability(self.confidence) && self.certificate.probabilities.iter().copied().all(probability))
        {
            return Err(DecodeError::Impossible("a probability outside 0..=1"));
        }
        if !self.class.is_none_or(known) || !self.certificate.votes.iter().all(|vote| known(vote.class)) {
            return Err(DecodeError::Impossible("a class outside the vocabulary"));
        }
        if !self.certificate.votes.iter().all(|vote| vote.weight.is_finite() && vote.weight >= 0.0) {
            return Err(DecodeError::Impossible("a negative or infinite weight"));
        }
        if !self.certificate.votes.is_sorted_by(|a, b| a.robot < b.robot) {
            return Err(DecodeError::Impossible("a robot counted twice, or out of order"));
        }
        Ok(())
    }
}
