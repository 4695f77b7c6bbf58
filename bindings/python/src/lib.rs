//! Gestalt for Python: `gestalt_swarm._native`, what is computed in Rust below the Python package `gestalt_swarm`.
//!
//! Everything here is thin: numbers come and go as bytes, settings and messages as JSON, and what is done is done by
//! `gestalt-strategies` and `gestalt-mind`. Manners are Python's, in `python/gestalt_swarm/`. While Rust works for long, the
//! interpreter is released to other threads.

// An interpreter that loads the extension brings Python's functions; a test harness of this crate would lack them.
#[cfg(not(test))]
mod ballot;
#[cfg(not(test))]
mod errors;
#[cfg(not(test))]
mod learner;
#[cfg(not(test))]
mod mind;
#[cfg(not(test))]
mod model;
#[cfg(not(test))]
mod module;
#[cfg(not(test))]
mod numbers;
#[cfg(not(test))]
mod rules;
#[cfg(not(test))]
mod sample;
#[cfg(not(test))]
mod training_set;
#[cfg(not(test))]
mod wire;
