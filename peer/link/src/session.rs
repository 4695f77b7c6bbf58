//! The Zenoh session of a robot, and single links of it: dial one, close one, hear of each.
//!
//! The one file that uses Zenoh's `internal` feature and its transport crate, which may change with any release:
//! Zenoh's public interface opens sessions, but neither dials nor closes single links of one.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use zenoh::Session;
use zenoh::internal::runtime::{DynamicRuntime, Runtime, RuntimeBuilder};
use zenoh::sample::SampleKind;
use zenoh::session::ZenohId;
use zenoh_transport::multicast::TransportMulticast;
use zenoh_transport::unicast::TransportUnicast;
use zenoh_transport::{
    DummyTransportMulticastEventHandler, DummyTransportPeerEventHandler, TransportEventHandler,
    TransportMulticastEventHandler, TransportPeer, TransportPeerEventHandler,
};

use crate::error::{LinkError, reason};
use crate::failure::Part;
use crate::supervisor::Supervisor;

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
    /// Opens a session: binds the listening endpoints and starts to connect, without waiting for anyone.
    /// `on_link` is told of every link as it comes (`true`) and goes (`false`), from Zenoh's threads.
    pub(super) async fn open(
        config: zenoh::Config,
        on_link: impl Fn(ZenohId, bool) + Send + Sync + 'static,
    ) -> Result<Self, LinkError> {
        let listen = config.get_json("listen/endpoints").unwrap_or_default();
        let mut runtime = RuntimeBuilder::new(config).build().await.map_err(|e| LinkError::open(&*e))?;
        let links = Arc::new(Links::default());
        DynamicRuntime::from(runtime.clone()).new_handler(links.clone());
        let session = zenoh::session::init(runtime.clone().into()).await.map_err(|e| LinkError::open(&*e))?;
        let gone = links.clone();
        session
            .info()
            .transport_events_listener()
            .history(true)
            .callback(move |event| {
                let up = event.kind() == SampleKind::Put;
                if !up {
                    gone.lock().remove(event.transport().zid());
                }
                on_link(*event.transport().zid(), up);
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
        let link = self.links.lock().remove(&id);
        if let Some(link) = link
            && let Err(error) = link.close().await
        {
            tracing::debug!("closing the link to {id}: {error}");
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

/// Keeps a handle on each link, which Zenoh's public interface does not give.
#[derive(Default)]
struct Links(Mutex<BTreeMap<ZenohId, TransportUnicast>>);

impl Links {
    fn lock(&self) -> std::sync::MutexGuard<'_, BTreeMap<ZenohId, TransportUnicast>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl TransportEventHandler for Links {
    fn new_unicast(
        &self,
        peer: TransportPeer,
        transport: TransportUnicast,
    ) -> zenoh::Result<Arc<dyn TransportPeerEventHandler>> {
        self.lock().insert(peer.zid.into(), transport);
        Ok(Arc::new(DummyTransportPeerEventHandler))
    }

    fn new_multicast(
        &self,
        _transport: TransportMulticast,
    ) -> zenoh::Result<Arc<dyn TransportMulticastEventHandler>> {
        Ok(Arc::new(DummyTransportMulticastEventHandler))
    }
}
