//! A swarm on one machine: who is in it, who is linked to whom, and how well it did.

pub mod curve;
mod members;
mod roster;
mod score;

pub use members::{Members, MembersError};
pub use roster::{Roster, RosterError};
pub use score::{Round, Score, Tally};
