//! A robot's mind, made at its start and when a memory comes late.

use std::sync::Arc;

use gestalt_protocol::{FusionRule, RobotId};
use gestalt_strategies::{Fuse, Life, Mind, MindConfig, MindConfigError, Vocabulary};

use crate::seal::Seal;

/// A mind that fuses votes by its configuration's rule, or by your own.
pub(crate) fn new_mind(
    id: RobotId,
    life: Life,
    config: MindConfig,
    fusion: Option<Arc<dyn Fuse>>,
    seal: Option<&Seal>,
    vocabulary: Option<Vocabulary>,
) -> Result<Mind, MindConfigError> {
    let mind = match fusion {
        None => Mind::new(id, life, config)?,
        // The name of your own rule is none that a configuration could name.
        Some(fusion) => {
            Mind::new(id, life, MindConfig { rule: FusionRule::default(), ..config })?.fused_by(fusion)
        }
    };
    let mind = match vocabulary {
        None => mind,
        Some(vocabulary) => mind.naming(vocabulary),
    };
    Ok(match seal {
        None => mind,
        Some(seal) => mind.signed_by(seal.signer()),
    })
}
