//! What robots say to robots.

use serde::{Deserialize, Serialize};

use crate::announcement::Announced;
use crate::bounded;
use crate::decision::{Decision, Rank};
use crate::holding::{Holder, Holding};
use crate::id::{RobotId, RoundId, Stamp};
use crate::limits::MAX_ROBOTS;
use crate::naming::Namings;
use crate::question::Asked;
use crate::sample::{Batches, Digest, Know, Lessons, Samples};
use crate::vote::{HeldVote, Vote};

/// Everything a robot says to other robots. The variants' order is part of the wire format.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Message {
    /// To all: the author's evidence in a round.
    Vote(Vote),
    /// To one neighbour: what the author has of the newest round, so that each can give the other what it lacks.
    Have(Have),
    /// To one neighbour: what it was found to lack.
    Give(Give),
    /// To all from their author: samples to learn from.
    Samples(Samples),
    /// To one neighbour: all samples and lessons that the author has, in short.
    Know(Know),
    /// To one neighbour: what instructors said and it has not heard.
    Lessons(Lessons),
    /// To one neighbour that lacks them: samples as their authors shared them.
    Batches(Batches),
    /// To all: which decision the author holds.
    Holding(Holding),
    /// To the swarm and its clients: a decision, in JSON. This is what its announcer signs of it.
    Announced(Announced),
    /// To one neighbour: what instructors named and it may not have heard.
    Namings(Namings),
    /// To the swarm and its clients: a question, in JSON. This is what its asker signs of it.
    Asked(Asked),
}

/// What a robot holds of the newest round it knows, in short.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Have {
    /// The newest round the author knows; `None` before the first.
    pub round: Option<RoundId>,
    /// The rank of the decision the author holds for that round.
    pub decision: Option<Rank>,
    /// A digest of the words on what robots hold for that round, as far as the author knows them.
    pub holders: u16,
    /// Which votes of that round the author holds; empty once the round is over.
    #[serde(deserialize_with = "bounded::vec::<_, _, MAX_ROBOTS>")]
    pub votes: Vec<(RobotId, Stamp)>,
    /// All samples and lessons the author has, as digests; absent from a robot that does not learn.
    pub knowledge: Option<Digest>,
    /// Whether this is itself an answer to a [`Have`]; such a one is answered with a [`Give`] only, so that two
    /// robots never talk in circles.
    pub answer: bool,
}

/// What a neighbour was found to lack.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Give {
    /// The greatest decision the author holds for the newest round.
    pub decision: Option<Decision>,
    /// Votes the neighbour lacks or has only older versions of.
    #[serde(deserialize_with = "bounded::vec::<_, _, MAX_ROBOTS>")]
    pub votes: Vec<HeldVote>,
    /// What robots said that they hold for that round, those words that the neighbour lacks among them.
    #[serde(deserialize_with = "bounded::vec::<_, _, MAX_ROBOTS>")]
    pub holders: Vec<Holder>,
}
