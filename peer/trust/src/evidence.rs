//! Proof that somebody lies: two different statements under one stamp, two samples under one number, or a decision that does not follow from its votes.

use std::fmt;

use gestalt_protocol::{
    Announced, Decision, DecodeError, Envelope, Give, HeldBatch, MAX_MESSAGE, Message, RobotId, Samples,
    SharedSample, Signature, Stamp,
};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::public_key::PublicKey;
use crate::roster::Roster;
use crate::scheme::Scheme;
use crate::signed::{MAX_EVIDENT, MAX_SIGNED, Signed};
use crate::statement::{self, Heading};

/// The longest statement that can be one of two batches, in bytes: robots share half a kilobyte to sixteen at once.
const MAX_BATCH: usize = 2 * MAX_EVIDENT;

/// The version byte in front of encoded evidence.
const VERSION: u8 = 2;

/// Whether a decision contradicts the votes that it brings with it, whoever asks: `is_refuted` of `gestalt-rounds`, of which nothing is known here. It says
/// the same of the same decision everywhere, or robots would not agree on who lied.
pub type Refutes = fn(&Decision) -> bool;

/// Evidence that proves nothing, or not yet.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum EvidenceError {
    /// Not the encoding of evidence, or of something that has no author.
    #[error("malformed evidence: {0}")]
    Malformed(#[from] DecodeError),
    /// Twice the same statement: robots repeat themselves by design.
    #[error("the same statement twice, which robots do by design")]
    Repeated,
    /// By two authors, or under two stamps.
    #[error("two statements of different authors or stamps, which may well differ")]
    Unrelated,
    /// Two batches of samples that may stand side by side: no number is in both, or the same sample is.
    #[error("two statements in which no two samples have one number")]
    Compatible,
    /// A single statement that gives no decision.
    #[error("one statement, and no decision in it")]
    Undecided,
    /// A decision that may well follow from its votes, by the terms that it states.
    #[error("a decision that may well follow from its votes")]
    Founded,
    /// Against a robot that is not on the roster.
    #[error("robot {0} is not on the roster: bring the newest roster here")]
    Stranger(RobotId),
    /// What it rests on was not signed by that robot's key, or not all of it.
    #[error("robot {0} did not sign all of it with its key of today")]
    Forged(RobotId),
    /// More evidence against that robot than is checked.
    #[error("more evidence against robot {0} than is checked: it is looked at when it comes again")]
    TooFast(RobotId),
}

/// What lies are proven.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Lie {
    /// One thing here and another there.
    TwoThings,
    /// One sample here and another there, as one.
    TwoSamples,
    /// A decision that the votes it brings do not make.
    Unfounded,
}

impl fmt::Display for Lie {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TwoThings => "said two things under one stamp: it lies, or its key is in two hands",
            Self::TwoSamples => "shared two samples under one number: it lies, or its key is in two hands",
            Self::Unfounded => {
                "gave a decision that does not follow from its votes: it lies, or runs a program that is not Gestalt's"
            }
        })
    }
}

/// Two different statements of one author under one stamp, each with its signature: the author said one thing here and another
/// there. Stamps count over all that a robot says, of whatever kind, so an honest robot never does that; nor can anybody else make
/// it look so. A robot whose memory was copied to a second one does: then its key is in two hands.
///
/// Or two batches of one author in which one number is that of different samples: robots number what they share in a life whose number was drawn at random,
/// so that two lives do not meet.
///
/// Or a decision that its author gave or announced, and signed, which contradicts the votes that it brings: whoever concluded it, robots pass on what they have
/// looked into. Whether those votes were cast does not matter.
///
/// It speaks for itself: everybody with the roster checks it, whoever brought it. At most [`Evidence::MAX_LENGTH`] bytes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Proof")]
pub struct Evidence(Proof);

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum Proof {
    TwoThings { first: Signed, second: Signed },
    Unfounded(Signed),
    TwoSamples { first: Signed, second: Signed },
}

impl TryFrom<Proof> for Evidence {
    type Error = DecodeError;

    fn try_from(proof: Proof) -> Result<Self, DecodeError> {
        let (first, second, limit) = match &proof {
            Proof::TwoThings { first, second } => (first, second, MAX_EVIDENT),
            Proof::TwoSamples { first, second } => (first, second, MAX_BATCH),
            Proof::Unfounded(_) => return Ok(Self(proof)),
        };
        let length = first.statement.len().max(second.statement.len());
        if length > limit { Err(DecodeError::TooLong { length, limit }) } else { Ok(Self(proof)) }
    }
}

/// What evidence proves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Conviction {
    /// Who lied.
    pub robot: RobotId,
    /// The key it lied with. With a new key a robot begins anew.
    pub key: PublicKey,
    /// The stamp on what it said.
    pub stamp: Stamp,
    /// What the lie was.
    pub lie: Lie,
}

impl Evidence {
    /// The longest encoding: that of a decision with a little less than what fits in a message.
    pub const MAX_LENGTH: usize = MAX_MESSAGE;

    /// The evidence of these two, in whichever order they were met.
    pub(crate) fn of_two(one: Signed, other: Signed) -> Self {
        let (first, second) = in_order(one, other);
        Self(Proof::TwoThings { first, second })
    }

    /// That of two batches of one author, which share two samples under one number; `None` if one is not signed, or too long to be passed on.
    #[must_use]
    pub fn of_batches(one: HeldBatch, other: HeldBatch) -> Option<Self> {
        let said = |batch: HeldBatch| {
            let said = Envelope::from(batch);
            Some(Signed { statement: said.statement(), signature: said.signature? })
        };
        let (first, second) = in_order(said(one)?, said(other)?);
        Self::try_from(Proof::TwoSamples { first, second }).ok()
    }

