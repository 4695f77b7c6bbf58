//! Which personal sample is worth sharing next.

mod contract;
mod herding;
mod k_center;
mod margin;
mod novelty;
mod random;
mod representativity;
mod rule;

pub use contract::Selection;
pub use herding::HerdingSelection;
pub use k_center::KCenter;
pub use margin::Margin;
pub use novelty::Novelty;
pub use random::RandomSelection;
pub use representativity::RepresentativitySelection;
pub use rule::{SelectionRule, UnknownSelection};
