//! The Zenoh session of a robot, and single links of it: dial one, close one, hear of each.
//!
//! The one file that uses Zenoh's `internal` feature and its transport crate, which may change with any release:
//! Zenoh's public interface opens sessions, but neither dials nor closes single links of one.

use std::any::Any;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tokio::task::JoinHandle;
use zenoh::Session;
use zenoh::config::WhatAmI;
use zenoh::internal::runtime::{DynamicRuntime, Runtime, RuntimeBuilder};
use zenoh::session::ZenohId;
use zenoh_protocol::network::NetworkMessageMut;
use zenoh_transport::multicast::TransportMulticast;
use zenoh_transport::unicast::TransportUnicast;
use zenoh_transport::{
    DummyTransportMulticastEventHandler, DummyTransportPeerEventHandler, TransportEventHandler,
    TransportMulticastEventHandler, TransportPeer, TransportPeerEventHandler,
};

use crate::closing::Closing;
use crate::error::{LinkError, reason};
use crate::identity::robot_of;
use crate::reach::{endpoints, names_any};
use crate::tls::{Knocks, Seat, Stranger, Visitor};

pub(crate) use crate::admission::{Guard, Room};

/// The other end of a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Far {
    pub id: ZenohId,
    /// Whether it relays for others: all do but clients.
    pub relays: bool,
}

/// How long the end of a link is waited for.
const PARTING: Duration = Duration::from_secs(1);

/// A Zenoh session with a handle on each of its links.
#[derive(Clone)]
pub(super) struct Node {
    session: Session,
    runtime: Runtime,
    links: Arc<Links>,
    /// The session that relays for others in this robot's name, if there is one: its links are this robot's.
    relay: Arc<Mutex<Option<Node>>>,
}

