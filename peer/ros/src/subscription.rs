//! What a node hears on a topic.

use zenoh::Wait;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::sample::{Sample, SampleKind};

use crate::attachment::Attachment;
use crate::cdr::CdrError;
use crate::error::RosError;
use crate::graph::{Endpoint, EndpointKind};
use crate::message::RosMessage;
use crate::node::Node;
use crate::qos::Qos;

/// A message that came, or what came instead.
#[derive(Clone, Debug, PartialEq)]
pub struct Received<M> {
    /// The message, or why it is none.
    pub message: Result<M, CdrError>,
    /// Its number, when and whose; `None` where what stands there is nothing that ROS writes.
    pub attachment: Option<Attachment>,
}

/// A subscription; it ends when it is dropped.
#[derive(Debug)]
pub struct Subscription {
    endpoint: Endpoint,
    _subscriber: Subscriber<()>,
    _token: LivelinessToken,
    _node: Node,
}

impl Node {
    /// Subscribes to a topic. `on_message` is called on one of Zenoh's threads, and must not block.
    ///
    /// # Errors
    /// [`RosError::Name`] for a topic that cannot be, [`RosError::Zenoh`] when the node is closed.
    pub fn subscription<M: RosMessage>(
        &self,
        topic: &str,
        qos: Qos,
        on_message: impl Fn(Received<M>) + Send + Sync + 'static,
    ) -> Result<Subscription, RosError> {
        Subscription::declare(self, self.endpoint::<M>(EndpointKind::Subscription, topic, qos)?, on_message)
    }
}

impl Subscription {
    fn declare<M: RosMessage>(
        node: &Node,
        endpoint: Endpoint,
        on_message: impl Fn(Received<M>) + Send + Sync + 'static,
    ) -> Result<Self, RosError> {
        let received = move |sample: Sample| {
            if sample.kind() == SampleKind::Put {
                let attachment = sample.attachment().map(|bytes| Attachment::decode(&bytes.to_bytes()));
                let message = M::decode(&sample.payload().to_bytes());
                on_message(Received { message, attachment: attachment.and_then(Result::ok) });
            }
        };
        let subscriber = node
            .session()
            .declare_subscriber(endpoint.key_of_any_hash(node.domain()))
            .callback(received)
            .wait()
            .map_err(|cause| RosError::zenoh(format!("subscribe to {}", endpoint.topic), cause))?;
        let (token, _) = node.announce(&endpoint)?;
        Ok(Self { endpoint, _subscriber: subscriber, _token: token, _node: node.clone() })
    }

    /// What it hears, and how.
    #[must_use]
    pub fn endpoint(&self) -> &Endpoint {
        &self.endpoint
    }
}
