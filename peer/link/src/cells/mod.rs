//! Cells: how a swarm of hundreds is linked.
//!
//! Zenoh's routers work out anew how to reach each other whenever a link comes or goes, which takes time with the third power of their
//! number: a hundred robots may all be routers, three hundred may not. So in a swarm of cells few robots run a relay, a Zenoh router beside
//! their own session, and every robot is a client of one relay, which is its own or another's. Relays link to each other as robots of a
//! smaller swarm do ([`neighbourhood`](crate::neighbourhood)).
//!
//! ```text
//!   robot ──┐                 ┌── robot
//!   robot ──┤ relay ─── relay ├── robot      a relay runs in the process of one of its robots
//!   robot ──┘    └── relay ┘  └── robot
//! ```
//!
//! Nobody says who runs a relay: [`choice`] does, from what each robot hears.

mod choice;
mod keeper;
mod relay;

use serde::{Deserialize, Serialize};

pub(crate) use keeper::CellKeeper;
pub(crate) use relay::Foundation;

/// How large cells are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Cells {
    /// For how many robots a relay has room beside the one that runs it. Range 1 to 50.
    pub size: usize,
}

impl Cells {
    /// The largest `size`. A sealed robot has no more than 64 sessions with others, and some of them are relays and clients.
    pub const MAX_SIZE: usize = 50;
}

impl Default for Cells {
    fn default() -> Self {
        Self { size: 32 }
    }
}
