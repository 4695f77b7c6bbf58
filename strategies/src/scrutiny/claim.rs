//! A sample as what it says.

use gestalt_protocol::{ClassId, RobotId};

/// That a gesture lies at a place in the feature space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Claim<'a> {
    /// Names the sample in the training set.
    pub key: u64,
    /// Who says so.
    pub author: RobotId,
    /// Whether another robot shared it; this robot's own are never judged.
    pub is_of_others: bool,
    /// The gesture that it is trained on as.
    pub class: ClassId,
    /// Where.
    pub vector: &'a [f32],
}
