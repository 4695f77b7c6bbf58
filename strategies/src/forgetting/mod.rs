//! Which sample can be spared when there are too many.

mod class_balanced_reservoir;
mod contract;
mod fifo;
mod herding;
mod random;
mod redundancy;
mod representativity;
mod reservoir;
mod rule;

pub use class_balanced_reservoir::ClassBalancedReservoir;
pub use contract::Forgetting;
pub use fifo::Fifo;
pub use herding::HerdingForgetting;
pub use random::RandomForgetting;
pub use redundancy::Redundancy;
pub use representativity::RepresentativityForgetting;
pub use reservoir::Reservoir;
pub use rule::{ForgettingRule, UnknownForgetting};
