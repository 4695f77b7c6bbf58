//! How a robot of a Gestalt swarm sees, talks, and gets run.

#[cfg(feature = "opencv")]
pub mod body;
pub mod camera_model;
pub mod cli;
pub mod config;
#[cfg(feature = "opencv")]
pub mod eye;
#[cfg(feature = "opencv")]
pub mod human;
pub mod link;
#[cfg(feature = "opencv")]
pub mod model;
#[cfg(feature = "opencv")]
pub mod model_file;
#[cfg(feature = "opencv")]
pub mod perception;
#[cfg(feature = "opencv")]
pub mod picture;
pub mod pose;
#[cfg(feature = "opencv")]
pub mod source;
#[cfg(feature = "opencv")]
pub mod swarm;
pub mod topology;