impl Node {
    /// Opens a session: binds the listening endpoints and starts to connect, without waiting for anyone. Who is not let in by the `guard` of
    /// a sealed swarm, or finds no `room`, is hung up. `on_link` is told of every other link as it comes (`true`) and goes (`false`), from
    /// Zenoh's threads.
    pub(super) async fn open(
        config: zenoh::Config,
        guard: Option<Guard>,
        room: Option<Room>,
        on_link: impl Fn(Far, bool) + Send + Sync + 'static,
    ) -> Result<Self, LinkError> {
        let (listen, dials_nobody) = (endpoints(&config, "listen/endpoints"), !names_any(&config));
        let mut runtime = RuntimeBuilder::new(config).build().await.map_err(|e| LinkError::open(&*e))?;
        let links = Arc::new(Links::new(guard, room, Box::new(on_link)));
        DynamicRuntime::from(runtime.clone()).new_handler(Arc::new(Handler(links.clone())));
        let session = zenoh::session::init(runtime.clone().into()).await.map_err(|e| LinkError::open(&*e))?;
        // Whoever waits for it no longer leaves nothing open.
        let node = Self { session, runtime: runtime.clone(), links, relay: Arc::default() };
        let closing = node.closing();
        let started = runtime.start().await;
        closing.forget();
        if let Err(error) = started {
            let is_client = node.runtime.whatami() == WhatAmI::Client;
            // It says that it was told of nobody to link to; it is dialled for later, and what it listens on stands by then.
            if is_client && dials_nobody && (listen.is_empty() || !node.locators().is_empty()) {
                return Ok(node);
            }
            node.close().await;
            // Of one that hung up whoever it reached, Zenoh says no more than that time has passed.
            let refused = node.refused().filter(|_| is_client);
            let cause = refused.map_or_else(|| reason(&*error), |refused| refused.to_string());
            return Err(LinkError::Start { listen: listen.join(", "), cause });
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

    /// Whether it is linked to anybody.
    pub(super) fn is_linked(&self) -> bool {
        !self.links.lock().is_empty()
    }

    /// Whether it is linked to that session.
    pub(super) fn is_linked_to(&self, id: ZenohId) -> bool {
        self.links.lock().contains_key(&id)
    }

    /// Why a link was ended last.
    pub(super) fn refused(&self) -> Option<Stranger> {
        self.links.refused.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// How many robots are linked that relay for nobody, this one itself apart.
    pub(super) fn members(&self) -> usize {
        self.links.lock().values().filter(|link| link.is_member).count()
    }

    /// From now on that session relays for others in this robot's name, or none does.
    pub(super) fn relays_by(&self, relay: Option<Node>) {
        *self.relay.lock().unwrap_or_else(PoisonError::into_inner) = relay;
    }

    /// This session, and the one that relays in its name.
    pub(super) fn sessions(&self) -> impl Iterator<Item = Session> + use<> {
        let relay = self.relay.lock().unwrap_or_else(PoisonError::into_inner);
        [Some(self.session.clone()), relay.as_ref().map(|relay| relay.session.clone())].into_iter().flatten()
    }

    /// The links of this session, and of the one that relays in its name.
    fn all_links(&self) -> impl Iterator<Item = Arc<Links>> {
        let relay = self.relay.lock().unwrap_or_else(PoisonError::into_inner);
        [Some(self.links.clone()), relay.as_ref().map(|relay| relay.links.clone())].into_iter().flatten()
    }

    /// Ends the link to one other session, if there is one. Does not wait for its end.
    pub(super) fn hang_up(&self, id: ZenohId) {
        self.end_links(|other| *other == id);
    }

    /// The same, and waits for its end, for a while: a client has one link, and a new one is refused until the old one is gone.
    pub(super) async fn leave(&self, id: ZenohId) {
        for ended in self.end_links(|other| *other == id) {
            let _ = tokio::time::timeout(PARTING, ended).await;
        }
    }

    /// Ends those of all links, without waiting for it.
    fn end_links(&self, which: impl Fn(&ZenohId) -> bool) -> Vec<JoinHandle<()>> {
        let transports = |links: Arc<Links>| -> Vec<TransportUnicast> {
            let state = links.lock();
            state.iter().filter(|(id, _)| which(id)).map(|(_, link)| link.transport.clone()).collect()
        };
        self.all_links().flat_map(transports).map(|link| tokio::spawn(end(link))).collect()
    }

    /// Ends the links to all who would not be let in any more: the roster has changed. Does not wait for their end.
    pub(super) fn look_through(&self) {
        for links in self.all_links() {
            for link in links.no_longer_welcome() {
                tokio::spawn(end(link));
            }
        }
    }

    /// Closes it when that is dropped.
    pub(super) fn closing(&self) -> Closing {
        let node = self.clone();
        Closing::new(move || async move { node.close().await })
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

/// Ends a link without a word. To close it properly Zenoh would say so to the other end first, and wait without a limit, on a thread that others
/// need, for room in the queue to one who does not read.
async fn end(link: TransportUnicast) {
    for way in link.get_links().unwrap_or_default() {
        if let Err(error) = link.close_link(way).await {
            tracing::debug!("ending a link: {error}");
        }
    }
}

/// How many of those who knock again are kept waiting at the same time: each takes a thread.
const MAX_WAITING: usize = 4;

/// Keeps a handle on each link, which Zenoh's public interface does not give, and tells of it in the order of what happened, which Zenoh's own
/// listener does not: of a link that came and went at once it was measured to tell the other way around.
struct Links {
    guard: Option<Guard>,
    room: Option<Room>,
    on_link: Box<dyn Fn(Far, bool) + Send + Sync>,
    state: Mutex<BTreeMap<ZenohId, Link>>,
    made: AtomicUsize,
    refused: Mutex<Option<Stranger>>,
    knocks: Mutex<Knocks>,
    waiting: AtomicUsize,
}

struct Link {
    transport: TransportUnicast,
    /// Which of the links to that session it is.
    number: usize,
    relays: bool,
    /// Whether it is one that there must be room for.
    is_member: bool,
    /// Whose it is, in a sealed swarm.
    seat: Option<Seat>,
}

/// Why a link is not kept.
enum TurnedAway {
    /// It is none of the swarm's, or one too many.
    Stranger,
    /// The cell is full: there are others.
    Full,
}

impl Links {
    fn new(guard: Option<Guard>, room: Option<Room>, on_link: Box<dyn Fn(Far, bool) + Send + Sync>) -> Self {
        Self {
            guard,
            room,
            on_link,
            state: Mutex::default(),
            made: AtomicUsize::new(0),
            refused: Mutex::default(),
            knocks: Mutex::default(),
            waiting: AtomicUsize::new(0),
        }
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, BTreeMap<ZenohId, Link>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Lets in the one at the other end, unless there is no room for it; the number of the link.
    fn let_in(
        &self,
        id: ZenohId,
        peer: &TransportPeer,
        seat: Option<Seat>,
        transport: TransportUnicast,
    ) -> Result<usize, TurnedAway> {
        let relays = peer.whatami != WhatAmI::Client;
        let is_member = self
            .room
            .as_ref()
            .is_some_and(|room| !relays && robot_of(id, room.swarm).is_some_and(|robot| robot != room.of));
        let mut state = self.lock();
        let others = || state.iter().filter(|(other, _)| **other != id).map(|(_, link)| link);
        if let Some(seat) = &seat
            && !seat.is_free(others().filter_map(|link| link.seat.as_ref()))
        {
            return Err(self.refuse(Stranger::TooMany(seat.clone())));
        }
        let members = others().filter(|link| link.is_member).count();
        if let Some(room) = self.room.as_ref().filter(|room| is_member && members >= room.size) {
            room.account.count("cell_full");
            return Err(TurnedAway::Full);
        }
        let number = self.made.fetch_add(1, Ordering::Relaxed);
        if let Some(before) = state.insert(id, Link { transport, number, relays, is_member, seat }) {
            (self.on_link)(Far { id, relays: before.relays }, false);
        }
        // Told while it is locked: who is told asks nothing of this session before it has returned.
        (self.on_link)(Far { id, relays }, true);
        Ok(number)
    }

    /// That link has gone, if it has not been replaced.
    fn lose(&self, id: ZenohId, number: usize) {
        let mut state = self.lock();
        if let Some(link) = state.remove(&id) {
            if link.number == number {
                (self.on_link)(Far { id, relays: link.relays }, false);
            } else {
                state.insert(id, link);
            }
        }
    }

    /// Whether the one at the other end may stay, and as whom.
    fn look_at(&self, id: ZenohId, peer: &TransportPeer) -> Result<Option<Seat>, TurnedAway> {
        let Some(guard) = &self.guard else { return Ok(None) };
        let link = peer.links.first();
        let tls = link.is_some_and(|link| link.src.protocol().as_str() == "tls");
        let visitor = Visitor {
            name: link.and_then(|link| link.auth_identifier.get_cert_common_name()).map(str::to_owned),
            robot: robot_of(id, guard.swarm),
            is_client: peer.whatami == WhatAmI::Client,
            is_local: !tls,
        };
        let is_robot = guard.account.is_some();
        let known = if is_robot { guard.door.admit(&visitor) } else { guard.door.recognise(&visitor) };
        known.map(Some).map_err(|stranger| self.refuse(stranger))
    }

    /// Says why somebody is hung up.
    fn refuse(&self, stranger: Stranger) -> TurnedAway {
        match self.guard.as_ref().and_then(|guard| guard.account.as_ref()) {
            Some(account) => {
                account.count(&format!("refused_link_{}", stranger.name()));
                account.error(&format!("hung up {stranger}"));
            }
            None => tracing::warn!("hung up {stranger}"),
        }
        *self.refused.lock().unwrap_or_else(PoisonError::into_inner) = Some(stranger);
        TurnedAway::Stranger
    }

    /// Keeps whoever knocks again and again waiting. Zenoh begins to listen to a link only when it has told of it, so until then the one at
    /// the other end hears nothing and is not heard, and has no reason to knock once more. So long no other link with its Zenoh id can be made: who
    /// comes with that of a robot on the roster is not kept waiting.
    fn keep_waiting(&self, id: ZenohId, peer: &TransportPeer) {
        let Some(guard) = &self.guard else { return };
        let Some(account) = &guard.account else { return };
        if robot_of(id, guard.swarm).is_some_and(|robot| guard.door.knows(robot)) {
            return;
        }
        let name = peer.links.first().and_then(|link| link.auth_identifier.get_cert_common_name());
        let now = account.started().elapsed();
        let pause =
            self.knocks.lock().unwrap_or_else(PoisonError::into_inner).pause(name.unwrap_or("plain"), now);
        if pause.is_zero() {
            return;
        }
        if self.waiting.fetch_add(1, Ordering::Relaxed) < MAX_WAITING {
            account.count("links_kept_waiting");
            account.add("links_kept_waiting_ms", u64::try_from(pause.as_millis()).unwrap_or(u64::MAX));
            tokio::task::block_in_place(|| std::thread::sleep(pause));
        }
        self.waiting.fetch_sub(1, Ordering::Relaxed);
    }

    fn no_longer_welcome(&self) -> Vec<TransportUnicast> {
        let state = self.lock();
        // One that is gone already needs no look.
        let unwelcome = |id: &ZenohId, link: &Link| {
            link.transport.get_peer().is_ok_and(|peer| self.look_at(*id, &peer).is_err())
        };
        let unwelcome = state.iter().filter(|(id, link)| unwelcome(id, link));
        unwelcome.map(|(_, link)| link.transport.clone()).collect()
    }
}

/// What Zenoh calls when a link is made.
struct Handler(Arc<Links>);

/// What Zenoh calls when one link is gone.
struct OfLink {
    links: Arc<Links>,
    id: ZenohId,
    number: usize,
}

impl TransportEventHandler for Handler {
    fn new_unicast(
        &self,
        peer: TransportPeer,
        transport: TransportUnicast,
    ) -> zenoh::Result<Arc<dyn TransportPeerEventHandler>> {
        let (links, id) = (self.0.clone(), peer.zid.into());
        let entered =
            links.look_at(id, &peer).and_then(|seat| links.let_in(id, &peer, seat, transport.clone()));
        let number = match entered {
            Ok(number) => number,
            Err(refusal) => {
                if matches!(refusal, TurnedAway::Stranger) {
                    links.keep_waiting(id, &peer);
                }
                // Zenoh asks nobody whether it may link: it can only be ended again.
                tokio::spawn(end(transport));
                return Ok(Arc::new(DummyTransportPeerEventHandler));
            }
        };
        // Links are looked through after each change of the roster, and one that was looked at before may be let in after that.
        if links.look_at(id, &peer).is_err() {
            tokio::spawn(end(transport));
        }
        Ok(Arc::new(OfLink { links, id, number }))
    }

    fn new_multicast(
        &self,
        _transport: TransportMulticast,
    ) -> zenoh::Result<Arc<dyn TransportMulticastEventHandler>> {
        Ok(Arc::new(DummyTransportMulticastEventHandler))
    }
}

/// Zenoh tells of a link before it has refused it, and then says nothing of its end.
impl Drop for OfLink {
    fn drop(&mut self) {
        self.links.lose(self.id, self.number);
    }
}

impl TransportPeerEventHandler for OfLink {
    fn handle_message(&self, _: NetworkMessageMut) -> zenoh::Result<()> {
        Ok(())
    }

    fn new_link(&self, _: zenoh_link::Link) {}

    fn del_link(&self, _: zenoh_link::Link) {}

    fn closed(&self) {
        self.links.lose(self.id, self.number);
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}
