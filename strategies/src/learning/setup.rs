//! What a robot needs to learn, and why it may not be able to.

use std::fmt;
use std::sync::Arc;

use gestalt_rounds::Vocabulary;
use gestalt_svm::FeatureSpace;
use thiserror::Error;

use super::config::{LearningConfig, LearningConfigError};
use super::memory::{MemoryError, RobotMemory};
use super::own_rules::OwnRules;
use crate::training_set::RestoreError;

/// What a robot needs to learn.
pub struct LearningSetup {
    /// Its parameters.
    pub config: LearningConfig,
    /// The space its samples lie in; all robots of a swarm need the same.
    pub space: Arc<FeatureSpace>,
    /// The gestures there are to be learned.
    pub vocabulary: Vocabulary,
    /// Where chance comes from.
    pub rng: Box<dyn rand::Rng + Send>,
    /// What the robot remembers from before; `None` for a robot whose host keeps nothing: such a one is never owed an
    /// [`Input::Remembered`](crate::Input::Remembered).
    pub memory: Option<RobotMemory>,
    /// The user's rules in place of those that the parameters name.
    pub rules: OwnRules,
}

impl fmt::Debug for LearningSetup {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("LearningSetup").field("config", &self.config).finish_non_exhaustive()
    }
}

/// Why a robot cannot learn.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum LearningError {
    /// Its parameters.
    #[error(transparent)]
    Config(#[from] LearningConfigError),
    /// Fewer bytes for what a round shares than one sample takes.
    #[error(
        "share_bytes is {given}, and one sample of this model takes up to {least} in its envelope: nothing would ever be shared; choose at least {least}, a shorter precision, or null for no bound"
    )]
    ShareBytes {
        /// The bytes that a round may share.
        given: u32,
        /// How many one sample takes.
        least: usize,
    },
    /// What it remembers is not its own.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// What it remembers contradicts itself.
    #[error("the memory is damaged: {0}; move the file away")]
    Restore(#[from] RestoreError),
}
