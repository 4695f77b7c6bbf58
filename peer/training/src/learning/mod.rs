//! What networks are trained with: convolutions, their gradients, and the steps downhill.
//!
//! Small pictures with few channels are what general libraries are slowest at: this does the same steps in a quarter of the
//! time, and the same seed gives the same weights.

mod convolution;
mod graph;
mod parameters;
mod phases;
mod planes;

pub use graph::{Graph, Id, Normalised, Shape};
pub use parameters::{Descent, Parameter, Parameters};
pub use planes::Planes;
