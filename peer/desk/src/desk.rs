//! A page that is served, and the swarm behind it.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use gestalt_link::Client;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;

use crate::asks::Asks;
use crate::board::Board;
use crate::door::{Door, Gate, Token};
use crate::error::DeskError;
use crate::follow::Ears;
use crate::known::Known;
use crate::page::{Server, serve};

/// How long the last answers may take when the page closes.
const GOODBYE: Duration = Duration::from_millis(500);

/// A running page. It closes when it is dropped.
#[derive(Debug)]
pub struct Desk {
    address: SocketAddr,
    url: String,
    following: JoinHandle<()>,
    serving: JoinHandle<()>,
    /// Dropped to end the server.
    open: Option<oneshot::Sender<()>>,
}

impl Desk {
    /// Serves a page of the swarm that the client is attached to.
    ///
    /// # Errors
    /// [`DeskError::Listen`] when the address is taken or none of this machine's; [`DeskError::Link`] when the client is closed;
    /// [`DeskError::Chance`] when no token can be drawn.
    pub async fn open(client: Client, swarm: &str, door: Door) -> Result<Self, DeskError> {
        let ears = Ears::new(client).await?;
        let (listener, address, token) = door.listen("the page").await?;
        let url = url(&door, address, token.as_ref());
        let (board, known) = (Arc::new(Board::new(swarm)), Arc::new(Known::new()));
        let (asks, asked) = Asks::new();
        let server = Server::new(&door, address, token, &board, known.clone(), asks);
        let (open, closed) = oneshot::channel::<()>();
        let following =
            tokio::spawn(async move { ears.follow(&known, &*board, asked, door.instructor).await });
        let gate = Gate::new(listener, door.limits.connections, door.limits.patience);
        let serving = tokio::spawn(serve(gate, server, async { drop(closed.await) }));
        Ok(Self { address, url, following, serving, open: Some(open) })
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// What to open in a browser, the token included where one is needed.
    #[must_use]
    pub fn url(&self) -> &str {
        &self.url
    }

    /// Waits until the swarm's session has ended: from then on nothing the page shows is live.
    pub async fn ended(&mut self) {
        // An error is a panic, which was reported; the page is as dead.
        let _ = (&mut self.following).await;
    }

    /// Closes the page and detaches from the swarm.
    pub async fn close(mut self) {
        self.following.abort();
        self.open = None;
        let _ = tokio::time::timeout(GOODBYE, &mut self.serving).await;
    }
}

impl Drop for Desk {
    fn drop(&mut self) {
        self.following.abort();
        self.serving.abort();
    }
}

/// The token is in the fragment, which browsers send nowhere.
fn url(door: &Door, address: SocketAddr, token: Option<&Token>) -> String {
    let host = door.address.at_port(address.port());
    let fragment = token.map(|token| format!("#{}", token.reveal())).unwrap_or_default();
    format!("http://{host}/{fragment}")
}
