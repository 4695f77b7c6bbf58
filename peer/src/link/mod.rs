//! The Zenoh host of the mind: sessions, links, keys.

mod account;
mod announcement;
mod config;
mod error;
mod identity;
mod inbox;
mod session;
mod topology;

pub use announcement::Announcement;
pub use config::{LinkConfig, Scouting};
pub use error::LinkError;
pub use identity::fresh_nonce;
