//! What bytes from outside may be, if not a message.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::limits::{MAX_JSON, PROTOCOL_VERSION};

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

/// What travels between robots: the version byte, then the value in postcard.
pub(crate) fn encode_versioned<T: Serialize>(value: &T) -> Vec<u8> {
    postcard::to_extend(value, vec![PROTOCOL_VERSION])
        .expect("memory is the only thing that writing to a vector can lack")
}

/// Reads what [`encode_versioned`] wrote, of at most `limit` bytes together with what follows it, which is given too.
pub(crate) fn take_versioned<'a, T: Deserialize<'a>>(
    bytes: &'a [u8],
    limit: usize,
) -> Result<(T, &'a [u8]), DecodeError> {
    if bytes.len() > limit {
        return Err(DecodeError::TooLong { length: bytes.len(), limit });
    }
    let (&version, body) = bytes.split_first().ok_or(DecodeError::Empty)?;
    if version != PROTOCOL_VERSION {
        return Err(DecodeError::Version { found: version });
    }
    postcard::take_from_bytes(body).map_err(|error| DecodeError::Malformed(error.to_string()))
}
