//! Why nothing can be shown.

use std::io;

use gestalt_link::LinkError;
use gestalt_tape::WriteError;
use thiserror::Error;

/// What keeps a desk from opening. Nothing is left behind.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DeskError {
    /// A text that is no address.
    #[error(
        "'{0}' is no address to serve on: write a port (8420), or HOST:PORT (127.0.0.1:8420, robot1.local:8420, [::]:8420)"
    )]
    Address(String),
    /// The address cannot be listened on.
    #[error("cannot serve {what} on {address}: {error}; choose another port, or port 0 for a free one")]
    Listen {
        /// What.
        what: &'static str,
        /// Where.
        address: String,
        /// What the system says.
        error: io::Error,
    },
    /// A token that is too easily guessed.
    #[error(
        "the token has {0} characters: use at least 16 of the characters A-Z a-z 0-9 _ -, or leave it to be drawn"
    )]
    Token(usize),
    /// The system gives no random numbers to draw a token from.
    #[error("cannot draw a token: {0}; choose one yourself")]
    Chance(String),
    /// What passes cannot be handed on.
    #[error(
        "cannot hand on what passes in the swarm: {0}; see that this machine has room for another thread"
    )]
    Live(WriteError),
    /// The swarm cannot be listened to.
    #[error(transparent)]
    Link(#[from] LinkError),
}
