//! Who somebody is: a public key.

use std::fmt;
use std::str::FromStr;

use gestalt_protocol::hex::{self, Hex, HexError};
use serde::{Deserialize, Serialize};

/// The 32 bytes that others know somebody by: in text 64 lower-case hexadecimal digits, in binary formats the bare bytes.
///
/// Any 32 bytes can be written here. Whether they are a key that can be trusted is found where a
/// [`Roster`](crate::Roster) lists them.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct PublicKey(#[serde(with = "hex")] [u8; Self::LENGTH]);

impl PublicKey {
    /// How long a key is, in bytes.
    pub const LENGTH: usize = 32;

    /// The key of these bytes.
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

impl fmt::Display for PublicKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Hex(&self.0).fmt(f)
    }
}

impl fmt::Debug for PublicKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "PublicKey({self})")
    }
}

impl FromStr for PublicKey {
    type Err = HexError;

    fn from_str(text: &str) -> Result<Self, HexError> {
        hex::parse(text).map(Self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_has_one_spelling() {
        let text = "d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a";
        let key: PublicKey = text.parse().unwrap();
        assert_eq!((key.to_string(), format!("{key:?}")), (text.to_owned(), format!("PublicKey({text})")));
        assert_eq!(serde_json::to_string(&key).unwrap(), format!("\"{text}\""));
        assert_eq!(serde_json::from_str::<PublicKey>(&format!("\"{text}\"")).unwrap(), key);
        assert_eq!(postcard::to_allocvec(&key).unwrap(), key.as_bytes());
        for bad in [&text[1..], &text.to_uppercase(), &text.replace('a', "g"), ""] {
            assert!(bad.parse::<PublicKey>().is_err(), "{bad}");
        }
    }
}
