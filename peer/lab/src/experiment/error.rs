//! Why an experiment cannot be conducted.

use std::io;
use std::path::PathBuf;

use gestalt_strategies::LearnError;
use gestalt_vision::dataset::DatasetError;
use gestalt_vision::model::ModelError;
use gestalt_vision::perception::PerceptionError;
use gestalt_vision::source::SourceError;
use thiserror::Error;

use super::program::Program;
use crate::emulation::ScenarioError;

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
    /// A shipped model that cannot be read.
    #[error(transparent)]
    Model(#[from] ModelError),
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
    #[error("cannot write {}: {source}: its folder must be there, with room, and yours to write to", path.display())]
    Write {
        /// Which.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A plot that cannot be drawn.
    #[error(transparent)]
    Draw(#[from] gestalt_draw::DrawError),
    /// A table of results that is none.
    #[error("cannot read the results {}: {cause}; choose another folder, or delete the file to begin anew", path.display())]
    Table {
        /// Which.
        path: PathBuf,
        /// Why.
        cause: csv::Error,
    },
    /// Another run is under way in the folder.
    #[error("another gestalt works in {}: wait for it, or choose another folder", .0.display())]
    Busy(PathBuf),
    /// The folder holds the results of something else.
    #[error("{} holds the results of another experiment or dataset: choose another folder", .0.display())]
    Other(PathBuf),
    /// What is in the folder was measured on other pictures.
    #[error(
        "{} was measured on other pictures than the datasets hold now, or by a version that did not write down on which: put the \
         pictures back as they were, or choose another folder", .0.display()
    )]
    OtherPictures(PathBuf),
    /// What is in the folder was measured with another version of this program.
    #[error(
        "{} was measured with {before}, this is {now}: the two would not be comparable; choose another folder, or go on \
         with that version", folder.display()
    )]
    OtherProgram {
        /// The folder.
        folder: PathBuf,
        /// What measured what is there.
        before: Box<Program>,
        /// What would go on.
        now: Box<Program>,
    },
    /// It was to stop before its end.
    #[error("stopped before the end: the same call continues")]
    Stopped,
}
