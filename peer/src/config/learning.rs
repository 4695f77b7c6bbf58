//! How a robot learns, as its configuration file says it.

use std::path::PathBuf;

use gestalt_strategies::LearningConfig;
use serde::{Deserialize, Serialize};

/// Learning from instructor feedback.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LearningSection {
    /// Whether the robot learns at all.
    pub enabled: bool,
    /// What it starts from.
    pub from: LearnFrom,
    /// The file it keeps its memory in; none: nothing is kept across restarts.
    pub memory: Option<PathBuf>,
    /// What its random choices follow from, together with its id and the number of its start.
    pub seed: u64,
    /// What it keeps, shares and forgets.
    pub samples: LearningConfig,
}

/// What a robot's learning starts from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LearnFrom {
    /// The model's classifier: it votes from the first round on, and learns on.
    #[default]
    Model,
    /// Nothing: of the model it takes the feature space and the vocabulary, and no gesture is known.
    Nothing,
}
