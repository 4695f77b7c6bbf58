//! What evidence is made of.

use std::fmt;

use gestalt_protocol::hex::{self, Hex};
use gestalt_protocol::{MAX_MESSAGE, Signature};
use serde::de::{Deserializer, Error, Visitor};
use serde::ser::Serializer;
use serde::{Deserialize, Serialize};

/// The longest statement that can be one of two that contradict each other, in bytes. A vote has at most 400.
pub const MAX_EVIDENT: usize = 32 * 1024;

/// The longest of all, in bytes: with its signature, and what says that it is evidence, it is no longer than a message may be.
pub(crate) const MAX_SIGNED: usize = MAX_MESSAGE - 128;

/// A statement with its author's signature.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Signed {
    #[serde(serialize_with = "write", deserialize_with = "read")]
    pub(crate) statement: Vec<u8>,
    pub(crate) signature: Signature,
}

/// In formats that humans read, hexadecimal digits.
fn write<S: Serializer>(bytes: &[u8], serializer: S) -> Result<S::Ok, S::Error> {
    if serializer.is_human_readable() {
        serializer.collect_str(&Hex(bytes))
    } else {
        serializer.serialize_bytes(bytes)
    }
}

/// At most [`MAX_SIGNED`] bytes, looked at before anything is allocated for them.
fn read<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<u8>, D::Error> {
    struct Statement;

    impl Visitor<'_> for Statement {
        type Value = Vec<u8>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            write!(f, "at most {MAX_SIGNED} bytes")
        }

        fn visit_str<E: Error>(self, text: &str) -> Result<Vec<u8>, E> {
            if text.len() > 2 * MAX_SIGNED {
                return Err(E::invalid_length(text.len() / 2, &self));
            }
            let (pairs, rest) = text.as_bytes().as_chunks::<2>();
            let digits =
                |pair: &[u8; 2]| str::from_utf8(pair).ok().and_then(|pair| hex::parse::<1>(pair).ok());
            let bytes: Option<Vec<u8>> = pairs.iter().map(|pair| digits(pair).map(|[byte]| byte)).collect();
            bytes.filter(|_| rest.is_empty()).ok_or_else(|| E::custom("no hexadecimal digits"))
        }

        fn visit_bytes<E: Error>(self, bytes: &[u8]) -> Result<Vec<u8>, E> {
            if bytes.len() > MAX_SIGNED {
                return Err(E::invalid_length(bytes.len(), &self));
            }
            Ok(bytes.to_vec())
        }
    }

    if deserializer.is_human_readable() {
        deserializer.deserialize_str(Statement)
    } else {
        deserializer.deserialize_bytes(Statement)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn json(statement: &str) -> Result<Signed, serde_json::Error> {
        let signature = Hex(&[7; Signature::LENGTH]);
        serde_json::from_str(&format!("{{\"statement\": \"{statement}\", \"signature\": \"{signature}\"}}"))
    }

    #[test]
    fn as_json_it_is_as_long_as_it_may_be_and_no_longer() {
        let longest = json(&"a7".repeat(MAX_SIGNED)).unwrap();
        assert_eq!(longest.statement, vec![0xa7; MAX_SIGNED]);
        assert_eq!(
            serde_json::from_str::<Signed>(&serde_json::to_string(&longest).unwrap()).unwrap(),
            longest
        );
        let over = json(&"a7".repeat(MAX_SIGNED + 1)).unwrap_err().to_string();
        let lengths = (format!("length {}", MAX_SIGNED + 1), format!("at most {MAX_SIGNED} bytes"));
        assert!(over.contains(&lengths.0) && over.contains(&lengths.1), "{over}");
        assert!(json("a7a").is_err() && json("g7").is_err());
    }
}
