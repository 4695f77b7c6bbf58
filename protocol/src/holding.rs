//! What robots say that they hold.

use serde::{Deserialize, Serialize};

use crate::decision::{Decision, Rank};
use crate::decode::DecodeError;
use crate::id::{ClassId, RobotId, RoundId, Stamp};
use crate::signature::Signature;

/// Which decision a robot holds, in short: the decision itself is for those who lack it, and ask.
///
/// That a majority holds a gesture makes it final, so in a sealed swarm such a word counts for the robot alone that signed it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Holding {
    /// The round it ends.
    pub round: RoundId,
    /// The gesture.
    pub class: Option<ClassId>,
    /// Its place among the decisions of the round.
    pub rank: Rank,
    /// Whether the robot held another gesture of this round before: then it counts for none when it is asked whether a majority holds
    /// one.
    pub changed: bool,
}

/// A robot's word of what it holds as that robot stamped it, passed on by another one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Holder {
    /// Whose word.
    pub robot: RobotId,
    /// That robot's stamp on it.
    pub stamp: Stamp,
    /// The word itself.
    pub holding: Holding,
    /// That robot's signature under the [`Envelope`](crate::Envelope) that it came in.
    pub signature: Option<Signature>,
}

impl Decision {
    /// What a robot that holds it says of it to all; `changed` if it held another gesture before.
    #[must_use]
    pub fn holding(&self, changed: bool) -> Holding {
        Holding { round: self.round, class: self.class, rank: self.rank(), changed }
    }
}

impl Holding {
    pub(crate) fn check(&self) -> Result<(), DecodeError> {
        let Rank { looks, confidence, .. } = self.rank;
        let possible = looks.is_finite() && looks >= 0.0 && (0.0..=1.0).contains(&confidence);
        if possible { Ok(()) } else { Err(DecodeError::Impossible("a rank that no decision has")) }
    }
}
