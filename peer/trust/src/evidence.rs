//! Proof that somebody lies: two different statements under one stamp.

use gestalt_protocol::{DecodeError, RobotId, Signature, Stamp};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::public_key::PublicKey;
use crate::roster::Roster;
use crate::scheme::Scheme;
use crate::signed::{MAX_EVIDENT, Signed};
use crate::statement::{self, Heading};

/// The version byte in front of encoded evidence.
const VERSION: u8 = 1;

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
    /// Against a robot that is not on the roster.
    #[error("robot {0} is not on the roster: bring the newest roster here")]
    Stranger(RobotId),
    /// At least one of the two was not signed by that robot's key.
    #[error("robot {0} did not sign both statements with its key of today")]
    Forged(RobotId),
    /// More evidence against that robot than is checked.
    #[error("more evidence against robot {0} than is checked: it is looked at when it comes again")]
    TooFast(RobotId),
}

/// Two different statements of one author under one stamp, each with its signature: the author said one thing here and another
/// there. Stamps count over all that a robot says, of whatever kind, so an honest robot never does that; nor can anybody else make
/// it look so. A robot whose memory was copied to a second one does: then its key is in two hands.
///
/// It speaks for itself: everybody with the roster checks it, whoever brought it. At most [`Evidence::MAX_LENGTH`] bytes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Evidence {
    first: Signed,
    second: Signed,
}

/// What evidence proves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Conviction {
    /// Who lied.
    pub robot: RobotId,
    /// The key it lied with. With a new key a robot begins anew.
    pub key: PublicKey,
    /// The stamp on both statements.
    pub stamp: Stamp,
}

impl Evidence {
    /// The longest encoding: two statements of [`MAX_EVIDENT`] bytes, their lengths and signatures, the version.
    pub const MAX_LENGTH: usize = 1 + 2 * (3 + MAX_EVIDENT + Signature::LENGTH);

    /// The evidence of these two, in whichever order they were met.
    pub(crate) fn new(one: Signed, other: Signed) -> Self {
        let (first, second) = if one <= other { (one, other) } else { (other, one) };
        Self { first, second }
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
        let heading = statement::heading(&self.first.statement)?;
        if statement::heading(&self.second.statement)? != heading {
            return Err(EvidenceError::Unrelated);
        }
        if self.first.statement == self.second.statement {
            return Err(EvidenceError::Repeated);
        }
        Ok(heading)
    }

    /// Whether it proves that a robot on that roster lied, with the key it has there.
    ///
    /// # Errors
    /// The [`EvidenceError`] that says what it lacks.
    pub fn check<S: Scheme>(&self, roster: &Roster<S>) -> Result<Conviction, EvidenceError> {
        let Heading { author: robot, stamp } = self.heading()?;
        let key = *roster.members().robots.get(&robot).ok_or(EvidenceError::Stranger(robot))?;
        let both = [&self.first, &self.second];
        if both.iter().any(|half| roster.check(&half.statement, &half.signature).is_err()) {
            return Err(EvidenceError::Forged(robot));
        }
        Ok(Conviction { robot, key, stamp })
    }
}
