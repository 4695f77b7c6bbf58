//! A swarm as a client sees it, a page to watch it, teach it and measure it, and the same live in Foxglove.
//!
//! ```text
//! Zenoh ─► Client ─► Input ─► View ─► state ─► Board ─► page in a browser (server-sent events)
//!            ▲                   └──► metrics ─► Prometheus
//!            └────── Instruction ◄── "look", "right", "that was three" ◄── page, Foxglove
//! ```
//!
//! [`View`] is pure: it takes in what a client hears, and time is handed in. [`Desk`] keeps one true and serves it over HTTP;
//! [`Foxglove`] hands on what passes as a recorder writes it. What they bear and whom they let in is in [`Door`]. They are no
//! members of the swarm: when they die nobody notices, and a reader that is too slow costs the swarm nothing.

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
pub use foxglove::{Foxglove, Viewing, Visits};
pub use tap::Tap;
pub use view::{APART, Event, Input, SHOWN, View, gesture_asked};
pub use word::Word;
