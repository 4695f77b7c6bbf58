//! The envelope around every message between robots, and the bounded reading of it.

use serde::{Deserialize, Serialize};

use crate::decision::Decision;
use crate::decode::DecodeError;
use crate::id::{ClassId, RobotId, Stamp};
use crate::limits::{MAX_MESSAGE, PROTOCOL_VERSION};
use crate::message::{Message, Vote};

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
