//! The envelope around every message between robots, and the bounded reading of it.

use serde::{Deserialize, Serialize};

use crate::announcement::{Announced, Announcement};
use crate::decision::{Certificate, Decision};
use crate::decode::{DecodeError, encode_versioned, take_versioned};
use crate::holding::Holder;
use crate::id::{ClassId, RobotId, Stamp};
use crate::limits::MAX_MESSAGE;
use crate::message::Message;
use crate::question::{Asked, Question};
use crate::sample::HeldBatch;
use crate::signature::Signature;
use crate::vote::{HeldVote, Vote};

/// A message with its author's name and stamp on it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Envelope {
    /// Who says it.
    pub author: RobotId,
    /// Its place among all this author says.
    pub stamp: Stamp,
    /// What is said.
    pub message: Message,
    /// By which the author stands by all of it; robots of an open swarm sign nothing. `gestalt-trust` makes and checks it.
    #[serde(skip)]
    pub signature: Option<Signature>,
}

impl Envelope {
    /// The bytes that travel: the [statement](Envelope::statement), then the 64 bytes of the signature, if there is one.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = self.statement();
        bytes.extend(self.signature.iter().flat_map(Signature::as_bytes));
        bytes
    }

    /// What is signed: the version byte, then author, stamp and message in postcard.
    #[must_use]
    pub fn statement(&self) -> Vec<u8> {
        encode_versioned(self)
    }

    /// Reads what [`Envelope::encode`] wrote.
    ///
    /// # Errors
    /// See [`DecodeError`]; the check of the values is part of the decoding.
    pub fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        let (envelope, rest): (Self, _) = take_versioned(bytes, MAX_MESSAGE)?;
        let signature = match rest {
            [] => None,
            rest => Some(
                rest.try_into().map(Signature::from_bytes).map_err(|_| DecodeError::Trailing(rest.len()))?,
            ),
        };
        envelope.message.check()?;
        Ok(Self { signature, ..envelope })
    }
}

impl From<HeldVote> for Envelope {
    /// The vote as its author said it.
    fn from(held: HeldVote) -> Self {
        let HeldVote { robot, stamp, vote, signature } = held;
        Self { author: robot, stamp, message: Message::Vote(vote), signature }
    }
}

impl From<HeldBatch> for Envelope {
    /// The batch as its author said it.
    fn from(held: HeldBatch) -> Self {
        let HeldBatch { robot, stamp, samples, signature } = held;
        Self { author: robot, stamp, message: Message::Samples(samples), signature }
    }
}

impl From<Holder> for Envelope {
    /// The word as its robot said it.
    fn from(holder: Holder) -> Self {
        let Holder { robot, stamp, holding, signature } = holder;
        Self { author: robot, stamp, message: Message::Holding(holding), signature }
    }
}

impl Announcement {
    /// What was said, by the robot that said it; `None` for another message.
    #[must_use]
    pub fn of(said: Envelope) -> Option<Self> {
        let Envelope { author: announcer, stamp, message: Message::Announced(announced), signature } = said
        else {
            return None;
        };
        let Announced { decision, label } = announced;
        Some(Self { decision, label, announcer, stamp, signature })
    }
}

impl From<Announcement> for Envelope {
    /// The announcement as its announcer signed it.
    fn from(announcement: Announcement) -> Self {
        let Announcement { decision, label, announcer, stamp, signature } = announcement;
        let message = Message::Announced(Announced { decision, label });
        Self { author: announcer, stamp, message, signature }
    }
}

impl Question {
    /// What was asked, by the robot that asked it; `None` for another message.
    #[must_use]
    pub fn of(said: Envelope) -> Option<Self> {
        let Envelope { author: robot, stamp, message: Message::Asked(asked), signature } = said else {
            return None;
        };
        let Asked { round, ask, labels, entropy, disagreement } = asked;
        Some(Self { round, ask, labels, entropy, disagreement, robot, stamp, signature })
    }
}

