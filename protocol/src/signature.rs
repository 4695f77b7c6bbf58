//! Who really said it: a signature under a statement.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::hex::{self, Hex, HexError};

/// 64 bytes by which an author stands by a statement. Here it is only carried; `gestalt-trust` makes and checks it.
///
/// On the wire exactly its 64 bytes, in text 128 lower-case hexadecimal digits.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Signature(#[serde(with = "hex")] [u8; Self::LENGTH]);

impl Signature {
    /// How long a signature is, in bytes.
    pub const LENGTH: usize = 64;

    /// The signature of these bytes; whether it is anybody's is not looked into.
    #[must_use]
    pub const fn from_bytes(bytes: [u8; Self::LENGTH]) -> Self {
        Self(bytes)
    }

    /// Its bytes.
    #[must_use]
    pub const fn as_bytes(&self) -> &[u8; Self::LENGTH] {
        &self.0
    }
}

impl fmt::Display for Signature {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Hex(&self.0).fmt(f)
    }
}

impl fmt::Debug for Signature {
    /// Its first four bytes: enough to tell two of them apart in a log.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Signature({}…)", Hex(&self.0[..4]))
    }
}

impl FromStr for Signature {
    type Err = HexError;

    fn from_str(text: &str) -> Result<Self, HexError> {
        hex::parse(text).map(Self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counting() -> Signature {
        Signature::from_bytes(std::array::from_fn(|place| place as u8))
    }

    #[test]
    fn on_the_wire_it_is_64_bytes_and_nothing_else() {
        let bytes = postcard::to_allocvec(&counting()).unwrap();
        assert_eq!(bytes, counting().as_bytes());
        assert_eq!(postcard::from_bytes::<Signature>(&bytes), Ok(counting()));
        assert!(postcard::from_bytes::<Signature>(&bytes[..63]).is_err());
    }

    #[test]
    fn in_text_it_is_hexadecimal() {
        let text = counting().to_string();
        assert_eq!(text.len(), 128);
        assert!(text.starts_with("00010203") && text.ends_with("3e3f"), "{text}");
        assert_eq!(text.parse(), Ok(counting()));
        let json = serde_json::to_string(&counting()).unwrap();
        assert_eq!(json, format!("\"{text}\""));
        assert_eq!(serde_json::from_str::<Signature>(&json).unwrap(), counting());
        assert!(serde_json::from_str::<Signature>("[1,2]").is_err());
        assert_eq!(format!("{:?}", counting()), "Signature(00010203…)");
    }
}
