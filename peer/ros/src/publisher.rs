//! What a node says on a topic.

use std::marker::PhantomData;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::Duration;

use zenoh::Wait;
use zenoh::liveliness::LivelinessToken;
use zenoh::qos::{CongestionControl, Reliability};
use zenoh_ext::{AdvancedPublisher, AdvancedPublisherBuilderExt, CacheConfig, MissDetectionConfig};

use crate::attachment::Attachment;
use crate::error::RosError;
use crate::graph::{Endpoint, EndpointKind, Gid, gid};
use crate::message::RosMessage;
use crate::node::Node;
use crate::qos::Qos;

/// How often a latched publisher says which message was its last, so that who lost it asks for it.
const HEARTBEAT: Duration = Duration::from_millis(500);

/// Publishes messages of one type on one topic.
#[derive(Debug)]
pub struct Publisher<M> {
    endpoint: Endpoint,
    publisher: AdvancedPublisher<'static>,
    sequence: AtomicI64,
    gid: Gid,
    _token: LivelinessToken,
    _node: Node,
    message: PhantomData<fn(&M)>,
}

impl Node {
    /// Publishes on a topic: `~/decision`, `/diagnostics`.
    ///
    /// # Errors
    /// [`RosError::Name`] for a topic that cannot be, [`RosError::Zenoh`] when the node is closed.
    pub fn publisher<M: RosMessage>(&self, topic: &str, qos: Qos) -> Result<Publisher<M>, RosError> {
        Publisher::declare(self, self.endpoint::<M>(EndpointKind::Publisher, topic, qos)?)
    }
}

impl<M: RosMessage> Publisher<M> {
    fn declare(node: &Node, endpoint: Endpoint) -> Result<Self, RosError> {
        let reliability = if endpoint.qos.reliable { Reliability::Reliable } else { Reliability::BestEffort };
        let mut builder = node
            .session()
            .declare_publisher(endpoint.key(node.domain()))
            // As ROS's nodes do: what a slow reader does not take holds up nobody.
            .congestion_control(CongestionControl::Drop)
            .reliability(reliability)
            .advanced();
        if endpoint.qos.latched {
            builder = builder
                .publisher_detection()
                .cache(CacheConfig::default().max_samples(endpoint.qos.depth.max(1)))
                .sample_miss_detection(MissDetectionConfig::default().sporadic_heartbeat(HEARTBEAT));
        }
        let publisher =
            builder.wait().map_err(|cause| RosError::zenoh(format!("publish {}", endpoint.topic), cause))?;
        let (token, name) = node.announce(&endpoint)?;
        Ok(Self {
            endpoint,
            publisher,
            sequence: AtomicI64::new(1),
            gid: gid(&name),
            _token: token,
            _node: node.clone(),
            message: PhantomData,
        })
    }

    /// Says it. `clock` is the time since 1970.
    ///
    /// # Errors
    /// [`RosError::Zenoh`] when the node is closed.
    pub fn publish(&self, message: &M, clock: Duration) -> Result<(), RosError> {
        let attachment = Attachment {
            sequence: self.sequence.fetch_add(1, Ordering::Relaxed),
            source_time: i64::try_from(clock.as_nanos()).unwrap_or(i64::MAX),
            publisher: self.gid,
        };
        self.publisher
            .put(message.encode())
            .attachment(attachment.encode())
            .wait()
            .map_err(|cause| RosError::zenoh(format!("publish {}", self.endpoint.topic), cause))
    }

    /// Whether anybody subscribes, as far as the router has said. What is dear to make need not be made for nobody.
    ///
    /// # Errors
    /// [`RosError::Zenoh`] when the node is closed.
    pub fn is_heard(&self) -> Result<bool, RosError> {
        let matching = self.publisher.matching_status().wait();
        let matching = matching.map_err(|cause| {
            RosError::zenoh(format!("ask who subscribes to {}", self.endpoint.topic), cause)
        })?;
        Ok(matching.matching())
    }

    /// What it publishes, and how.
    #[must_use]
    pub fn endpoint(&self) -> &Endpoint {
        &self.endpoint
    }
}
