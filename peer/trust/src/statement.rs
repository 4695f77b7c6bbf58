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
