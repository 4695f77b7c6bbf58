//! How a robot of a Gestalt swarm is run.
//!
//! ```text
//! config ─► Body = eye (gestalt-vision) + Robot (gestalt-link: Zenoh and the mind) ─► votes, decisions ─► other robots, clients
//! ```
//!
//! [`body::Body`] is a robot with an eye, from a [`config::Config`], or with a camera of your own. Cameras without a computer
//! stream ([`stream::Sender`]) to a fusion centre ([`center::Center`]). The verbs of the binary `gestalt` are in [`cli`]. A
//! controller with a perception of its own needs none of this: it embeds `gestalt-link`.
//!
//! OpenCV sits behind the feature `opencv` (on by default): without it, swarms can be watched, instructed and emulated.

#[cfg(feature = "opencv")]
pub mod body;
#[cfg(feature = "opencv")]
pub mod camera_report;
#[cfg(feature = "opencv")]
mod camera_source;
#[cfg(feature = "opencv")]
pub mod capture;
#[cfg(feature = "opencv")]
pub mod center;
pub mod cli;
pub mod config;
pub mod doctor;
#[cfg(feature = "opencv")]
pub mod eye;
pub mod heaps;
#[cfg(feature = "opencv")]
pub mod model;
pub mod open_files;
#[cfg(feature = "opencv")]
pub mod opinion;
#[cfg(feature = "opencv")]
pub mod picture;
pub mod proof;
pub mod recording;
#[cfg(feature = "opencv")]
mod ros_camera;
#[cfg(feature = "opencv")]
mod ros_view;
pub mod service_manager;
#[cfg(feature = "opencv")]
pub mod stream;
#[cfg(feature = "opencv")]
pub mod swarm;
#[cfg(feature = "opencv")]
mod telling;
