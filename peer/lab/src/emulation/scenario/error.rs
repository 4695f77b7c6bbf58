//! What is wrong with a scenario.

use gestalt_strategies::{LearnError, LearningConfigError, MindConfigError};
use thiserror::Error;

/// A scenario that cannot be run; nothing was.
#[derive(Debug, Error)]
pub enum ScenarioError {
    /// The file cannot be read.
    #[error("cannot read the scenario {path}: {source}")]
    Read {
        /// Which file.
        path: String,
        /// Why not.
        source: std::io::Error,
    },
    /// The text is no scenario.
    #[error("scenario {path}, at {key}: {cause}")]
    Syntax {
        /// Which file.
        path: String,
        /// Where in it.
        key: String,
        /// What is wrong there.
        cause: String,
    },
    /// A value no scenario can have.
    #[error("{key}: {mend}")]
    Value {
        /// Which key.
        key: &'static str,
        /// What to write instead.
        mend: String,
    },
    /// Parameters no mind can work with.
    #[error("mind: {0}")]
    Mind(#[from] MindConfigError),
    /// Parameters no robot can learn with.
    #[error("learning.robots: {0}")]
    Learning(#[from] LearningConfigError),
    /// Nothing that support vector machines can be trained with.
    #[error("learning: {0}")]
    Learner(#[from] LearnError),
}
