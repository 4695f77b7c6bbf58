//! What a reader from elsewhere has to know.

use std::fmt;

use crate::error::DeskError;

/// A secret of at least 16 of the characters `A-Z a-z 0-9 _ -`. It is not shown by `{:?}`.
#[derive(Clone, PartialEq, Eq)]
pub struct Token(String);

impl Token {
    /// One of somebody's choice.
    ///
    /// # Errors
    /// [`DeskError::Token`] for one that is short, or could not stand in an address.
    pub fn new(text: &str) -> Result<Self, DeskError> {
        let fits = (16..=128).contains(&text.len())
            && text.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_' || b == b'-');
        if fits { Ok(Self(text.to_owned())) } else { Err(DeskError::Token(text.chars().count())) }
    }

    /// One of 128 bits from the system's entropy.
    ///
    /// # Errors
    /// [`DeskError::Chance`] when the system gives none.
    pub fn draw() -> Result<Self, DeskError> {
        let mut bytes = [0_u8; 16];
        getrandom::fill(&mut bytes).map_err(|error| DeskError::Chance(error.to_string()))?;
        Ok(Self(bytes.iter().map(|byte| format!("{byte:02x}")).collect()))
    }

    /// The secret itself, for the one who is to have it.
    #[must_use]
    pub fn reveal(&self) -> &str {
        &self.0
    }

    /// Whether somebody knows it. Takes as long for any guess of the same length.
    pub(super) fn is(&self, guess: &str) -> bool {
        let differing = self.0.bytes().zip(guess.bytes()).fold(0, |sum, (a, b)| sum | (a ^ b));
        guess.len() == self.0.len() && differing == 0
    }
}

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Token(…)")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_is_long_and_known_only_whole() {
        for bad in ["", "short", "with spaces in it, long", &"x".repeat(129)] {
            assert!(Token::new(bad).is_err(), "{bad}");
        }
        let token = Token::draw().unwrap();
        assert_ne!(token, Token::draw().unwrap());
        assert!(token.is(token.reveal()));
        for guess in ["", &token.reveal()[1..], &format!("{}0", token.reveal())] {
            assert!(!token.is(guess));
        }
        assert!(!format!("{token:?}").contains(token.reveal()));
    }
}
