//! What a robot is about to ask for.

use std::time::Duration;

use gestalt_protocol::{Holding, RobotId};

/// A decision that is lacking here.
#[derive(Clone, Debug)]
pub(super) struct Wanted {
    pub holder: RobotId,
    pub holding: Holding,
    pub due: Duration,
    /// How often it was asked for.
    pub asked: u8,
}
