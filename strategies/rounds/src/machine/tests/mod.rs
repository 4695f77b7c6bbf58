//! One sentence of the design each.

mod agreeing;
mod alone;
mod committee;
mod deciding;
mod expelling;
mod flooding;
mod healing;
mod lying;
mod naming;
mod opening;
mod order;
mod repair;
mod restarting;
mod showing;
mod signing;
mod voting;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{
    Announcement, ClassId, CountedVote, Decision, Envelope, FusionRule, Give, Have, HeldVote, Message,
    RobotId, RoundId, Stamp, VocabularyId, Vote,
};

use super::{Follow, Input, Output, Rounds};
use crate::classify::{Classify, ClassifyError, Judgement};
use crate::config::RoundsConfig;
use crate::fuse::Fuse;
use crate::fusion::fuse;
use crate::life::Life;
use crate::observation::Observation;
use crate::quorum::Quorum;
use crate::refusal::{Refusal, Refusals};
use crate::vocabulary::Vocabulary;

/// Takes its features for the probabilities.
#[derive(Debug)]
struct Verbatim(Vocabulary);

impl Classify for Verbatim {
    fn vocabulary(&self) -> &Vocabulary {
        &self.0
    }

    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        match features.iter().position(|f| !f.is_finite()) {
            Some(component) => Err(ClassifyError::NotFinite(component)),
            None => Ok(features.iter().map(|f| f64::from(*f)).collect()),
        }
    }
}

fn vocabulary() -> Vocabulary {
    Vocabulary::new(["one", "two", "three"]).unwrap()
}

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

/// By a rule in which the votes of the tests add up.
fn adding_up() -> RoundsConfig {
    RoundsConfig { rule: FusionRule::LogPool, ..RoundsConfig::default() }
}

/// A mind whose camera shows nothing, so that it waits for no frame of its own; it takes those it is given all the same.
fn mind_with(me: u32, config: RoundsConfig) -> Rounds {
    let mut mind = Rounds::new(RobotId(me), Life { boot: 1, nonce: 7 }, config).unwrap();
    mind.handle(ms(0), Input::Learned(Arc::new(Verbatim(vocabulary()))));
    mind.handle(ms(0), Input::Blind(true));
    mind
}

fn mind(me: u32) -> Rounds {
    mind_with(me, adding_up())
}

fn blind(me: u32) -> Rounds {
    Rounds::new(RobotId(me), Life { boot: 1, nonce: 7 }, adding_up()).unwrap()
}

fn robots(ids: impl IntoIterator<Item = u32>) -> BTreeSet<RobotId> {
    ids.into_iter().map(RobotId).collect()
}

fn round(counter: u32, opener: u32) -> RoundId {
    RoundId { counter, opener: RobotId(opener), life: 7 }
}

fn saw(probabilities: [f32; 3]) -> Input {
    Input::Observed(Observation { features: probabilities.to_vec(), quality: 1.0 })
}

/// The evidence of a robot that is sure of a class, and of one that leans to it.
const SURE: f32 = 4.0;
const LEANING: f32 = 1.0;

fn vote(counter: u32, class: usize, strength: f32) -> Vote {
    let mut evidence = vec![-strength / 2.0; 3];
    evidence[class] = strength;
    Vote {
        round: round(counter, 1),
        vocabulary: vocabulary().id(),
        evidence,
        looks: 1.0,
        unknown: None,
        named: vec![],
    }
}

fn null(counter: u32) -> Vote {
    Vote { evidence: Vec::new(), looks: 0.0, ..vote(counter, 0, 0.0) }
}

fn says(author: u32, sequence: u32, message: Message) -> Input {
    Input::Received(Envelope {
        author: RobotId(author),
        stamp: Stamp { boot: 1, sequence },
        message,
        signature: None,
    })
}

fn votes(author: u32, sequence: u32, vote: Vote) -> Input {
    says(author, sequence, Message::Vote(vote))
}

/// A decision that follows from the votes of robots 10, 11, 12 …, each sure of its class; without a class from none.
fn decision(counter: u32, class: Option<u32>, robots: u32, author: u32) -> Decision {
    let votes: Vec<CountedVote> = class.map_or(Vec::new(), |class| {
        let counted = |robot| CountedVote {
            robot: RobotId(10 + robot),
            // Another vote of it for each class.
            stamp: Stamp { boot: 1, sequence: 1 + class },
            class: ClassId(class),
            weight: 1.0,
            vote: vote(counter, class as usize, SURE),
            signature: None,
        };
        (0..robots).map(counted).collect()
    });
    decided(round(counter, 1), class, votes, author)
}

