//! What can be set about a robot's eyes, as configuration files say it.

mod device;
mod glove;
mod layer;
mod motion;
mod schedule;

pub use device::DeviceSettings;
pub use glove::Glove;
pub use layer::LayerConfig;
pub use motion::{MotionConfig, MotionConfigError};
pub use schedule::Schedule;
