//! Experiments: how well swarms learn, over settings and seeds, with intervals.
//!
//! ```text
//! file ─► plan: cells (a setting each) ─┐
//! hands ─► pool: moments seen from places ┼─► trial (cell, seed): whole minds in the emulated network ─► CSV
//! hands ─► school: space, classifier ───┘                                        table, plots ◄─┘
//! ```

mod chart;
mod eyes;
mod plan;
mod pool;
pub mod recognition;
mod results;
mod runner;
mod school;
mod setting;
mod table;
mod trial;

use std::io;
use std::path::PathBuf;

use gestalt_strategies::LearnError;
use thiserror::Error;

use crate::emulation::ScenarioError;
use gestalt_vision::dataset::DatasetError;
use gestalt_vision::perception::PerceptionError;
use gestalt_vision::source::SourceError;

pub use plan::{Axis, Cell, Choice, Experiment, Hands};
pub use pool::{Moment, Pool};
pub use results::Run;
pub use runner::{Materials, Progress, conduct};
pub use school::Schools;
pub use setting::{Drift, Method, Moments, Setting, Start};
pub use trial::Standing;

/// Why an experiment cannot be conducted. What was measured before is kept.
#[derive(Debug, Error)]
pub enum ExperimentError {
    /// The text is no experiment.
    #[error("experiment {}, at {key}: {cause}", path.display())]
    Syntax {
        /// Which file.
        path: PathBuf,
        /// Where in it.
        key: String,
        /// What is wrong there.
        cause: String,
    },
    /// A setting that cannot be run.
    #[error("{0}")]
    Setting(String),
    /// A swarm that cannot be emulated.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// Nothing to learn in.
    #[error(transparent)]
    Learner(#[from] LearnError),
    /// A folder that is no dataset.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// A picture that cannot be read, or a camera that cannot be.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// Eyes that cannot see.
    #[error(transparent)]
    Perception(#[from] PerceptionError),
    /// A file that cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// Which.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A file that cannot be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// Which.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A plot that cannot be drawn.
    #[error(transparent)]
    Draw(#[from] gestalt_draw::DrawError),
    /// The folder holds the results of something else.
    #[error("{} holds the results of another experiment or dataset: choose another folder", .0.display())]
    Other(PathBuf),
}
