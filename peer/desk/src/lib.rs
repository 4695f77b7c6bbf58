//! A swarm as a client sees it, and a page to watch it, teach it and measure it.
//!
//! ```text
//! Zenoh ─► Client ─► Input ─► View ─► state ─► Board ─► page in a browser (server-sent events)
//!            ▲                   └──► metrics ─► Prometheus
//!            └────── Instruction ◄── "look", "right", "that was three" ◄── page
//! ```
//!
//! [`View`] is pure: it takes in what a client hears, and time is handed in. [`Desk`] keeps one true and serves it over HTTP;
//! what it can bear and whom it lets in is in [`Door`]. It is no member of the swarm: when it dies nobody notices, and a
//! reader that is too slow costs the swarm nothing.

mod asks;
mod board;
mod desk;
mod door;
mod error;
mod follow;
mod foxglove;
mod known;
mod metrics;
mod page;
mod tap;
pub mod view;
mod word;

pub use desk::Desk;
pub use door::{Address, Door, Limits, Token};
pub use error::DeskError;
pub use foxglove::{Foxglove, Visits};
pub use tap::Tap;
pub use view::{Event, Input, SHOWN, View};
pub use word::Word;
