//! A fusion rule of somebody's own: robots that have it, robots that do not, and one that computes nonsense.

use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{
    Announcement, ClassId, Decision, Envelope, FusionRule, Message, RobotId, RoundId, Stamp, Vote,
    decode_json,
};
use gestalt_rounds::fusion::Fusion;
use gestalt_rounds::{
    Classify, ClassifyError, Fuse, Input, Life, Output, Refusal, Rounds, RoundsConfig, Vocabulary,
};

fn vocabulary() -> Vocabulary {
    Vocabulary::new(["left", "right"]).unwrap()
}

/// Judges nothing: the votes are given.
#[derive(Debug)]
struct Blind(Vocabulary);

impl Classify for Blind {
    fn vocabulary(&self) -> &Vocabulary {
        &self.0
    }

    fn probabilities(&self, _: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        Err(ClassifyError::NotFinite(0))
    }
}

/// Believes the robot of the smallest id.
#[derive(Debug)]
struct First;

impl Fuse for First {
    fn rule(&self) -> FusionRule {
        FusionRule::Other("first".parse().unwrap())
    }

    fn fuse(&self, _: f64, classes: usize, votes: &[&[f32]]) -> Option<Fusion> {
        let first = votes.first()?;
        let top = (0..classes).max_by(|a, b| first[*a].total_cmp(&first[*b]))?;
        let probabilities = (0..classes).map(|class| if class == top { 1.0 } else { 0.0 }).collect();
        Some(Fusion { probabilities, top: ClassId(top as u32), margin: 1.0 })
    }
}

/// Gives what it was told to, whatever the votes.
#[derive(Debug)]
struct Nonsense(Fusion);

impl Fuse for Nonsense {
    fn rule(&self) -> FusionRule {
        FusionRule::Other("nonsense".parse().unwrap())
    }

    fn fuse(&self, _: f64, _: usize, _: &[&[f32]]) -> Option<Fusion> {
        Some(self.0.clone())
    }

    fn weight(&self, _: f64, _: &[f32]) -> f64 {
        f64::NAN
    }
}

fn rounds(me: u32, rule: Option<Arc<dyn Fuse>>) -> Rounds {
    let rounds = Rounds::new(RobotId(me), Life { boot: 1, nonce: 7 }, RoundsConfig::default()).unwrap();
    let mut rounds = match rule {
        Some(rule) => rounds.fused_by(rule),
        None => rounds,
    };
    rounds.handle(Duration::ZERO, Input::Blind(true));
    rounds.handle(Duration::ZERO, Input::Learned(Arc::new(Blind(vocabulary()))));
    rounds
}

fn vote(author: u32, evidence: [f32; 2]) -> Input {
    let round = RoundId { counter: 1, opener: RobotId(1), life: 0 };
    let vote = Vote {
        round,
        vocabulary: vocabulary().id(),
        evidence: evidence.to_vec(),
        looks: 1.0,
        unknown: None,
        named: vec![],
    };
    let stamp = Stamp { boot: 1, sequence: 1 };
    Input::Received(Envelope {
        author: RobotId(author),
        stamp,
        message: Message::Vote(vote),
        signature: None,
    })
}

/// The decisions a robot holds on two votes that contradict each other, until long after the deadline.
fn decided(rounds: &mut Rounds) -> Vec<Decision> {
    // It waits for both.
    rounds.handle(Duration::ZERO, Input::Alive(Arc::new([RobotId(1), RobotId(2)].into())));
    rounds.handle(Duration::ZERO, vote(1, [-0.1, 0.1]));
    let mut held = Vec::new();
    let mut input = vote(2, [6.0, -6.0]);
    for ms in (10..8000).step_by(10) {
        for output in rounds.handle(Duration::from_millis(ms), std::mem::replace(&mut input, Input::Tick)) {
            if let Output::Hold(decision) = output {
                held.push(decision);
            }
        }
    }
    held
}

#[test]
fn a_rule_of_ones_own_decides_and_signs() {
    let held = decided(&mut rounds(7, Some(Arc::new(First))));
    assert_eq!(held[0].class, Some(ClassId(1)), "the first robot leans to it");
    assert_eq!(held[0].certificate.rule.name(), "first");
    assert_eq!(held[0].check(), Ok(()));
    let default = decided(&mut rounds(7, None));
    assert_eq!(default[0].class, Some(ClassId(0)), "the log pool follows who is sure");
}

#[test]
fn a_decision_is_adopted_by_who_has_the_rule_and_by_nobody_else() {
    let decision = decided(&mut rounds(7, Some(Arc::new(First)))).remove(0);
    // As robots and clients hear it.
    let (announcer, stamp) = (RobotId(1), Stamp { boot: 1, sequence: 9 });
    let said = Announcement { decision: decision.clone(), label: None, announcer, stamp, signature: None };
    let json = serde_json::to_vec(&said).unwrap();
    let heard: Announcement = decode_json(&json).unwrap();
    assert_eq!(heard, said);
    let mut same = rounds(8, Some(Arc::new(First)));
    same.handle(Duration::ZERO, Input::Announced(heard.clone()));
    assert_eq!(same.held(), Some(&decision));
    let mut other = rounds(9, None);
    other.handle(Duration::ZERO, Input::Announced(heard));
    assert_eq!(other.held(), None);
    assert_eq!(other.refusals().count(Refusal::Unfounded), 1);
}

#[test]
fn nonsense_decides_nothing_and_harms_nobody() {
    let sound = Fusion { probabilities: vec![0.0, 1.0], top: ClassId(1), margin: 1.0 };
    for nonsense in [
        Fusion { probabilities: vec![f64::NAN, 1.0], ..sound.clone() },
        Fusion { probabilities: vec![0.0, 2.0], ..sound.clone() },
        Fusion { probabilities: vec![1.0], ..sound.clone() },
        Fusion { probabilities: Vec::new(), ..sound.clone() },
        Fusion { top: ClassId(9), ..sound.clone() },
        Fusion { margin: f64::NAN, ..sound.clone() },
    ] {
        let held = decided(&mut rounds(7, Some(Arc::new(Nonsense(nonsense.clone())))));
        assert_eq!(held.len(), 1, "{nonsense:?}");
        assert_eq!((held[0].class, held[0].check()), (None, Ok(())), "{nonsense:?}");
    }
    let held = decided(&mut rounds(7, Some(Arc::new(Nonsense(sound)))));
    assert_eq!((held[0].class, held[0].check()), (Some(ClassId(1)), Ok(())));
}
