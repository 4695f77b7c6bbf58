//! The door of a server: where it listens, whom it lets in, and how many.
//!
//! Whoever is let in can teach the swarm, so a server is for this machine alone unless told otherwise, and elsewhere only for
//! those who have its token. A page of somebody else's cannot use it through a browser that can reach it: the names it is
//! asked under and the origins it is asked from are checked.

mod address;
mod connection;
mod guard;
mod token;

use std::net::SocketAddr;
use std::time::Duration;

use gestalt_protocol::InstructorId;
use tokio::net::TcpListener;

pub use address::Address;
pub(crate) use connection::Gate;
pub(crate) use guard::{Guard, at_the_door, with_token};
pub use token::Token;

use crate::error::DeskError;

/// Where something is served, and to whom.
#[derive(Clone, Debug)]
pub struct Door {
    /// Where to listen.
    pub address: Address,
    /// What a reader has to know. Drawn anew at each start where it is `None` and the address can be reached from elsewhere;
    /// on the loopback interface none is needed.
    pub token: Option<Token>,
    /// Who the readers' words to the swarm are from.
    pub instructor: InstructorId,
    /// What it bears.
    pub limits: Limits,
}

/// What a server bears.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Connections at a time; what comes beyond is closed.
    pub connections: usize,
    /// Readers of what is live at a time; what comes beyond is told so.
    pub readers: usize,
    /// How long a connection may take nothing of what waits for it, or send nothing while nothing waits, until it is closed.
    pub patience: Duration,
}

impl Door {
    /// A page at that address, with a token if it can be reached from elsewhere, and the limits that fit a robot.
    ///
    /// # Panics
    /// Never.
    #[must_use]
    pub fn at(address: Address) -> Self {
        let instructor = "page".parse().expect("a name of letters");
        Self { address, token: None, instructor, limits: Limits::default() }
    }

    /// The listener, where it listens, and the token that its readers need.
    pub(crate) async fn listen(
        &self,
        what: &'static str,
    ) -> Result<(TcpListener, SocketAddr, Option<Token>), DeskError> {
        let failed = |error| DeskError::Listen { what, address: self.address.to_string(), error };
        let listener = TcpListener::bind(self.address.to_string()).await.map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let token = match &self.token {
            None if address.ip().is_loopback() => None,
            None => Some(Token::draw()?),
            given => given.clone(),
        };
        Ok((listener, address, token))
    }
}

impl Default for Limits {
    fn default() -> Self {
        Self { connections: 128, readers: 32, patience: Duration::from_secs(10) }
    }
}
