//! Learning from what is shown and told: beside the rounds, which it follows.

mod ahead;
mod believing;
mod budget;
mod changes;
mod config;
mod following;
mod inspect;
mod judged;
mod labelling;
mod memory;
mod naming;
mod own_rules;
mod recent_rounds;
mod scrutinising;
mod setup;
mod sharing;
mod shelf;
mod state;
mod unresolved;
mod untrained;
mod weighed;

pub use changes::TrainingChange;
pub use config::{LearningConfig, LearningConfigError};
pub use memory::{MemoryError, RecordChange, RobotMemory};
pub use own_rules::OwnRules;
pub use setup::{LearningError, LearningSetup};
pub use shelf::Shelf;
pub(crate) use state::{Declined, Learning};
#[cfg(test)]
pub(crate) use unresolved::training_key;
pub use untrained::{ToTrain, Untrained};
