//! A robot's memory on disk: what it keeps over a restart, and the thread that writes it.

mod scribe;
mod store;

pub(crate) use scribe::Scribe;
pub use store::{Store, StoreError};
