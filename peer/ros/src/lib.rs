//! ROS 2 without a ROS installation: a node that ROS nodes see as one of theirs.
//!
//! Since Kilted, `rmw_zenoh` is a middleware of the first tier of ROS 2: its nodes talk Zenoh, with messages in CDR under keys
//! that name topic, type and type hash, and find each other by liveliness tokens. This crate speaks the same: [`Node`] announces
//! itself, [`Publisher`]s and [`Subscription`]s carry the few standard messages that a swarm needs ([`message`]).
//!
//! A node has a Zenoh session of its own, as a client of the ROS system's router (`rmw_zenohd`), so that nothing of ROS leaks
//! into a swarm, nor the reverse. It needs no ROS package, and brings none: custom messages would need one at every user's.
//!
//! The format is that of `rmw_zenoh_cpp` 0.2.4 and later (Jazzy, Kilted, Rolling, Humble); type hashes are those of the message
//! packages of Jazzy 5.3.6 and Kilted 5.5.1, which agree. Humble writes no type hash; its publishers are heard, and for its
//! subscribers set [`NodeConfig::type_hashes`] to `false`.

mod attachment;
pub mod cdr;
mod error;
mod graph;
pub mod message;
mod node;
mod publisher;
mod qos;
mod subscription;

pub use attachment::{Attachment, AttachmentError};
pub use error::{NameError, RosError};
pub use graph::{Endpoint, EndpointKind, Gid, GraphError, NodeName};
pub use message::RosMessage;
pub use node::{Node, NodeConfig};
pub use publisher::Publisher;
pub use qos::Qos;
pub use subscription::{Received, Subscription};
