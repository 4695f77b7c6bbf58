//! Experiments: how well swarms learn, over settings and seeds, with intervals.
//!
//! ```text
//! file ─► plan: cells (a setting each) ─┐
//! hands ─► pool: moments seen from places ┼─► trial (cell, seed): whole minds in the emulated network ─► CSV
//! hands ─► school: space, classifier ───┘                                        table, plots ◄─┘
//! ```

mod asking;
mod chart;
mod drift;
mod error;
mod eyes;
mod figures;
mod fingerprint;
mod folder;
mod ledger;
mod materials;
mod plan;
mod pool;
mod program;
mod progress;
pub mod recognition;
mod results;
mod runner;
mod school;
mod setting;
mod split;
mod standing;
mod summary;
#[cfg(test)]
mod tests;
mod trial;

pub use error::ExperimentError;
pub use materials::Materials;
pub use plan::{Axis, Cell, Choice, Experiment, Hands};
pub use pool::{Moment, Pool};
pub use program::Program;
pub use progress::Progress;
pub use results::Run;
pub use runner::{conduct, conduct_by};
pub use school::Schools;
pub use setting::{Drift, Method, Moments, Setting, Start};
pub use standing::Standing;
