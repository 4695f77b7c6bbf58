//! What a robot says of what it sees.

use serde::{Deserialize, Serialize};

use crate::bounded;
use crate::id::{ClassId, RobotId, RoundId, Stamp, VocabularyId};
use crate::limits::MAX_CLASSES;
use crate::signature::Signature;

/// One robot's evidence in one round: the whole sum so far, so that the latest replaces all earlier ones and
/// loss, repetition and reordering cost freshness, never correctness.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Vote {
    /// The round this is evidence for.
    pub round: RoundId,
    /// The list of gestures the components of `evidence` stand for.
    pub vocabulary: VocabularyId,
    /// Centred log-evidence per class (natural logarithm, sums to 0, clipped by the author's ±c); empty when
    /// the author takes part but has seen nothing.
    #[serde(deserialize_with = "bounded::vec::<_, _, MAX_CLASSES>")]
    pub evidence: Vec<f32>,
    /// The sum of the frames' weights behind the evidence: the number of independent looks, `0.0..`.
    pub looks: f32,
    /// The log-evidence for a gesture that the author was never taught, or none at all, on the scale of `evidence` and clipped like it. `None`: the
    /// author cannot tell, or has seen nothing. A gesture of the list that it was never taught is as likely as this.
    #[serde(default)]
    pub unknown: Option<f32>,
    /// The gestures that were named since, ascending: the last components of `evidence` stand for them, all before for those of the list.
    #[serde(default, deserialize_with = "bounded::vec::<_, _, MAX_CLASSES>")]
    pub named: Vec<ClassId>,
}

impl Vote {
    /// How many gestures of the list it is evidence for: all of them, or none.
    #[must_use]
    pub fn listed(&self) -> usize {
        self.evidence.len().saturating_sub(self.named.len())
    }

    /// The evidence for that gesture; `None` where its author does not know it, or has seen nothing.
    #[must_use]
    pub fn evidence_for(&self, class: ClassId) -> Option<f32> {
        place(self.listed(), &self.named, class).and_then(|place| self.evidence.get(place).copied())
    }
}

/// The place of a gesture among so many of the list, which come first, and those that were named, which follow in ascending order.
pub(crate) fn place(listed: usize, named: &[ClassId], class: ClassId) -> Option<usize> {
    if class.is_named() {
        named.binary_search(&class).ok().map(|place| listed + place)
    } else {
        Some(class.index()).filter(|place| *place < listed)
    }
}

/// A vote as its author stamped it, passed on by another robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldVote {
    /// Who cast it.
    pub robot: RobotId,
    /// The author's stamp on it.
    pub stamp: Stamp,
    /// The vote itself.
    pub vote: Vote,
    /// The author's signature under the [`Envelope`](crate::Envelope) that it came in.
    pub signature: Option<Signature>,
}
