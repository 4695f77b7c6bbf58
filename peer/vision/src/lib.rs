//! How a robot of a Gestalt swarm sees.
//!
//! ```text
//! Source ─► Frame ─► Sight ─┬─► MotionDetector ─► Change (a gesture is shown, is gone)
//!                           └─► Perception ─► Observation (a feature vector with its quality)
//! ```
//!
//! [`source::Source`] is where frames come from: a camera, a file, or a rendered hand, the embedded default. [`perception::Perception`]
//! turns a frame of any camera into features that mean the same for all, [`motion::MotionDetector`] tells when a hand is held still, and
//! [`sight::Sight`] is both, for one camera. [`eyes::Eyes`] are perception that was learned, with the small
//! networks of [`network`]. [`model::RobotModel`] is a classifier trained on such features. This crate knows
//! nothing of other robots; OpenCV is behind the feature `opencv` (on by default), without which there are only descriptions, and
//! the networks' arithmetic.

pub mod camera_model;
pub mod config;
pub mod dataset;
#[cfg(feature = "opencv")]
pub mod eyes;
#[cfg(feature = "opencv")]
pub mod human;
#[cfg(feature = "opencv")]
pub mod model;
pub mod model_file;
#[cfg(feature = "opencv")]
pub mod motion;
pub mod network;
#[cfg(feature = "opencv")]
pub mod perception;
pub mod pose;
#[cfg(feature = "opencv")]
mod reduction;
#[cfg(feature = "opencv")]
pub mod sight;
#[cfg(feature = "opencv")]
pub mod source;
pub mod steady;
#[cfg(feature = "opencv")]
pub mod survey;
#[cfg(feature = "opencv")]
pub mod variation;
pub mod vocabulary;
