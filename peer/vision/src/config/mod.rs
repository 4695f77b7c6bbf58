//! What can be set about a robot's eyes, as configuration files say it.

mod device;
mod layer;
mod motion;
mod schedule;

pub use device::DeviceSettings;
pub use layer::LayerConfig;
pub use motion::{MotionConfig, MotionConfigError};
pub use schedule::Schedule;
