//! The Zenoh session of a robot, and single links of it: dial one, close one, hear of each.
//!
//! The one file that uses Zenoh's `internal` feature and its transport crate, which may change with any release:
//! Zenoh's public interface opens sessions, but neither dials nor closes single links of one.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use zenoh::Session;
use zenoh::config::WhatAmI;
use zenoh::internal::runtime::{DynamicRuntime, Runtime, RuntimeBuilder};
use zenoh::sample::SampleKind;
use zenoh::session::ZenohId;
use zenoh_transport::multicast::TransportMulticast;
use zenoh_transport::unicast::TransportUnicast;
use zenoh_transport::{
    DummyTransportMulticastEventHandler, DummyTransportPeerEventHandler, TransportEventHandler,
    TransportMulticastEventHandler, TransportPeer, TransportPeerEventHandler,
};

use crate::account::Account;
use crate::error::{LinkError, reason};
use crate::failure::Part;
use crate::identity::robot_of;
use crate::supervisor::Supervisor;
use crate::tls::{Door, Knocks, Visitor};

/// How often it is made sure that a session is still open.
const LOOK_AFTER: Duration = Duration::from_millis(500);

/// A Zenoh session with a handle on each of its links.
#[derive(Clone)]
pub(super) struct Node {
    session: Session,
    runtime: Runtime,
    links: Arc<Links>,
}

impl Node {
    /// Opens a session: binds the listening endpoints and starts to connect, without waiting for anyone. Who is not let in by the `guard` of
    /// a sealed swarm is hung up. `on_link` is told of every other link as it comes (`true`) and goes (`false`), from Zenoh's threads.
    pub(super) async fn open(
        config: zenoh::Config,
        guard: Option<Guard>,
        on_link: impl Fn(ZenohId, bool) + Send + Sync + 'static,
    ) -> Result<Self, LinkError> {
        let listen = config.get_json("listen/endpoints").unwrap_or_default();
        let mut runtime = RuntimeBuilder::new(config).build().await.map_err(|e| LinkError::open(&*e))?;
        let links = Arc::new(Links::new(guard));
        DynamicRuntime::from(runtime.clone()).new_handler(links.clone());
        let session = zenoh::session::init(runtime.clone().into()).await.map_err(|e| LinkError::open(&*e))?;
        let gone = links.clone();
        session
            .info()
            .transport_events_listener()
            .history(true)
            .callback(move |event| {
                let (id, up) = (*event.transport().zid(), event.kind() == SampleKind::Put);
                if gone.has_let_in(id, up) {
                    on_link(id, up);
                }
            })
            .background()
            .await
            .map_err(|e| LinkError::open(&*e))?;
        let started = runtime.start().await;
        let node = Self { session, runtime, links };
        if let Err(error) = started {
            node.close().await;
            return Err(LinkError::Start { listen, cause: reason(&*error) });
        }
        Ok(node)
    }

    pub(super) fn session(&self) -> &Session {
        &self.session
    }

    pub(super) fn id(&self) -> ZenohId {
        self.runtime.zid()
    }

    /// The endpoints it listens on, with the ports it was given.
    pub(super) fn locators(&self) -> Vec<String> {
        self.runtime.get_locators().iter().map(ToString::to_string).collect()
    }

    /// Links to one other session, unless it is linked already; whether the link now stands.
    pub(super) async fn dial(&self, id: ZenohId, locators: &[String]) -> bool {
        let locators: Vec<_> = locators.iter().filter_map(|locator| locator.parse().ok()).collect();
        self.runtime.connect_peer(&id.into(), &locators).await
    }

    /// Ends the link to one other session, if there is one.
    pub(super) async fn hang_up(&self, id: ZenohId) {
        let link = self.links.lock().transports.remove(&id);
        if let Some(link) = link {
            close(link).await;
        }
    }

    /// Ends the links to all who would not be let in any more: the roster has changed.
    pub(super) async fn look_through(&self) {
        for link in self.links.no_longer_welcome() {
            close(link).await;
        }
    }

    pub(super) async fn close(&self) {
        if let Err(error) = self.session.close().await {
            tracing::debug!("closing the Zenoh session: {error}");
        }
        if let Err(error) = self.runtime.close().await {
            tracing::debug!("closing the Zenoh runtime: {error}");
        }
    }
}

/// Ends a robot whose session has been closed, by whomever. Never returns before.
pub(crate) async fn watch_session(session: Session, supervisor: Arc<Supervisor>) -> Result<(), String> {
    loop {
        tokio::time::sleep(LOOK_AFTER).await;
        if session.is_closed() {
            supervisor.end(Part::Session, "Zenoh closed it".to_owned());
            return Ok(());
        }
    }
}

async fn close(link: TransportUnicast) {
    if let Err(error) = link.close().await {
        tracing::debug!("closing a link: {error}");
    }
}

