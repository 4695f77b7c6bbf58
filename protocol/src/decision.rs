//! What the swarm settles on, and why.

use std::cmp::Ordering;

use serde::{Deserialize, Serialize};

use crate::bounded;
use crate::fusion_rule::FusionRule;
use crate::id::{ClassId, RobotId, RoundId, Stamp, VocabularyId};
use crate::limits::{MAX_CLASSES, MAX_ROBOTS};

/// The outcome of a round in the eyes of one robot.
///
/// Decisions of one round are totally ordered by [`Decision::rank`]; the greatest wins everywhere.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Decision {
    /// The round it ends.
    pub round: RoundId,
    /// The gesture; `None` says "no decision": the deadline passed and the votes did not suffice.
    pub class: Option<ClassId>,
    /// The fused probability of the top class, `0.0..=1.0`.
    pub confidence: f64,
    /// The robot that drew the conclusion.
    pub author: RobotId,
    /// What it was drawn from.
    pub certificate: Certificate,
}

/// What a decision was drawn from: enough to draw it again from the votes, or to doubt it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Certificate {
    /// The list of gestures the probabilities stand for.
    pub vocabulary: VocabularyId,
    /// How the votes were fused.
    pub rule: FusionRule,
    /// The fused probability of each class.
    #[serde(deserialize_with = "bounded::vec::<_, _, MAX_CLASSES>")]
    pub probabilities: Vec<f64>,
    /// The votes counted, by robot.
    #[serde(deserialize_with = "bounded::vec::<_, _, MAX_ROBOTS>")]
    pub votes: Vec<CountedVote>,
    /// Milliseconds from the opening of the round, as its author saw it, to the decision.
    pub elapsed_ms: u32,
}

/// One vote in a certificate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CountedVote {
    /// Whose vote.
    pub robot: RobotId,
    /// Which of that robot's votes.
    pub stamp: Stamp,
    /// The class that vote found likeliest.
    pub class: ClassId,
    /// What that vote weighed in the fusion, `0.0..`.
    pub weight: f32,
}

/// The place of a decision among the decisions of its round: any class before none, then the robots counted,
/// then the confidence, then the smaller author. The greatest wins.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Rank {
    /// Whether it names a gesture at all.
    pub decided: bool,
    /// How many robots' votes it rests on.
    pub robots: u32,
    /// The fused probability of its top class.
    pub confidence: f64,
    /// Who drew it.
    pub author: RobotId,
}

impl Ord for Rank {
    fn cmp(&self, other: &Self) -> Ordering {
        self.decided
            .cmp(&other.decided)
            .then(self.robots.cmp(&other.robots))
            .then(self.confidence.total_cmp(&other.confidence))
            .then(other.author.cmp(&self.author))
    }
}

impl PartialOrd for Rank {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Rank {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Rank {}

impl Decision {
    /// Its place among the decisions of the same round.
    #[must_use]
    pub fn rank(&self) -> Rank {
        Rank {
            decided: self.class.is_some(),
            robots: self.certificate.votes.len().try_into().unwrap_or(u32::MAX),
            confidence: self.confidence,
            author: self.author,
        }
    }
}
