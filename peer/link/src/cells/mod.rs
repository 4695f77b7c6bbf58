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

pub(crate) use keeper::CellKeeper;
pub(crate) use relay::Foundation;
