//! One decision with its reasons.

use gestalt_protocol::{Announcement, ClassId, CountedVote, Reason, RobotId, RoundId, RoundOutcome, Vote};
use gestalt_strategies::{MindConfig, Vocabulary, outcome};
use serde::Serialize;

use super::text::{clipped, finite, gesture};

/// A decision for people's eyes: what was decided, and each vote that it rests on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DecisionView {
    /// The round it ends.
    pub round: RoundId,
    /// The gesture; `None` for "no decision".
    pub class: Option<ClassId>,
    /// Its label, or its number where there is no name for it; `None` for "no decision".
    pub label: Option<String>,
    /// What the round came to: `gesture`, `unknown` or `undecided`.
    pub outcome: RoundOutcome,
    /// Why, in words; empty for a gesture.
    pub why: String,
    /// The fused probability, `0.0..=1.0`.
    pub confidence: f64,
    /// Whether a majority is known to hold it.
    #[serde(rename = "final")]
    pub is_final: bool,
    /// The robot that drew it.
    pub author: RobotId,
    /// The fusion rule's name.
    pub rule: String,
    /// The fused probability of each gesture.
    pub shares: Vec<Share>,
    /// The votes counted, by robot.
    pub votes: Vec<VoteView>,
    /// The robots that took part and are not counted: they had seen nothing, or know other gestures.
    pub others: Vec<RobotId>,
    /// n: the robots that its author had heard lately.
    pub robots: u32,
    /// q: how many of them had to take part.
    pub quorum: u32,
    /// How many did.
    pub reached: usize,
    /// How many robots are known to hold this decision now.
    pub held: usize,
    /// Milliseconds from the opening of the round to the decision.
    pub elapsed_ms: u32,
}

/// The probability of one gesture.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Share {
    /// The gesture.
    pub label: String,
    /// Its probability, `0.0..=1.0`.
    pub probability: f64,
}

/// One robot's vote.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VoteView {
    /// Whose.
    pub robot: RobotId,
    /// The gesture it found likeliest.
    pub label: String,
    /// How likely: the softmax of its log-evidence, `0.0..=1.0`.
    pub probability: f64,
    /// What it weighed in the fusion.
    pub weight: f64,
    /// How many independent looks are behind it.
    pub looks: f64,
    /// Whether it is for the gesture that was decided.
    pub agrees: bool,
}

impl DecisionView {
    pub(super) fn new(announced: &Announcement, vocabulary: Option<&Vocabulary>, held: usize) -> Self {
        let Announcement { decision, label, .. } = announced;
        let config = MindConfig { rule: decision.certificate.rule, ..MindConfig::default() };
        let (outcome, reason) = outcome(decision, &config);
        let certificate = &decision.certificate;
        let name = |class| match label {
            Some(label) if Some(class) == decision.class => clipped(label),
            _ => gesture(class, vocabulary),
        };
        let shares = certificate.classes().zip(&certificate.probabilities);
        let vote = |counted: &CountedVote| VoteView {
            robot: counted.robot,
            label: name(counted.class),
            probability: probability(&counted.vote, counted.class),
            weight: finite(counted.weight.into()),
            looks: finite(counted.vote.looks.into()),
            agrees: decision.class == Some(counted.class),
        };
        Self {
            round: decision.round,
            class: decision.class,
            label: decision.class.map(name),
            outcome,
            why: why(&reason, &name),
            confidence: finite(decision.confidence),
            is_final: decision.is_final,
            author: decision.author,
            rule: certificate.rule.name().to_owned(),
            shares: shares.map(|(class, p)| Share { label: name(class), probability: finite(*p) }).collect(),
            votes: certificate.votes.iter().map(vote).collect(),
            others: certificate.others.iter().map(|other| other.robot).collect(),
            robots: certificate.robots,
            quorum: certificate.quorum,
            reached: certificate.reached(),
            held,
            elapsed_ms: certificate.elapsed_ms,
        }
    }
}

/// A reason in words, with the names of gestures.
fn why(reason: &Reason, name: &dyn Fn(ClassId) -> String) -> String {
    match *reason {
        Reason::Sure => String::new(),
        Reason::FarFromAll { nearest, .. } => format!("unlike all it knows; nearest is {}", name(nearest)),
        // Who learns from nothing has no gesture to vote for before the first was taught.
        Reason::NothingSeen => "no robot that knows a gesture saw a hand".to_owned(),
        Reason::TooFewRobots { counted, needed } => format!("{counted} robots took part, {needed} needed"),
        Reason::Disagreement { between: [a, b], robots: [for_a, for_b] } => {
            format!("{for_a} for {}, {for_b} for {}", name(a), name(b))
        }
        Reason::Unsure { nearest, probability } => {
            format!("{}, but only {:.0} % sure", name(nearest), 100.0 * finite(probability))
        }
    }
}

/// The softmax of log-evidence at one class; zero where there is none.
fn probability(vote: &Vote, class: ClassId) -> f64 {
    let Some(mine) = vote.evidence_for(class) else { return 0.0 };
    let others: f64 = vote.evidence.iter().map(|other| (f64::from(*other) - f64::from(mine)).exp()).sum();
    finite(1.0 / others)
}
