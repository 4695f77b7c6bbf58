//! How a robot of a Gestalt swarm sees, talks, and gets run.

#[cfg(feature = "opencv")]
pub mod perception;
