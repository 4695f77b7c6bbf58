//! Rules of your own, for all robots of an emulated swarm.

use std::sync::Arc;

use gestalt_strategies::{Fuse, OwnRules};

/// What robots share, forget and fuse by, where that is not what the scenario names. See `examples/own_rules.rs`.
#[derive(Clone, Debug, Default)]
pub struct Rules {
    /// Which samples they share, and which they forget.
    pub learning: OwnRules,
    /// How they fuse votes.
    pub fusion: Option<Arc<dyn Fuse>>,
}
