//! A sample as held, and the part of a set that it is in.

use std::sync::Arc;

use gestalt_protocol::{ClassId, RobotId, RoundId, SampleId};

/// The part of a training set that a sample is in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum SetPart {
    /// Own, not shared yet.
    Personal,
    /// Own, broadcast.
    Shared,
    /// Received from its author or from whoever held it.
    External,
}

impl SetPart {
    /// All parts.
    pub const ALL: [Self; 3] = [Self::Personal, Self::Shared, Self::External];
}

/// A sample as held.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldSample {
    /// Local arrival number: from 1, grows, is never used twice, also across restarts.
    pub key: u64,
    /// Where it is.
    pub part: SetPart,
    /// Its name in the swarm; `None` while it is personal.
    pub id: Option<SampleId>,
    /// The gesture shown.
    pub class: ClassId,
    /// The round it was seen in.
    pub round: RoundId,
    /// Coordinates in the robot's feature space.
    pub vector: Arc<[f32]>,
}

impl HeldSample {
    /// Who shared it, if anybody did.
    #[must_use]
    pub fn author(&self) -> Option<RobotId> {
        self.id.map(|id| id.author)
    }
}
