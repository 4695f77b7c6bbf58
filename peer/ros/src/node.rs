//! A node: a Zenoh session that ROS sees as one of its own.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use serde_json::json;
use zenoh::liveliness::LivelinessToken;
use zenoh::{Session, Wait};

use crate::error::RosError;
use crate::graph::{Endpoint, EndpointKind, NodeName, Place};
use crate::message::RosMessage;
use crate::qos::Qos;

/// Where ROS's router listens unless it was told otherwise.
const ROUTER: &str = "tcp/localhost:7447";

/// How long the router may take to answer.
const PATIENCE: Duration = Duration::from_secs(5);

/// Larger than any picture that is looked at: 4K in colour.
const MAX_MESSAGE: usize = 32 << 20;

/// Which node, and where.
#[derive(Clone, Debug)]
pub struct NodeConfig {
    /// Its name and namespace.
    pub name: NodeName,
    /// The ROS domain, as `ROS_DOMAIN_ID` says it to ROS's own nodes.
    pub domain: u32,
    /// The Zenoh router of the ROS system; `None`: `tcp/localhost:7447`.
    pub router: Option<String>,
    /// Whether keys carry type hashes; Humble's do not.
    pub type_hashes: bool,
}

impl NodeConfig {
    /// A node in that domain, at the router of this machine.
    #[must_use]
    pub fn new(name: NodeName, domain: u32) -> Self {
        Self { name, domain, router: None, type_hashes: true }
    }
}

/// What Humble writes in the place of a hash.
const NO_HASH: &str = "TypeHashNotSupported";

/// A node of ROS. It leaves when it and all its publishers and subscriptions are dropped.
#[derive(Clone, Debug)]
pub struct Node(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    place: Place,
    type_hashes: bool,
    numbers: AtomicU32,
    session: Session,
    _token: LivelinessToken,
}

impl Node {
    /// Attaches to ROS. Blocks until it has: for up to five seconds.
    ///
    /// # Errors
    /// [`RosError::Router`] when nobody answers there.
    pub fn open(config: NodeConfig) -> Result<Self, RosError> {
        let NodeConfig { name, domain, router, type_hashes } = config;
        let at = router.unwrap_or_else(|| ROUTER.to_owned());
        let session = zenoh::open(settings(&at)?)
            .wait()
            .map_err(|cause| RosError::Router { at: at.clone(), cause: cause.to_string() })?;
        let place = Place { domain, session: session.zid().to_string(), node: name };
        let token = session
            .liveliness()
            .declare_token(place.token())
            .wait()
            .map_err(|cause| RosError::zenoh(format!("declare itself as {}", place.node), cause))?;
        let numbers = AtomicU32::new(1);
        Ok(Self(Arc::new(Shared { place, type_hashes, numbers, session, _token: token })))
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &NodeName {
        &self.0.place.node
    }

    /// What it would publish or hear under that name.
    pub(crate) fn endpoint<M: RosMessage>(
        &self,
        kind: EndpointKind,
        topic: &str,
        qos: Qos,
    ) -> Result<Endpoint, RosError> {
        let topic = self.0.place.node.topic(topic)?;
        let type_hash = if self.0.type_hashes { M::HASH } else { NO_HASH };
        Ok(Endpoint { kind, topic, type_name: M::dds_type(), type_hash: type_hash.to_owned(), qos })
    }

    pub(crate) fn session(&self) -> &Session {
        &self.0.session
    }

    pub(crate) fn domain(&self) -> u32 {
        self.0.place.domain
    }

    /// Announces an endpoint: ROS's nodes know of it from now on. The token is what its identifier follows from.
    pub(crate) fn announce(&self, endpoint: &Endpoint) -> Result<(LivelinessToken, String), RosError> {
        let number = self.0.numbers.fetch_add(1, Ordering::Relaxed);
        let token = endpoint.token(number, &self.0.place);
        let declared = self.session().liveliness().declare_token(token.clone()).wait();
        let declared =
            declared.map_err(|cause| RosError::zenoh(format!("announce {}", endpoint.topic), cause))?;
        Ok((declared, token))
    }
}

/// A client of that router and of nobody else: it neither scouts nor listens.
fn settings(router: &str) -> Result<zenoh::Config, RosError> {
    let settings = json!({
        "mode": "client",
        "connect/endpoints": [router],
        "connect/timeout_ms": PATIENCE.as_millis(),
        "scouting/multicast/enabled": false,
        "scouting/gossip/enabled": false,
        "listen/endpoints": [],
        "adminspace/enabled": false,
        "timestamping/enabled": true,
        "transport/link/rx/max_message_size": MAX_MESSAGE,
    });
    let mut config = zenoh::Config::default();
    for (key, value) in settings.as_object().into_iter().flatten() {
        let set = config.insert_json5(key, &value.to_string());
        set.map_err(|cause| RosError::zenoh(format!("use the router {router}"), cause))?;
    }
    Ok(config)
}