/// What a robot makes of these votes, by the rule of [`adding_up`].
fn decided(round: RoundId, class: Option<u32>, votes: Vec<CountedVote>, author: u32) -> Decision {
    let rows = votes.iter().map(|counted| counted.vote.evidence.as_slice());
    let RoundsConfig { rule, clip, .. } = adding_up();
    let fused = fuse(rule, clip, 3, rows);
    let (probabilities, confidence) =
        fused.map_or((Vec::new(), 0.0), |fused| (fused.probabilities.clone(), fused.greatest()));
    let robots = votes.len() as u32;
    Decision {
        round,
        class: class.map(ClassId),
        confidence,
        author: RobotId(author),
        is_final: false,
        certificate: gestalt_protocol::Certificate {
            vocabulary: vocabulary().id(),
            rule,
            pool: rule.pool(),
            probabilities,
            unknown: None,
            votes,
            others: Vec::new(),
            robots,
            quorum: robots / 2 + 1,
            elapsed_ms: 10,
            named: vec![],
            terms: gestalt_protocol::Terms::default(),
        },
    }
}

/// What robot 9 decided of that round on `counted` votes of it, 5 s after it began.
fn drawn_late(id: RoundId, class: Option<u32>, counted: u32) -> Decision {
    let votes = decision(id.counter, class.or(Some(0)), counted, 9).certificate.votes;
    let votes = votes.into_iter().map(|counted| {
        let vote = Vote { round: id, ..counted.vote };
        gestalt_protocol::CountedVote { vote, ..counted }
    });
    let drawn = decided(id, class, votes.collect(), 9);
    let certificate = gestalt_protocol::Certificate { elapsed_ms: 5000, ..drawn.certificate };
    Decision { certificate, ..drawn }
}

/// The same decision by the terms of that configuration.
fn by(config: &RoundsConfig, decision: Decision) -> Decision {
    let (terms, quorum) = (config.terms(), config.needs(decision.certificate.robots));
    let certificate = gestalt_protocol::Certificate { terms, quorum, ..decision.certificate };
    Decision { certificate, ..decision }
}

/// A robot that holds a decision gives it to this one.
fn gives(from: u32, decision: Decision) -> Input {
    says(from, 50, Message::Give(Give { decision: Some(decision), votes: Vec::new(), holders: Vec::new() }))
}

/// A robot says that it holds a decision.
fn says_it_holds(robot: u32, decision: &Decision) -> Input {
    says(robot, 40, Message::Holding(decision.holding(false)))
}

/// What a robot has: it is in that round, and holds a decision of that rank.
fn having(round: RoundId, decision: gestalt_protocol::Rank) -> Have {
    let (round, decision) = (Some(round), Some(decision));
    Have { round, decision, holders: 0, votes: vec![], knowledge: None, answer: false }
}

/// A robot announces a decision.
fn announced(announcer: u32, decision: Decision) -> Input {
    let (announcer, stamp) = (RobotId(announcer), Stamp { boot: 1, sequence: 60 });
    let label = decision.class.and_then(|class| vocabulary().label(class).map(str::to_owned));
    Input::Announced(Announcement { decision, label, announcer, stamp, signature: None })
}

fn broadcast(out: &[Output]) -> Vec<&Vote> {
    out.iter()
        .filter_map(|output| match output {
            Output::Broadcast(Envelope { message: Message::Vote(vote), .. }) => Some(vote),
            _ => None,
        })
        .collect()
}

fn holds(out: &[Output]) -> Vec<Option<u32>> {
    out.iter()
        .filter_map(|output| match output {
            Output::Hold(decision) => Some(decision.class.map(|class| class.0)),
            _ => None,
        })
        .collect()
}

fn announces(out: &[Output]) -> usize {
    out.iter().filter(|output| matches!(output, Output::Announce(_))).count()
}

fn told(out: &[Output]) -> Vec<(u32, &Message)> {
    out.iter()
        .filter_map(|output| match output {
            Output::Tell(robot, envelope) => Some((robot.0, &envelope.message)),
            _ => None,
        })
        .collect()
}

/// Knows what an instructor spoke of.
#[derive(Default)]
struct Taught(BTreeSet<RoundId>);

impl Follow for Taught {
    fn taught(&self, counter: u32) -> BTreeSet<RoundId> {
        self.0.iter().copied().filter(|round| round.counter == counter).collect()
    }
}

/// Ticks whenever the mind wants to, until `end`; collects what it wants done.
fn live(mind: &mut Rounds, end: Duration) -> Vec<(Duration, Output)> {
    let mut all = Vec::new();
    for _ in 0..10_000 {
        let Some(wake) = mind.next_wake().filter(|wake| *wake <= end) else { return all };
        assert!(wake > mind.now || all.is_empty(), "a mind that wants to wake in the past spins its host");
        all.extend(mind.handle(wake, Input::Tick).into_iter().map(|output| (wake, output)));
    }
    panic!("the mind never comes to rest");
}
