//! What the swarm settles on, and why.

use std::cmp::Ordering;

use serde::{Deserialize, Serialize};

use crate::bounded;
use crate::fusion_rule::FusionRule;
use crate::id::{ClassId, RobotId, RoundId, Stamp, VocabularyId};
use crate::limits::{MAX_CLASSES, MAX_ROBOTS};
use crate::pool::Pool;
use crate::signature::Signature;
use crate::terms::Terms;
use crate::vote::{HeldVote, Vote, place};

/// More looks than this of one robot make no decision fresher.
const MAX_LOOKS: f32 = 16.0;

/// The outcome of a round in the eyes of one robot.
///
/// Decisions of one round are totally ordered by [`Decision::rank`]; the greatest wins everywhere.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Decision {
    /// The round it ends.
    pub round: RoundId,
    /// The gesture; `None` says "no decision": the deadline passed and the votes did not suffice.
    pub class: Option<ClassId>,
    /// The fused probability of the likeliest class, or of "unknown" where that is likelier, `0.0..=1.0`.
    pub confidence: f64,
    /// The robot that drew the conclusion.
    pub author: RobotId,
    /// Where it is announced: whether as many robots as its quorum are known to hold this gesture. What is final stands whatever else is
    /// decided in a part that was cut off. `false` between robots.
    #[serde(rename = "final")]
    pub is_final: bool,
    /// What it was drawn from.
    pub certificate: Certificate,
}

/// What a decision was drawn from: the votes themselves. Whoever reads it can draw it again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Certificate {
    /// The list of gestures the probabilities stand for.
    pub vocabulary: VocabularyId,
    /// How the votes were fused.
    pub rule: FusionRule,
    /// By which likeness and temperature, where the rule is a correlated pool.
    #[serde(default)]
    pub pool: Option<Pool>,
    /// The fused probability of each class.
    #[serde(deserialize_with = "bounded::vec::<_, _, MAX_CLASSES>")]
    pub probabilities: Vec<f64>,
    /// The fused probability of a gesture that nobody taught, or of none: with it the probabilities sum to 1. `None` where no robot could tell.
    #[serde(default)]
    pub unknown: Option<f64>,
    /// The gestures that were named since, ascending: the last of the probabilities are theirs, all before of those of the list.
    #[serde(default, deserialize_with = "bounded::vec::<_, _, MAX_CLASSES>")]
    pub named: Vec<ClassId>,
    /// The votes counted, by robot.
    #[serde(deserialize_with = "bounded::vec::<_, _, MAX_ROBOTS>")]
    pub votes: Vec<CountedVote>,
    /// The votes of those who took part and are not counted, by robot: they had seen nothing, or judge by another list of gestures.
    #[serde(deserialize_with = "bounded::vec::<_, _, MAX_ROBOTS>")]
    pub others: Vec<HeldVote>,
    /// n: how many robots its author had heard lately, itself included.
    pub robots: u32,
    /// q: how many it needed.
    pub quorum: u32,
    /// Milliseconds from the opening of the round, as its author saw it, to the decision.
    pub elapsed_ms: u32,
    /// What it goes by beside the rule and the quorum.
    #[serde(default)]
    pub terms: Terms,
}

impl Certificate {
    /// How many gestures of the list there are.
    #[must_use]
    pub fn listed(&self) -> usize {
        self.probabilities.len().saturating_sub(self.named.len())
    }

    /// The place of a gesture among the probabilities.
    #[must_use]
    pub fn place(&self, class: ClassId) -> Option<usize> {
        place(self.listed(), &self.named, class)
    }

    /// The gestures that the probabilities are of, in their order.
    pub fn classes(&self) -> impl Iterator<Item = ClassId> + '_ {
        (0..self.listed() as u32).map(ClassId).chain(self.named.iter().copied())
    }

    /// How many robots took part, whether or not their votes are counted.
    #[must_use]
    pub fn reached(&self) -> usize {
        self.votes.len() + self.others.len()
    }

    /// All votes that it brings, counted or not, as their authors said them.
    pub fn held_votes(&self) -> impl Iterator<Item = HeldVote> + '_ {
        self.votes.iter().map(CountedVote::held).chain(self.others.iter().cloned())
    }
}

/// One vote in a certificate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CountedVote {
    /// Whose vote.
    pub robot: RobotId,
    /// Which of that robot's votes.
    pub stamp: Stamp,
    /// The class that vote found likeliest.
    pub class: ClassId,
    /// What that vote weighs by the rule over all gestures that it lists, `0.0..`: for people. The fusion asks of the gestures that were taught alone.
    pub weight: f32,
    /// The vote, as its author said it.
    pub vote: Vote,
    /// The author's signature under the [`Envelope`](crate::Envelope) that it came in.
    pub signature: Option<Signature>,
}

impl CountedVote {
    /// The vote alone.
    #[must_use]
    pub fn held(&self) -> HeldVote {
        let Self { robot, stamp, vote, signature, .. } = self;
        HeldVote { robot: *robot, stamp: *stamp, vote: vote.clone(), signature: *signature }
    }
}

/// The place of a decision among the decisions of its round: any class before none, then the robots counted, then how much these
/// had seen, then the confidence, then the smaller author. The greatest wins.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Rank {
    /// Whether it names a gesture at all.
    pub decided: bool,
    /// How many robots' votes it rests on.
    pub robots: u32,
    /// The looks behind these votes, of no robot more than 16: votes are sums, so a later one has more.
    pub looks: f32,
    /// The fused probability of its top class.
    pub confidence: f32,
    /// Who drew it.
    pub author: RobotId,
}

impl Ord for Rank {
    fn cmp(&self, other: &Self) -> Ordering {
        self.decided
            .cmp(&other.decided)
            .then(self.robots.cmp(&other.robots))
            .then(self.looks.total_cmp(&other.looks))
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
            looks: self.certificate.votes.iter().map(|counted| counted.vote.looks.min(MAX_LOOKS)).sum(),
            confidence: self.confidence as f32,
            author: self.author,
        }
    }
}
