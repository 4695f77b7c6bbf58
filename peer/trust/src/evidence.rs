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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{authority, members, robot, roster, vote};

    fn signed(statement: Vec<u8>, by: u32) -> Signed {
        let signature = statement::sign(&robot(by), &roster(1).swarm_id(), &statement);
        Signed { statement, signature }
    }

    fn lie() -> Evidence {
        Evidence::new(signed(vote(2, 5, 1.0), 2), signed(vote(2, 5, -1.0), 2))
    }

    #[test]
    fn it_convicts_the_key_that_lied() {
        let stamp = Stamp { boot: 1, sequence: 5 };
        let key = robot(2).public_key();
        assert_eq!(lie().check(&roster(1)), Ok(Conviction { robot: RobotId(2), key, stamp }));
        // After the robot was enrolled anew, it proves nothing against the new key.
        let mut later = members(2);
        later.robots.insert(RobotId(2), robot(22).public_key());
        assert_eq!(lie().check(&later.sign(&authority()).unwrap()), Err(EvidenceError::Forged(RobotId(2))));
        let mut gone = members(2);
        gone.robots.remove(&RobotId(2));
        assert_eq!(lie().check(&gone.sign(&authority()).unwrap()), Err(EvidenceError::Stranger(RobotId(2))));
    }

    #[test]
    fn nobody_can_make_an_honest_robot_look_like_a_liar() {
        let said = signed(vote(2, 5, 1.0), 2);
        let check = |other| Evidence::new(said.clone(), other).check(&roster(1));
        assert_eq!(check(said.clone()), Err(EvidenceError::Repeated));
        assert_eq!(check(signed(vote(2, 6, -1.0), 2)), Err(EvidenceError::Unrelated));
        assert_eq!(check(signed(vote(3, 5, -1.0), 3)), Err(EvidenceError::Unrelated));
        assert_eq!(check(signed(vote(2, 5, -1.0), 3)), Err(EvidenceError::Forged(RobotId(2))));
        // A second valid signature under the same statement is no second statement.
        let again = Signed { signature: Signature::from_bytes([1; 64]), ..said.clone() };
        assert_eq!(check(again), Err(EvidenceError::Repeated));
        let junk = Signed { statement: vec![1, 2, 3], ..said.clone() };
        assert!(matches!(check(junk), Err(EvidenceError::Malformed(_))));
        // Said in another swarm under the same stamp.
        let elsewhere = gestalt_protocol::Envelope::decode(&vote(2, 5, -1.0)).unwrap().encode();
        let swarm = statement::SwarmId::new(&authority().public_key(), "other");
        let signature = statement::sign(&robot(2), &swarm, &elsewhere);
        let elsewhere = Signed { statement: elsewhere, signature };
        assert_eq!(check(elsewhere), Err(EvidenceError::Forged(RobotId(2))));
    }

    #[test]
    fn it_travels_in_bytes_and_in_text() {
        let bytes = lie().encode();
        assert_eq!(Evidence::decode(&bytes), Ok(lie()));
        assert_eq!(bytes.len(), 1 + 2 * (1 + vote(2, 5, 1.0).len() + 64));
        let json = serde_json::to_string(&lie()).unwrap();
        assert_eq!(serde_json::from_str::<Evidence>(&json).unwrap(), lie());
        assert!(serde_json::from_str::<Evidence>(&json.replace("\"03", "\"3")).is_err());
        for cut in 0..bytes.len() {
            assert!(Evidence::decode(&bytes[..cut]).is_err(), "{cut}");
        }
        assert_eq!(Evidence::decode(&[bytes.as_slice(), &[0]].concat()), Err(DecodeError::Trailing(1)));
        assert!(matches!(Evidence::decode(&[2]), Err(DecodeError::Impossible(_))));
    }

    #[test]
    fn it_is_bounded() {
        let mut statement = vote(2, 5, 1.0);
        statement.resize(MAX_EVIDENT, 0);
        let largest = Evidence::new(signed(statement.clone(), 2), signed(statement.clone(), 2));
        assert_eq!(largest.encode().len(), Evidence::MAX_LENGTH);
        assert_eq!(Evidence::decode(&largest.encode()), Ok(largest));
        statement.push(0);
        let larger = Evidence::new(signed(statement, 2), signed(vote(2, 5, 1.0), 2));
        assert!(Evidence::decode(&larger.encode()).is_err());
        assert!(serde_json::from_str::<Evidence>(&serde_json::to_string(&larger).unwrap()).is_err());
        let long = vec![VERSION; Evidence::MAX_LENGTH + 1];
        assert!(matches!(Evidence::decode(&long), Err(DecodeError::TooLong { .. })));
    }
}
