//! Bytes in text: two lower-case hexadecimal digits each, so that a value has one spelling.
//!
//! As `#[serde(with = "gestalt_protocol::hex")]` for an array: text in formats that humans read, the bare bytes without a length
//! in all others.

use std::fmt;

use serde::de::{Deserializer, Error, SeqAccess, Visitor};
use serde::ser::{SerializeTuple, Serializer};
use thiserror::Error;

/// A text that is not the hexadecimal spelling of so many bytes. It does not repeat the text, which may be a secret.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum HexError {
    /// Too short or too long.
    #[error("{found} characters: write {expected} hexadecimal digits")]
    Length {
        /// How many digits it needs.
        expected: usize,
        /// How many bytes of text there are.
        found: usize,
    },
    /// Something else than `0-9 a-f`.
    #[error("character {position} is none of 0-9 a-f")]
    Digit {
        /// Which one, from 1.
        position: usize,
    },
}

/// Displays bytes in hexadecimal.
#[derive(Clone, Copy)]
pub struct Hex<'a>(pub &'a [u8]);

impl fmt::Display for Hex<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// Reads `2 * N` hexadecimal digits.
///
/// # Errors
/// [`HexError`] says what is wrong, and where.
pub fn parse<const N: usize>(text: &str) -> Result<[u8; N], HexError> {
    if text.len() != 2 * N {
        return Err(HexError::Length { expected: 2 * N, found: text.len() });
    }
    let mut bytes = [0; N];
    for (position, digit) in text.bytes().enumerate() {
        let value = match digit {
            b'0'..=b'9' => digit - b'0',
            b'a'..=b'f' => digit - b'a' + 10,
            _ => return Err(HexError::Digit { position: position + 1 }),
        };
        bytes[position / 2] = bytes[position / 2] << 4 | value;
    }
    Ok(bytes)
}

/// For `#[serde(with)]`.
///
/// # Errors
/// Those of the serializer.
pub fn serialize<S: Serializer, const N: usize>(bytes: &[u8; N], serializer: S) -> Result<S::Ok, S::Error> {
    if serializer.is_human_readable() {
        return serializer.collect_str(&Hex(bytes));
    }
    let mut tuple = serializer.serialize_tuple(N)?;
    bytes.iter().try_for_each(|byte| tuple.serialize_element(byte))?;
    tuple.end()
}

/// For `#[serde(with)]`.
///
/// # Errors
/// Those of the deserializer, and what is not the spelling of `N` bytes.
pub fn deserialize<'de, D: Deserializer<'de>, const N: usize>(deserializer: D) -> Result<[u8; N], D::Error> {
    struct Bytes<const N: usize>;

    impl<'de, const N: usize> Visitor<'de> for Bytes<N> {
        type Value = [u8; N];

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            write!(f, "{N} bytes in hexadecimal")
        }

        fn visit_str<E: Error>(self, text: &str) -> Result<[u8; N], E> {
            parse(text).map_err(E::custom)
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<[u8; N], A::Error> {
            let mut bytes = [0; N];
            for (place, byte) in bytes.iter_mut().enumerate() {
                *byte = seq.next_element()?.ok_or_else(|| A::Error::invalid_length(place, &self))?;
            }
            Ok(bytes)
        }
    }

    if deserializer.is_human_readable() {
        deserializer.deserialize_str(Bytes)
    } else {
        deserializer.deserialize_tuple(N, Bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_have_one_spelling() {
        assert_eq!(parse("00ff1a"), Ok([0x00, 0xff, 0x1a]));
        assert_eq!(Hex(&[0x00, 0xff, 0x1a]).to_string(), "00ff1a");
        assert_eq!(parse::<3>("00FF1A"), Err(HexError::Digit { position: 3 }));
        assert_eq!(parse::<3>("+0ff1a"), Err(HexError::Digit { position: 1 }));
        assert_eq!(parse::<3>("00ff1"), Err(HexError::Length { expected: 6, found: 5 }));
        assert!(parse::<3>("00ffä").is_err(), "six bytes, but no six digits");
    }
}
