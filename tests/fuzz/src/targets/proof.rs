//! A decision with the votes that it rests on.

use std::time::Duration;

use gestalt_protocol::{
    ClassId, CountedVote, Decision, Envelope, FusionRule, HeldVote, Message, RobotId, Stamp, decode_json,
};
use gestalt_strategies::{Fuse, MindConfig, Quorum, follows, fusion, is_refuted};

use crate::gate::Gate;
use crate::memory::bounded;
use crate::swarm::{roster, seal_decision};
use crate::values;

/// The first byte says how it came and by which rules it is judged, the second which votes are signed by their authors, the third
/// what is changed afterwards; then comes the decision, in JSON or as it is given from robot to robot.
///
/// What follows names the one gesture that the votes make, and follows again after any way it travels; what is proven loses its proof
/// by any change of a vote.
///
/// # Panics
/// If not.
pub fn run(bytes: &[u8]) {
    let [how, which, change, rest @ ..] = bytes else { return };
    let Some(mut decision) = read(how & 1 == 1, rest) else { return };
    let config = MindConfig {
        rule: if how & 64 == 0 {
            FusionRule::ALL[usize::from(how >> 2 & 3)]
        } else {
            FusionRule::CorrelatedPool
        },
        quorum: if how & 16 == 0 { Quorum::Majority } else { Quorum::Evidence(3) },
        liars: u32::from(how >> 5 & 1),
        ..MindConfig::default()
    };
    if how & 2 == 2 {
        draw(&mut decision, &config);
    }
    seal_decision(&mut decision, *which);
    let follows = |decision: &Decision| follows(decision, &config.rule, &config, decision.certificate.robots);
    let (sound, drawn) = (decision.check().is_ok(), follows(&decision));
    if drawn {
        assert!(sound, "it follows, and no robot may say it");
        assert!(!is_refuted(&decision), "it follows, and would convict whoever gives it");
        names_one_gesture(&decision, &follows);
    }
    if sound {
        let written = serde_json::to_vec(&decision).expect("it is JSON");
        assert_eq!(decode_json::<Decision>(&written).map(|again| follows(&again)), Ok(drawn));
        let given = given(decision.clone());
        assert_eq!(read(true, &given).map(|again| follows(&again)), Some(drawn));
    }
    believed(&decision, usize::from(*change));
}

fn read(given: bool, bytes: &[u8]) -> Option<Decision> {
    if !given {
        return bounded(bytes, || decode_json(bytes)).ok();
    }
    match bounded(bytes, || Envelope::decode(bytes)).ok()?.message {
        Message::Give(give) => give.decision,
        _ => None,
    }
}

fn given(decision: Decision) -> Vec<u8> {
    let message = values::give(Some(decision), Vec::new(), Vec::new());
    Envelope { author: RobotId(1), stamp: Stamp::default(), message, signature: None }.encode()
}

/// Makes of a decision what its votes make of it.
fn draw(decision: &mut Decision, config: &MindConfig) {
    let certificate = &mut decision.certificate;
    (certificate.rule, certificate.pool, certificate.terms) =
        (config.rule, config.rule.pool(), config.terms());
    certificate.quorum = config.needs(certificate.robots);
    certificate.unknown = None;
    certificate.votes.iter_mut().for_each(|counted| counted.vote.unknown = None);
    let classes = certificate.votes.first().map_or(0, |counted| counted.vote.evidence.len());
    let rows = certificate.votes.iter().map(|counted| counted.vote.evidence.as_slice());
    if let Some(fusion) = fusion::fuse(config.rule, config.clip, classes, rows) {
        decision.class = Some(fusion.top);
        decision.confidence = fusion.probabilities[fusion.top.index()];
        certificate.probabilities = fusion.probabilities;
    }
    certificate.votes.iter_mut().for_each(|counted: &mut CountedVote| {
        counted.vote.round = decision.round;
        counted.vote.vocabulary = certificate.vocabulary;
        let evidence = &counted.vote.evidence;
        let greatest = evidence.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let top = evidence.iter().position(|nats| *nats == greatest).unwrap_or_default();
        counted.class = ClassId(top as u32);
        counted.weight = config.rule.weight(config.clip, evidence) as f32;
    });
}

fn names_one_gesture(decision: &Decision, follows: &impl Fn(&Decision) -> bool) {
    let Some(class) = decision.class else { return };
    for other in (0..decision.certificate.probabilities.len()).filter(|other| *other != class.index()) {
        let other = Decision { class: u32::try_from(other).ok().map(ClassId), ..decision.clone() };
        assert!(!follows(&other), "two gestures follow from the same votes: {decision:?}");
    }
}

/// What one robot believes all do, and a change of a vote ends it.
fn believed(decision: &Decision, change: usize) {
    let votes: Vec<HeldVote> = decision.certificate.held_votes().collect();
    let proven = |decision: &Decision| {
        let mut held = decision.certificate.held_votes().map(Envelope::from);
        held.all(|said| said.signature.is_some_and(|by| roster().check(&said.statement(), &by).is_ok()))
    };
    let (believed, proven_here) = (Gate::default().decision(Duration::ZERO, decision), proven(decision));
    assert!(proven_here || believed.is_err());
    // So many of one author's are checked at once.
    assert!(!proven_here || believed.is_ok() || votes.len() > 16, "{believed:?}");
    if !proven_here || votes.is_empty() {
        return;
    }
    let mut forged = decision.clone();
    let certificate = &mut forged.certificate;
    let place = change % votes.len();
    let (robot, stamp, vote) = match certificate.votes.get_mut(place) {
        Some(counted) => (&mut counted.robot, &mut counted.stamp, &mut counted.vote),
        None => {
            let held = &mut certificate.others[place - certificate.votes.len()];
            (&mut held.robot, &mut held.stamp, &mut held.vote)
        }
    };
    match change % 6 {
        0 => robot.0 ^= 1,
        1 => stamp.boot ^= 1,
        2 => stamp.sequence = stamp.sequence.wrapping_add(1),
        3 => vote.round.life ^= 1 << 31,
        4 => vote.looks = f32::from_bits(vote.looks.to_bits() ^ 1),
        _ => vote.evidence.push(0.0),
    }
    assert!(!proven(&forged), "a vote was changed, and all are believed: {forged:?}");
}

/// A decision to begin with: in either form, of votes that make it.
pub fn seed(rng: &mut impl rand::Rng) -> Vec<u8> {
    let mut decision = values::decision(rng);
    let certificate = &mut decision.certificate;
    for (robot, counted) in (1..).zip(&mut certificate.votes) {
        counted.robot = RobotId(robot);
        counted.vote.evidence = vec![5.5, -3.5, -2.0];
    }
    for (robot, held) in (4..).zip(&mut certificate.others) {
        (held.robot, held.vote.round) = (RobotId(robot), decision.round);
    }
    certificate.robots = 4;
    let mut bytes = vec![values::number(rng) as u8 | 2, 0xff, values::number(rng) as u8];
    draw(&mut decision, &MindConfig::default());
    bytes.extend(match bytes[0] & 1 {
        1 => given(decision),
        _ => serde_json::to_vec(&decision).expect("it is JSON"),
    });
    bytes
}
