//! The state machine that lives through rounds: what the world tells it goes in, what it wants done comes out.
//!
//! ```text
//! Input ─► Rounds: course (open, look, close) ─► Output
//!                  voting (speak, decide)
//!                  announcing (the decision, aloud for the swarm)
//!                  hearing (votes and decisions of others)
//!                  placing (which rounds these are of)
//!                  repair (what a neighbour lacks)
//! ```

mod allowance;
mod announcing;
mod committee;
mod course;
mod expulsion;
mod follow;
mod hearing;
mod input;
mod inspect;
mod members;
mod output;
mod partners;
mod placing;
mod preempting;
mod repair;
mod rounds;
#[cfg(test)]
mod tests;
mod voting;
mod wanted;

pub use follow::{Follow, TAUGHT_AHEAD};
pub use input::Input;
pub use output::Output;
pub use rounds::Rounds;
