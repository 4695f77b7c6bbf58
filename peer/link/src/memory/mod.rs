//! A robot's memory on disk: what it keeps over a restart, and the thread that writes it.
//!
//! Damaged, foreign, missing, late, removed, full: each is an error of its own, see [`StoreError`], and none of them is
//! passed over in silence.

mod bytes;
mod error;
mod place;
mod scribe;
mod store;
#[cfg(test)]
pub(crate) mod tests;

pub use error::StoreError;
pub(crate) use place::{FilePlace, Place};
pub(crate) use scribe::{Assignment, Found, Scribe, Told};
pub(crate) use store::{Records, Store};
