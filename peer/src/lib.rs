//! How a robot of a Gestalt swarm sees, talks, and gets run.

pub mod camera_model;
pub mod link;
#[cfg(feature = "opencv")]
pub mod perception;
#[cfg(feature = "opencv")]
pub mod picture;
#[cfg(feature = "opencv")]
pub mod source;