    /// That of a statement that gives or announces a decision, with its author's signature.
    #[must_use]
    pub fn of_decision(statement: Vec<u8>, signature: Signature) -> Self {
        Self(Proof::Unfounded(Signed { statement, signature }))
    }

    /// What lie it is evidence of.
    #[must_use]
    pub fn lie(&self) -> Lie {
        match self.0 {
            Proof::TwoThings { .. } => Lie::TwoThings,
            Proof::TwoSamples { .. } => Lie::TwoSamples,
            Proof::Unfounded(_) => Lie::Unfounded,
        }
    }

    /// How many bytes its statements have.
    pub(crate) fn length(&self) -> usize {
        match &self.0 {
            Proof::TwoThings { first, second } | Proof::TwoSamples { first, second } => {
                first.statement.len() + second.statement.len()
            }
            Proof::Unfounded(said) => said.statement.len(),
        }
    }

    /// The bytes that travel: a version byte, then postcard.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        postcard::to_extend(self, vec![VERSION])
            .expect("memory is the only thing that writing to a vector can lack")
    }

    /// Reads what [`Evidence::encode`] wrote. Whether it proves anything is found by [`Evidence::check`].
    ///
    /// # Errors
    /// See [`DecodeError`].
    pub fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        if bytes.len() > Self::MAX_LENGTH {
            return Err(DecodeError::TooLong { length: bytes.len(), limit: Self::MAX_LENGTH });
        }
        let (&version, body) = bytes.split_first().ok_or(DecodeError::Empty)?;
        if version != VERSION {
            return Err(DecodeError::Impossible("another version of evidence"));
        }
        let (evidence, rest) = postcard::take_from_bytes::<Self>(body)
            .map_err(|error| DecodeError::Malformed(error.to_string()))?;
        if rest.is_empty() { Ok(evidence) } else { Err(DecodeError::Trailing(rest.len())) }
    }

    /// Whom it is against, and under which stamp, by its own words.
    ///
    /// # Errors
    /// [`EvidenceError`] for two statements that may well stand side by side, whoever signed them.
    pub fn heading(&self) -> Result<Heading, EvidenceError> {
        match &self.0 {
            Proof::TwoThings { first, second } => {
                let heading = statement::heading(&first.statement)?;
                if statement::heading(&second.statement)? != heading {
                    return Err(EvidenceError::Unrelated);
                }
                if first.statement == second.statement {
                    return Err(EvidenceError::Repeated);
                }
                Ok(heading)
            }
            Proof::TwoSamples { first, second } => {
                let heading = statement::heading(&first.statement)?;
                if statement::heading(&second.statement)?.author != heading.author {
                    return Err(EvidenceError::Unrelated);
                }
                Ok(heading)
            }
            Proof::Unfounded(said) if said.statement.len() > MAX_SIGNED => {
                Err(DecodeError::TooLong { length: said.statement.len(), limit: MAX_SIGNED }.into())
            }
            Proof::Unfounded(said) => Ok(statement::heading(&said.statement)?),
        }
    }

    /// Whether it proves that a robot on that roster lied, with the key it has there. A decision is looked into last, once it is known who gave it.
    ///
    /// # Errors
    /// The [`EvidenceError`] that says what it lacks.
    pub fn check<S: Scheme>(
        &self,
        roster: &Roster<S>,
        refutes: Refutes,
    ) -> Result<Conviction, EvidenceError> {
        let Heading { author: robot, stamp } = self.heading()?;
        let key = *roster.members().robots.get(&robot).ok_or(EvidenceError::Stranger(robot))?;
        let is_signed = |said: &Signed| roster.check(&said.statement, &said.signature).is_ok();
        let signed = match &self.0 {
            Proof::TwoThings { first, second } | Proof::TwoSamples { first, second } => {
                is_signed(first) && is_signed(second)
            }
            Proof::Unfounded(said) => is_signed(said),
        };
        if !signed {
            return Err(EvidenceError::Forged(robot));
        }
        if let Proof::Unfounded(said) = &self.0
            && !refutes(&decision_in(&said.statement)?)
        {
            return Err(EvidenceError::Founded);
        }
        if let Proof::TwoSamples { first, second } = &self.0
            && !contradict(&samples_in(&first.statement)?, &samples_in(&second.statement)?)
        {
            return Err(EvidenceError::Compatible);
        }
        Ok(Conviction { robot, key, stamp, lie: self.lie() })
    }
}

fn in_order(one: Signed, other: Signed) -> (Signed, Signed) {
    if one <= other { (one, other) } else { (other, one) }
}

fn samples_in(statement: &[u8]) -> Result<Samples, EvidenceError> {
    match statement::read(statement)?.message {
        Message::Samples(samples) => Ok(samples),
        _ => Err(EvidenceError::Compatible),
    }
}

/// Whether a sample of the one batch and another one of the other have one name.
fn contradict(one: &Samples, other: &Samples) -> bool {
    let differs = |sample: &SharedSample| one.space != other.space || !other.samples.contains(sample);
    let in_both = |sample: &SharedSample| other.samples.iter().any(|theirs| theirs.id == sample.id);
    one.samples.iter().any(|sample| in_both(sample) && differs(sample))
}

/// The decision that a statement gives or announces.
fn decision_in(statement: &[u8]) -> Result<Decision, EvidenceError> {
    match statement::read(statement)?.message {
        Message::Give(Give { decision: Some(decision), .. })
        | Message::Announced(Announced { decision, .. }) => Ok(decision),
        _ => Err(EvidenceError::Undecided),
    }
}

#[cfg(test)]
mod tests;
