//! A robot's mind, made at its start and when a memory comes late.

use std::sync::Arc;

use gestalt_protocol::{FusionRule, RobotId};
use gestalt_strategies::{Fuse, Life, Mind, MindConfig, MindConfigError};

/// A mind that fuses votes by its configuration's rule, or by your own.
pub(crate) fn new_mind(
    id: RobotId,
    life: Life,
    config: MindConfig,
    fusion: Option<Arc<dyn Fuse>>,
) -> Result<Mind, MindConfigError> {
    let Some(fusion) = fusion else { return Mind::new(id, life, config) };
    // The name of your own rule is none that a configuration could name.
    let config = MindConfig { rule: FusionRule::default(), ..config };
    Ok(Mind::new(id, life, config)?.fused_by(fusion))
}
