//! A swarm live in Foxglove, Lichtblick and whatever else speaks `foxglove.sdk.v1`: the channels of a recording, a service
//! that teaches, and the robots and their links as a connection graph.
//!
//! ```text
//! Tap ─► Recorder (queue, thread) ─► Hub ─► a bounded queue for each client ─► WebSocket
//! View ─► Easel: graph, problems ──────────► the newest of each, when it can be sent ──┘
//! ```
//!
//! Nobody waits for a client. Whoever takes too little, or gives no sign of life, is sent away.
//!
//! The protocol is small, and spoken here over axum's WebSocket, so that the door is the page's own: Foxglove's SDK checks neither
//! `Host` nor `Origin`, knows no token, bounds neither connections nor what a client may send, keeps a client that reads nothing, and
//! brings thirty crates where this brings three.

mod channel;
mod graph;
mod hub;
mod live;
mod say;
mod server;
#[cfg(test)]
mod tests;
mod visit;
mod wire;

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use gestalt_link::{Client, LinkError};
use gestalt_protocol::{Keys, Topic};
use gestalt_tape::{Recorder, Room};
use tokio::sync::{Semaphore, oneshot};
use tokio::task::JoinHandle;

pub use hub::Visits;

use graph::Easel;
use hub::Hub;
use live::Live;
use server::{Server, serve};
use visit::{Host, Info};

use crate::asks::Asks;
use crate::door::{Address, Door, Gate, Guard, Limits, Token};
use crate::error::DeskError;
use crate::follow::Ears;
use crate::known::Known;
use crate::tap::Tap;

/// Whose pages may connect besides this server's own: Foxglove's web application, and what runs from files of its own, as
/// the desktop programs do. Pages that a browser opens from a file are of the origin `null`, which is not let in.
const ORIGINS: [&str; 2] = ["https://app.foxglove.dev", "file://"];

/// How long the last messages may take when the server closes.
const GOODBYE: Duration = Duration::from_millis(500);

/// What is served to viewers, and to whom.
#[derive(Clone, Debug)]
pub struct Viewing {
    /// Where, and to how many.
    pub door: Door,
    /// Whose pages may connect, as browsers name them, besides the server's own: `https://example.org`.
    pub origins: Vec<String>,
    /// Whether what cameras stream is served, too: it then travels to this program as well.
    pub frames: bool,
}

impl Viewing {
    /// At that address, elsewhere than on this machine with a token, for the viewers' own pages, and without pictures.
    ///
    /// # Panics
    /// Never.
    #[must_use]
    pub fn at(address: Address) -> Self {
        let instructor = "foxglove".parse().expect("a name of letters");
        let limits = Limits { connections: 32, readers: 16, ..Limits::default() };
        let door = Door { instructor, limits, ..Door::at(address) };
        Self { door, origins: ORIGINS.map(str::to_owned).to_vec(), frames: false }
    }
}

/// A running server for viewers. It closes when it is dropped.
#[derive(Debug)]
pub struct Foxglove {
    address: SocketAddr,
    url: String,
    hub: Arc<Hub>,
    places: Arc<Semaphore>,
    limits: Limits,
    following: JoinHandle<()>,
    serving: JoinHandle<()>,
    /// Taken when it is closed.
    recording: Option<(Tap, Recorder)>,
    /// Dropped to end the server.
    open: Option<oneshot::Sender<()>>,
}

impl Foxglove {
    /// The port unless told otherwise: the one that viewers offer.
    pub const PORT: u16 = 8765;

    /// Serves the swarm that the client is attached to.
    ///
    /// # Errors
    /// [`DeskError::Listen`] when the address is taken or none of this machine's; [`DeskError::Link`] when the client is closed;
    /// [`DeskError::Chance`] when there are no random numbers; [`DeskError::Live`] when there is no thread.
    pub async fn open(client: Client, swarm: &str, viewing: Viewing) -> Result<Self, DeskError> {
        let Viewing { door, origins, frames } = viewing;
        let keys = Keys::new(swarm).map_err(LinkError::from)?;
        let (listener, address, token) = door.listen("Foxglove").await?;
        let host = door.address.at_port(address.port());
        let query = token.as_ref().map(|token| format!("?token={}", token.reveal())).unwrap_or_default();
        let url = format!("ws://{host}/{query}");
        let hub = Arc::new(Hub::new(keys.clone()));
        let service = service(&keys);
        let easel = Arc::new(Easel::new(keys.clone(), service.clone()));
        let recorder =
            Recorder::onto(Live::new(hub.clone()), keys, Room::default()).map_err(DeskError::Live)?;
        let ears = Ears::new(client).await?;
        let tap = Tap::open(ears.client.clone(), frames, recorder.intake().clone()).await?;
        let known = Arc::new(Known::new());
        let (asks, asked) = Asks::new();
        let info = Info { swarm: swarm.to_owned(), session: Token::draw()?.reveal().to_owned(), service };
        let host = Host {
            hub: hub.clone(),
            pictures: easel.pictures(),
            known: known.clone(),
            asks,
            info: Arc::new(info),
            patience: door.limits.patience,
        };
        let places = Arc::new(Semaphore::new(door.limits.readers));
        let guard = Guard::new(&door.address, address, token).for_viewers(origins);
        let server = Server { guard, host, places: places.clone() };
        let (open, closed) = oneshot::channel::<()>();
        let (instructor, deaf) = (door.instructor, hub.clone());
        let following = tokio::spawn(async move {
            ears.follow(&known, &*easel, asked, instructor).await;
            // What is not live is not shown.
            deaf.close();
        });
        let gate = Gate::new(listener, door.limits.connections, door.limits.patience);
        let serving = tokio::spawn(serve(gate, server, async { drop(closed.await) }));
        let recording = Some((tap, recorder));
        Ok(Self {
            address,
            url,
            hub,
            places,
            limits: door.limits,
            following,
            serving,
            recording,
            open: Some(open),
        })
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// What to connect a viewer to, the token included where one is needed.
    #[must_use]
    pub fn url(&self) -> &str {
        &self.url
    }

    /// What became of all clients so far.
    #[must_use]
    pub fn visits(&self) -> Visits {
        self.hub.visits()
    }

    /// Says goodbye to all clients, and detaches from the swarm.
    pub async fn close(mut self) {
        self.hub.close();
        self.following.abort();
        self.open = None;
        let all = u32::try_from(self.limits.readers).unwrap_or(u32::MAX);
        let _ = tokio::time::timeout(GOODBYE, self.places.acquire_many(all)).await;
        let _ = tokio::time::timeout(GOODBYE, &mut self.serving).await;
        if let Some((tap, recorder)) = self.recording.take() {
            tap.close().await;
            // It ends by itself in any case; an error is a panic, which was reported.
            let _ = tokio::task::spawn_blocking(|| recorder.finish()).await;
        }
    }
}

impl Drop for Foxglove {
    fn drop(&mut self) {
        self.hub.close();
        self.following.abort();
        self.serving.abort();
    }
}

/// The name of the service, beside the swarm's other names.
fn service(keys: &Keys) -> String {
    format!("/{}say", keys.key(&Topic::Decision).trim_end_matches("decision"))
}
