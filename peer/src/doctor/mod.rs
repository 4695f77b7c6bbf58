//! What is wrong with a robot or its swarm, and how to mend it.
//!
//! ```text
//! configuration, files, camera, ports ─► RobotFacts ─┬─► rules ─► findings: what, why it matters, the fix
//! statuses of the robots that answer ──► SwarmFacts ─┘
//! ```
//!
//! The rules ([`robot`], [`swarm`]) are pure: facts in, findings out. Whoever gathers the facts changes nothing but a file
//! without a name that is written beside a robot's memory, to see that there is room. The findings are listed in
//! `docs/doctor.md`.

mod finding;
pub mod gather;
pub mod robot;
pub mod swarm;
#[cfg(test)]
mod tests;

pub use finding::{Finding, Severity};
