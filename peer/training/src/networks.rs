//! The three networks as they are trained, and their weights as they are shipped.

mod counter;
mod finder;
mod layers;
mod refiner;
mod shipped;
#[cfg(test)]
mod tests;

pub use counter::{Counter, EMBEDDING, FEATURES};
pub use finder::Finder;
pub use refiner::Refiner;
pub use shipped::{Weights, encode};
