//! How a robot of a Gestalt swarm sees, talks, and gets run.
//!
//! ```text
//! source ─► perception ─► eye ─► Robot (link: Zenoh + the mind) ─► votes, decisions ─► other robots, clients
//!                                  └─ the same mind in `emulation`, on a seeded network
//! ```
//!
//! [`link::Robot`] is a robot without eyes, for a controller with a camera of its own; [`body::Body`] is a robot with one,
//! from a [`config::Config`]. Cameras without a computer stream ([`stream::Sender`]) to a fusion centre ([`center::Center`]).
//! [`link::Client`] watches a swarm without being part of it. The verbs of the binary
//! `gestalt` are in [`cli`].
//!
//! OpenCV sits behind the feature `opencv` (on by default): without it, swarms can be watched, instructed and
//! emulated, and [`link::Robot`] works as ever.

#[cfg(feature = "opencv")]
pub mod body;
pub mod camera_model;
#[cfg(feature = "opencv")]
pub mod camera_report;
#[cfg(feature = "opencv")]
pub mod center;
pub mod cli;
pub mod config;
pub mod confusion;
pub mod dataset;
pub mod emulation;
#[cfg(feature = "opencv")]
pub mod experiment;
pub mod explain;
#[cfg(feature = "opencv")]
pub mod eye;
#[cfg(feature = "opencv")]
pub mod human;
pub mod link;
pub mod memory;
#[cfg(feature = "opencv")]
pub mod model;
pub mod model_file;
#[cfg(feature = "opencv")]
pub mod motion;
#[cfg(feature = "opencv")]
pub mod perception;
#[cfg(feature = "opencv")]
pub mod picture;
pub mod pose;
#[cfg(feature = "opencv")]
pub mod sight;
#[cfg(feature = "opencv")]
pub mod source;
#[cfg(feature = "opencv")]
pub mod stream;
#[cfg(feature = "opencv")]
pub mod survey;
#[cfg(feature = "opencv")]
pub mod swarm;
pub mod topology;
mod worker;