/// Who guards the door of a robot of a sealed swarm.
pub(crate) struct Guard {
    /// The checksum of the swarm's name.
    pub swarm: u32,
    pub door: Arc<Door>,
    pub account: Arc<Account>,
}

/// How many of those who knock again are kept waiting at the same time: each takes a thread.
const MAX_WAITING: usize = 4;

/// Keeps a handle on each link, which Zenoh's public interface does not give.
struct Links {
    guard: Option<Guard>,
    state: Mutex<State>,
    knocks: Mutex<Knocks>,
    waiting: AtomicUsize,
}

#[derive(Default)]
struct State {
    transports: BTreeMap<ZenohId, TransportUnicast>,
    /// Those that are being hung up.
    refused: BTreeSet<ZenohId>,
}

impl Links {
    fn new(guard: Option<Guard>) -> Self {
        Self { guard, state: Mutex::default(), knocks: Mutex::default(), waiting: AtomicUsize::new(0) }
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes that a link has come or gone; whether it is one that was let in.
    fn has_let_in(&self, id: ZenohId, up: bool) -> bool {
        let mut state = self.lock();
        if !up {
            state.transports.remove(&id);
            return !state.refused.remove(&id);
        }
        !state.refused.contains(&id)
    }

    /// Whether the one at the other end may stay.
    fn is_welcome(&self, id: ZenohId, peer: &TransportPeer) -> bool {
        let Some(guard) = &self.guard else { return true };
        let link = peer.links.first();
        let tls = link.is_some_and(|link| link.src.protocol().as_str() == "tls");
        let visitor = Visitor {
            name: link.and_then(|link| link.auth_identifier.get_cert_common_name()).map(str::to_owned),
            robot: robot_of(id, guard.swarm),
            is_client: peer.whatami == WhatAmI::Client,
            is_local: !tls,
        };
        let refused = guard.door.admit(&visitor).err();
        if let Some(stranger) = &refused {
            guard.account.count(&format!("refused_link_{}", stranger.name()));
            guard.account.error(&format!("hung up {stranger}"));
        }
        refused.is_none()
    }

    /// Keeps whoever knocks again and again waiting. Zenoh begins to listen to a link only when it has told of it, so until then the one at
    /// the other end hears nothing and is not heard, and has no reason to knock once more.
    fn keep_waiting(&self, peer: &TransportPeer) {
        let Some(guard) = &self.guard else { return };
        let name = peer.links.first().and_then(|link| link.auth_identifier.get_cert_common_name());
        let now = guard.account.started().elapsed();
        let pause =
            self.knocks.lock().unwrap_or_else(PoisonError::into_inner).pause(name.unwrap_or("plain"), now);
        if pause.is_zero() {
            return;
        }
        if self.waiting.fetch_add(1, Ordering::Relaxed) < MAX_WAITING {
            guard.account.count("links_kept_waiting");
            guard.account.add("links_kept_waiting_ms", u64::try_from(pause.as_millis()).unwrap_or(u64::MAX));
            tokio::task::block_in_place(|| std::thread::sleep(pause));
        }
        self.waiting.fetch_sub(1, Ordering::Relaxed);
    }

    fn no_longer_welcome(&self) -> Vec<TransportUnicast> {
        let mut state = self.lock();
        let state = &mut *state;
        // One that is gone already needs no look.
        let unwelcome = |id: &ZenohId, link: &TransportUnicast| {
            link.get_peer().is_ok_and(|peer| !self.is_welcome(*id, &peer))
        };
        let unwelcome: Vec<ZenohId> =
            state.transports.iter().filter(|(id, link)| unwelcome(id, link)).map(|(id, _)| *id).collect();
        unwelcome.iter().filter_map(|id| state.transports.remove(id)).collect()
    }
}

impl TransportEventHandler for Links {
    fn new_unicast(
        &self,
        peer: TransportPeer,
        transport: TransportUnicast,
    ) -> zenoh::Result<Arc<dyn TransportPeerEventHandler>> {
        let id: ZenohId = peer.zid.into();
        let welcome = self.is_welcome(id, &peer);
        if !welcome {
            self.lock().refused.insert(id);
            self.keep_waiting(&peer);
        }
        let mut state = self.lock();
        if welcome {
            state.refused.remove(&id);
            state.transports.insert(id, transport);
        } else {
            // Zenoh asks nobody whether it may link: it can only be ended again.
            tokio::spawn(close(transport));
        }
        Ok(Arc::new(DummyTransportPeerEventHandler))
    }

    fn new_multicast(
        &self,
        _transport: TransportMulticast,
    ) -> zenoh::Result<Arc<dyn TransportMulticastEventHandler>> {
        Ok(Arc::new(DummyTransportMulticastEventHandler))
    }
}