impl From<Question> for Envelope {
    /// The question as its asker signed it.
    fn from(question: Question) -> Self {
        let Question { round, ask, labels, entropy, disagreement, robot, stamp, signature } = question;
        let message = Message::Asked(Asked { round, ask, labels, entropy, disagreement });
        Self { author: robot, stamp, message, signature }
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
            Self::Batches(batches) => batches.batches.iter().try_for_each(HeldBatch::check),
            Self::Give(give) => {
                give.decision.iter().try_for_each(Decision::check)?;
                give.votes.iter().try_for_each(|held| held.vote.check())?;
                give.holders.iter().try_for_each(|holder| holder.holding.check())
            }
            Self::Holding(holding) => holding.check(),
            Self::Announced(announced) => announced.check(),
            Self::Namings(namings) => namings.check(),
            Self::Asked(asked) => asked.check(),
        }
    }
}

impl Vote {
    /// Whether every value is one that a robot may say.
    ///
    /// # Errors
    /// [`DecodeError::Impossible`] names what is wrong.
    pub fn check(&self) -> Result<(), DecodeError> {
        if self.listed() < 2 && !self.evidence.is_empty() {
            return Err(DecodeError::Impossible("evidence over fewer than two gestures of the list"));
        }
        let in_order =
            self.named.is_sorted_by(|a, b| a < b) && self.named.iter().all(|class| class.is_named());
        if self.named.len() > self.evidence.len() || !in_order {
            return Err(DecodeError::Impossible("gestures that were not named, twice, or out of order"));
        }
        if !self.evidence.iter().all(|e| e.is_finite()) {
            return Err(DecodeError::Impossible("evidence that is not finite"));
        }
        if !self.unknown.is_none_or(f32::is_finite) {
            return Err(DecodeError::Impossible("evidence for unknown that is not finite"));
        }
        if self.unknown.is_some() && self.evidence.is_empty() {
            return Err(DecodeError::Impossible("evidence for unknown where nothing was seen"));
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
        let Certificate { pool, named, probabilities, unknown, votes, others, terms, .. } = &self.certificate;
        let probability = |p: f64| (0.0..=1.0).contains(&p);
        let known = |class: ClassId| self.certificate.place(class).is_some();
        let in_order = named.is_sorted_by(|a, b| a < b) && named.iter().all(|class| class.is_named());
        if named.len() > probabilities.len() || !in_order {
            return Err(DecodeError::Impossible("gestures that were not named, twice, or out of order"));
        }
        if !(probability(self.confidence) && probabilities.iter().chain(unknown).copied().all(probability)) {
            return Err(DecodeError::Impossible("a probability outside 0..=1"));
        }
        if !pool.is_none_or(|pool| pool.is_sound()) {
            return Err(DecodeError::Impossible("a pool of an impossible likeness or temperature"));
        }
        if !terms.is_sound() {
            return Err(DecodeError::Impossible("terms that no robot can decide by"));
        }
        if !self.class.is_none_or(known) || !votes.iter().all(|counted| known(counted.class)) {
            return Err(DecodeError::Impossible("a class outside the vocabulary"));
        }
        if !votes.iter().all(|counted| counted.weight.is_finite() && counted.weight >= 0.0) {
            return Err(DecodeError::Impossible("a negative or infinite weight"));
        }
        let in_order =
            votes.is_sorted_by(|a, b| a.robot < b.robot) && others.is_sorted_by(|a, b| a.robot < b.robot);
        let counted = |robot| votes.binary_search_by_key(&robot, |counted| counted.robot).is_ok();
        if !in_order || others.iter().any(|held| counted(held.robot)) {
            return Err(DecodeError::Impossible("a robot counted twice, or out of order"));
        }
        if votes.iter().any(|counted| counted.vote.listed() != self.certificate.listed()) {
            return Err(DecodeError::Impossible("a counted vote over other classes"));
        }
        votes
            .iter()
            .map(|counted| &counted.vote)
            .chain(others.iter().map(|held| &held.vote))
            .try_for_each(Vote::check)
    }
}
