//! The Zenoh host of the mind: sessions, links, keys.

mod account;
mod announcement;
mod apprentice;
mod census;
mod client;
mod config;
mod error;
mod frames;
mod guest;
mod host;
mod identity;
mod inbox;
mod keeper;
mod news;
mod presence;
mod robot;
mod session;
mod topology;
mod trainer;

pub use announcement::Announcement;
pub use apprentice::RobotLearning;
pub use client::{Client, Decisions};
pub use config::{LinkConfig, Scouting};
pub use error::LinkError;
pub use frames::{FrameArrival, FrameGate, FrameSender};
pub use guest::GuestConfig;
pub use identity::fresh_nonce;
pub use news::{Heard, News};
pub use robot::{Event, Robot, RobotConfig};
