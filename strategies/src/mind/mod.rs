//! The robot's mind: a state machine that turns what a robot sees and hears into votes, decisions and samples to learn
//! from.

mod answers;
mod asks;
mod exchanges;
mod input;
mod inspect;
mod instruct;
mod machine;
mod naming;
mod output;
mod questions;
mod sample_repair;
#[cfg(test)]
mod tests;

pub use gestalt_rounds::{
    Refusal, Refusals, RoundsConfig as MindConfig, RoundsConfigError as MindConfigError,
};
pub use input::{Input, Instructed};
pub use machine::Mind;
pub use output::Output;
