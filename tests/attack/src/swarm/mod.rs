//! A swarm of honest minds in a network in memory, with virtual time and an adversary that may say anything.
//!
//! | file | question |
//! |---|---|
//! | `world` | what do all robots have in common? |
//! | `plan` | what is this swarm made of? |
//! | `robot` | what is one robot, and what is known of it from outside? |
//! | `port`, `believer` | what of what arrives does a mind hear, and believe? |
//! | `network` | what is said, and when does it arrive? |
//! | `course`, `shown` | what is shown and taught, and what becomes of it? |
//! | `adversary` | what can be said without being a robot? |

mod adversary;
mod believer;
mod course;
mod network;
mod plan;
mod port;
mod robot;
mod shown;
pub mod world;

pub use network::Swarm;
pub use plan::Plan;
pub use port::Parcel;
pub use robot::Account;
pub use shown::Shown;
