//! What a signature under a message covers.

use std::fmt;

use gestalt_protocol::hex::Hex;
use gestalt_protocol::{DecodeError, Envelope, MAX_MESSAGE, PROTOCOL_VERSION, RobotId, Signature, Stamp};
use sha2::{Digest, Sha256};

use crate::identity::Identity;
use crate::public_key::PublicKey;
use crate::scheme::Scheme;

/// Stands first under every signature of a statement, so that it is never taken for one of anything else.
pub const STATEMENT_DOMAIN: &[u8; 20] = b"gestalt-statement-1\0";

/// Which swarm something is said in: SHA-256 over `gestalt-swarm-1`, the authority's public key and the swarm's name.
///
/// It is signed with everything and never sent. So what was said in one swarm counts in no other, not even in one of the same
/// name.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SwarmId([u8; 32]);

impl SwarmId {
    /// The swarm of that name under that authority.
    #[must_use]
    pub fn new(authority: &PublicKey, name: &str) -> Self {
        let hash = Sha256::new()
            .chain_update("gestalt-swarm-1")
            .chain_update(authority.as_bytes())
            .chain_update(name);
        Self(hash.finalize().into())
    }

    /// Its bytes.
    #[must_use]
    pub const fn as_bytes(&self) -> &[u8; 32] {
        &self.0
    }
}

impl fmt::Display for SwarmId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Hex(&self.0).fmt(f)
    }
}

impl fmt::Debug for SwarmId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "SwarmId({self})")
    }
}

/// Whose statement it is, and which one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heading {
    /// Who says it, by its own words: the signature shows whether it is true.
    pub author: RobotId,
    /// Its place among all that this author says.
    pub stamp: Stamp,
}

/// Reads the heading of a statement, the bytes of [`Envelope::encode`], without looking into the rest of it.
///
/// # Errors
/// [`DecodeError`], also for a heading that is spelt otherwise than `encode` does.
pub fn heading(statement: &[u8]) -> Result<Heading, DecodeError> {
    if statement.len() > MAX_MESSAGE {
        return Err(DecodeError::TooLong { length: statement.len(), limit: MAX_MESSAGE });
    }
    let (&version, body) = statement.split_first().ok_or(DecodeError::Empty)?;
    if version != PROTOCOL_VERSION {
        return Err(DecodeError::Version { found: version });
    }
    let (heading, _): ((RobotId, Stamp), _) =
        postcard::take_from_bytes(body).map_err(|error| DecodeError::Malformed(error.to_string()))?;
    // Three numbers of at most five bytes each.
    let mut spelling = [0; 15];
    let spelling = postcard::to_slice(&heading, &mut spelling).expect("three numbers fit");
    if !body.starts_with(spelling) {
        return Err(MISSPELT);
    }
    Ok(Heading { author: heading.0, stamp: heading.1 })
}

/// Reads a statement, the bytes of [`Envelope::encode`]: those, and no others that would read the same.
///
/// A robot that passes the message on encodes it anew, and the signature must hold over what it then sends.
///
/// # Errors
/// [`DecodeError`], also for bytes that are spelt otherwise than `encode` does.
pub fn read(statement: &[u8]) -> Result<Envelope, DecodeError> {
    let envelope = Envelope::decode(statement)?;
    if envelope.encode() == statement { Ok(envelope) } else { Err(MISSPELT) }
}

const MISSPELT: DecodeError = DecodeError::Impossible("a number longer than it needs to be");

/// The bytes that a signature under a statement covers: [`STATEMENT_DOMAIN`], the swarm's 32 bytes, the statement.
#[must_use]
pub fn signed_bytes(swarm: &SwarmId, statement: &[u8]) -> Vec<u8> {
    [STATEMENT_DOMAIN.as_slice(), swarm.as_bytes(), statement].concat()
}

/// Signs a statement, the bytes of [`Envelope::encode`], as said in that swarm.
#[must_use]
pub fn sign<S: Scheme>(identity: &Identity<S>, swarm: &SwarmId, statement: &[u8]) -> Signature {
    identity.sign(&signed_bytes(swarm, statement))
}

/// Whether that key signed that statement in that swarm. Whose key it should be, a [`Roster`](crate::Roster) knows.
#[must_use]
pub fn is_signed<S: Scheme>(key: &S::Key, swarm: &SwarmId, statement: &[u8], signature: &Signature) -> bool {
    S::verify(key, &signed_bytes(swarm, statement), signature)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{have, robot, vote};

    #[test]
    fn the_signed_bytes_are_domain_swarm_and_statement() {
        let swarm = SwarmId::new(&PublicKey::from_bytes([7; 32]), "demo");
        let bytes = signed_bytes(&swarm, b"said");
        assert_eq!(bytes, [b"gestalt-statement-1\0".as_slice(), swarm.as_bytes(), b"said"].concat());
        // sha256 of the text, 32 bytes of 7 and the name, by another program: what is signed never changes.
        assert_eq!(format!("{swarm:?}"), format!("SwarmId({swarm})"));
        assert_eq!(swarm.to_string(), "676f09d996cb08995de9910895303efa50eea6cd9765a4f5282f2338c24593b7");
        assert_eq!(
            sign(&robot(0), &swarm, b"said").to_string(),
            "1b4d354010ba0cae21cd67098c2515ed9e5dc988b686e4dd09b784e3123604b49bd19ecf557a25995d1e24fae0eadd3048f6fe9f614518a8f70ec096ed600d0d"
        );
    }

    #[test]
    fn a_swarm_is_its_authority_and_its_name() {
        let id = |key, name| SwarmId::new(&PublicKey::from_bytes([key; 32]), name);
        assert_eq!(id(1, "demo"), id(1, "demo"));
        assert_ne!(id(1, "demo"), id(2, "demo"));
        assert_ne!(id(1, "demo"), id(1, "demo2"));
    }

    #[test]
    fn the_heading_is_that_of_the_envelope() {
        for statement in [vote(3, 5, 1.0), have(u32::MAX, u32::MAX)] {
            let envelope = read(&statement).unwrap();
            let expected = Heading { author: envelope.author, stamp: envelope.stamp };
            assert_eq!(heading(&statement), Ok(expected));
        }
    }

    #[test]
    fn a_statement_has_one_spelling() {
        let vote = vote(3, 5, 1.0);
        // 3 in two bytes reads the same, but is not what a robot that passes it on would send.
        let longer = [&vote[..1], &[0x83, 0x00], &vote[2..]].concat();
        assert_eq!(Envelope::decode(&longer), Envelope::decode(&vote));
        assert_eq!(heading(&longer), Err(MISSPELT));
        assert_eq!(read(&longer), Err(MISSPELT));
        // The vocabulary, behind the heading, in two bytes.
        let place = vote.iter().position(|byte| *byte == 9).unwrap();
        let longer = [&vote[..place], &[0x89, 0x00], &vote[place + 1..]].concat();
        assert_eq!(Envelope::decode(&longer), Envelope::decode(&vote));
        assert_eq!(read(&longer), Err(MISSPELT));
    }

    #[test]
    fn junk_has_no_heading() {
        let long = vec![PROTOCOL_VERSION; MAX_MESSAGE + 1];
        for junk in [&[][..], &[2], &[PROTOCOL_VERSION], &[PROTOCOL_VERSION, 0xff, 0xff], &long] {
            assert!(heading(junk).is_err());
        }
    }
}
