//! What can be set about a robot's eyes, as configuration files say it.

mod layer;
mod motion;
mod schedule;

pub use layer::LayerConfig;
pub use motion::{MotionConfig, MotionConfigError};
pub use schedule::Schedule;
