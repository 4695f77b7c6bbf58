//! The wall around a sealed swarm: links by TLS, between those whose certificates its authority signed.
//!
//! Zenoh tells of a certificate its common name alone, so all that is to be checked stands there: which swarm, who, and with which key
//! (see [`Name`]). Whether that key is on the roster today is asked for at every link that comes, and at all of them when the roster
//! changes. The key on the wire is the one that statements are signed with; neither signs anything that could be taken for the other's.

mod certificate;
mod config;
mod credentials;
mod door;
mod knocks;
mod name;
mod seat;

pub use certificate::{Certificate, CertificateError};
pub(crate) use config::{bounded, client, robot};
pub use credentials::Credentials;
pub(crate) use door::{Door, Stranger, Visitor};
pub(crate) use knocks::Knocks;
pub use name::Bearer;
pub(crate) use seat::Seat;
