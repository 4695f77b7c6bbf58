//! What arrives from a network, thrown at whatever reads it.
//!
//! A [`Target`] takes bytes and panics if a property that it stands for does not hold: what is read is written so that it reads the
//! same, no more memory is taken than is promised, nobody but a member votes, never two gestures are final for one round. Bytes come
//! from `corpus/`, from [`Fuzzer`], which changes valid ones by chance, and from libFuzzer, which is guided by coverage
//! (`make fuzz`).
//!
//! ```text
//! values ─► seeds ─► corpus ─► mutate ─► Target::run ─► a decoder, or three minds and a network ─► oracle
//! ```
//!
//! Signatures are [`Fake`](gestalt_trust::Fake): anybody can make anybody's, so the fuzzer gets behind them where it is to.

pub mod corpus;
mod engine;
mod gate;
mod memory;
mod mutate;
mod robot;
mod swarm;
mod targets;
mod values;

pub use engine::{Fuzzer, keep, passes};
pub use robot::taken_in;
pub use targets::{Target, contradicts};
