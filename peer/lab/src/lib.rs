//! What if: swarms of real minds without a network, and experiments on them.
//!
//! [`emulation`] hosts the same [`Mind`](gestalt_strategies::Mind) that a real robot has, on a seeded network in one thread: the same seed gives the
//! same trace, byte for byte. `explain` (feature `charts`) draws what the rules of selection and forgetting choose;
//! `experiment` (feature `experiments`, with OpenCV) measures how well swarms see and learn, over settings and seeds.

pub mod emulation;
#[cfg(feature = "experiments")]
pub mod experiment;
#[cfg(feature = "charts")]
pub mod explain;
pub mod shape;
mod threads;
