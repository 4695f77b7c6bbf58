//! The page: a web server for one swarm, small on purpose.
//!
//! Whoever can read the page can teach the swarm, so it is served to this machine alone unless told otherwise, and elsewhere
//! only to those who have its token. A page of somebody else's cannot use it through a browser that can reach it: the names
//! it is asked under and the origins it is asked from are checked.

mod address;
mod connection;
mod files;
mod guard;
mod server;
#[cfg(test)]
mod tests;
mod token;

use std::time::Duration;

pub use address::Address;
pub(crate) use connection::Gate;
pub(crate) use server::{Ask, Server, serve};
pub use token::Token;

/// Where the page is served, and to whom.
#[derive(Clone, Debug)]
pub struct Door {
    /// Where to listen.
    pub address: Address,
    /// What a reader has to know. Drawn anew at each start where it is `None` and the address can be reached from elsewhere;
    /// on the loopback interface none is needed.
    pub token: Option<Token>,
    /// Who the page's words to the swarm are from.
    pub instructor: gestalt_protocol::InstructorId,
    /// What it bears.
    pub limits: Limits,
}

/// What the page bears.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Connections at a time; what comes beyond is closed.
    pub connections: usize,
    /// Readers of the event stream at a time; what comes beyond is told so.
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
}

impl Default for Limits {
    fn default() -> Self {
        Self { connections: 128, readers: 32, patience: Duration::from_secs(10) }
    }
}
