//! Learning from what is shown and told: beside the rounds, which it follows.

mod aside;
mod changes;
mod config;
mod labelling;
mod lived;
mod memory;
mod own_rules;
mod setup;
mod sharing;
mod state;

#[cfg(test)]
pub(crate) use aside::training_key;
pub use changes::TrainingChange;
pub use config::{LearningConfig, LearningConfigError};
pub use memory::{Change, Memory, MemoryError};
pub use own_rules::OwnRules;
pub use setup::{LearningError, LearningSetup};
pub(crate) use state::{Declined, Learning};
