//! What an attacker may try on a swarm, and what comes of it.
//!
//! Each [`Attack`] plays one adversary against a swarm of honest minds, in a network in memory with virtual time. Every run
//! is played twice with one seed, once with an adversary that keeps silent: what honest robots say, hold and know in the
//! two runs is compared. So "nothing" means nothing: byte for byte what they would have said without the attack. What they
//! refuse has to be named by a counter.
//!
//! ```text
//! Attack ─► Swarm in peace ──┐
//!       └─► Swarm at war ────┴─► judge ─► Played: reached or why not, what was refused
//! ```
//!
//! The emulated robots are those of `gestalt-link` without Zenoh: the same mind, behind a [port](swarm) that takes the same
//! bytes under the same keys, and in a sealed swarm asks `gestalt-trust` the same questions (of which a thread remembers the answers). `make attack` prints the table.

pub mod arguments;
pub mod attack;
pub mod attacks;
mod beside;
mod forged;
mod on_all_cores;
pub mod swarm;
pub mod table;
mod trust;

pub use attack::{Attack, Counted, Played, Setting, Tier};
pub use attacks::all;
pub use on_all_cores::run;
