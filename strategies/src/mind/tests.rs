//! One sentence of the design each.

use std::collections::BTreeMap;

use gestalt_protocol::{ClassId, CountedVote, FusionRule, Give, Have, HeldVote, Instruction, VocabularyId};

use super::*;
use crate::{ClassifyError, Vocabulary};

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

/// A mind whose camera shows nothing, so that it waits for no frame of its own; it takes those it is given all the same.
fn mind_with(me: u32, config: MindConfig) -> Mind {
    let mut mind = Mind::new(RobotId(me), 1, config).unwrap();
    mind.handle(ms(0), Input::Learned(Arc::new(Verbatim(vocabulary()))));
    mind.handle(ms(0), Input::Blind(true));
    mind
}

fn mind(me: u32) -> Mind {
    mind_with(me, MindConfig::default())
}

fn blind(me: u32) -> Mind {
    Mind::new(RobotId(me), 1, MindConfig::default()).unwrap()
}

fn robots(ids: impl IntoIterator<Item = u32>) -> BTreeSet<RobotId> {
    ids.into_iter().map(RobotId).collect()
}

fn round(counter: u32, opener: u32) -> RoundId {
    RoundId { counter, opener: RobotId(opener) }
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
    Vote { round: round(counter, 1), vocabulary: vocabulary().id(), evidence, looks: 1.0 }
}

fn null(counter: u32) -> Vote {
    Vote { evidence: Vec::new(), looks: 0.0, ..vote(counter, 0, 0.0) }
}

fn says(author: u32, sequence: u32, message: Message) -> Input {
    Input::Received(Envelope { author: RobotId(author), stamp: Stamp { boot: 1, sequence }, message })
}

fn votes(author: u32, sequence: u32, vote: Vote) -> Input {
    says(author, sequence, Message::Vote(vote))
}

fn decision(counter: u32, class: Option<u8>, robots: u32, author: u32) -> Decision {
    let counted = |robot| CountedVote {
        robot: RobotId(robot),
        stamp: Stamp { boot: 1, sequence: 1 },
        class: ClassId(0),
        weight: 1.0,
    };
    Decision {
        round: round(counter, 1),
        class: class.map(ClassId),
        confidence: 0.97,
        author: RobotId(author),
        certificate: gestalt_protocol::Certificate {
            vocabulary: vocabulary().id(),
            rule: FusionRule::LogPool,
            probabilities: vec![0.97, 0.02, 0.01],
            votes: (0..robots).map(counted).collect(),
            elapsed_ms: 10,
        },
    }
}

fn broadcast(out: &[Output]) -> Vec<&Vote> {
    out.iter()
        .filter_map(|output| match output {
            Output::Broadcast(Envelope { message: Message::Vote(vote), .. }) => Some(vote),
            _ => None,
        })
        .collect()
}

fn holds(out: &[Output]) -> Vec<Option<u8>> {
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

/// Ticks whenever the mind wants to, until `end`; collects what it wants done.
fn live(mind: &mut Mind, end: Duration) -> Vec<(Duration, Output)> {
    let mut all = Vec::new();
    for _ in 0..10_000 {
        let Some(wake) = mind.next_wake().filter(|wake| *wake <= end) else { return all };
        assert!(wake > mind.now || all.is_empty(), "a mind that wants to wake in the past spins its host");
        all.extend(mind.handle(wake, Input::Tick).into_iter().map(|output| (wake, output)));
    }
    panic!("the mind never comes to rest");
}

// Opening

#[test]
fn opening_says_a_null_vote_to_all_at_once() {
    let mut mind = mind(7);
    let out = mind.handle(ms(10), Input::Open);
    assert_eq!(out[0], Output::Opened(round(1, 7)));
    let said = broadcast(&out);
    assert_eq!((said.len(), said[0].round, said[0].evidence.len()), (1, round(1, 7), 0));
    assert!(mind.is_open());
}

#[test]
fn a_request_to_open_has_no_effect_while_a_round_is_open_or_has_just_begun() {
    let mut mind = mind_with(7, MindConfig { settle: ms(0), ..MindConfig::default() });
    mind.handle(ms(0), Input::Open);
    let instructed = Instructed { by: "ada".parse().unwrap(), at: 1, instruction: Instruction::Open };
    assert!(mind.handle(ms(5), Input::Instructed(instructed)).is_empty());
    mind.handle(ms(10), Input::Heard(RobotId(1), decision(1, Some(0), 2, 1)));
    assert!(!mind.is_open(), "decided and closed");
    mind.handle(ms(499), Input::Open);
    assert_eq!(mind.round(), Some(round(1, 7).min(round(1, 1))));
    mind.handle(ms(500), Input::Open);
    assert_eq!(mind.round(), Some(round(2, 7)));
}

#[test]
fn hearing_a_vote_of_a_newer_round_joins_it_and_ends_the_older() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Open);
    let out = mind.handle(ms(100), votes(3, 1, vote(5, 0, LEANING)));
    assert_eq!(out[..2], [Output::Closed(round(1, 7)), Output::Opened(round(5, 1))]);
    assert_eq!(broadcast(&out)[0].round.counter, 5, "all hear that this robot takes part");
    mind.handle(ms(200), votes(3, 2, vote(4, 0, LEANING)));
    assert_eq!(mind.round(), Some(round(5, 1)), "an older round changes nothing");
}

#[test]
fn equal_counters_merge_on_the_smaller_opener_and_keep_what_was_seen() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Open);
    mind.handle(ms(300), saw([0.5, 0.3, 0.2]));
    let out = mind.handle(ms(310), votes(1, 1, vote(1, 1, LEANING)));
    assert_eq!(mind.round(), Some(round(1, 1)));
    assert!(!out.contains(&Output::Closed(round(1, 7))));
    assert_eq!(mind.ballot().unwrap().contributors(mind.own_scale().unwrap()), 2);
    mind.handle(ms(320), votes(2, 1, Vote { round: round(1, 9), ..vote(1, 1, LEANING) }));
    assert_eq!(mind.round(), Some(round(1, 1)), "a greater opener changes nothing");
}

#[test]
fn a_counter_a_million_ahead_is_refused_but_a_newborn_mind_believes_any() {
    let mut mind = mind(7);
    mind.handle(ms(0), votes(3, 1, null(4_000_000)));
    assert_eq!(mind.round().unwrap().counter, 4_000_000);
    mind.handle(ms(1), votes(3, 2, null(5_000_001)));
    assert_eq!(mind.refusals().count(Refusal::FarAhead), 1);
    mind.handle(ms(2), votes(3, 3, null(5_000_000)));
    assert_eq!(mind.round().unwrap().counter, 5_000_000);
}

#[test]
fn when_the_counters_are_used_up_no_round_opens_and_it_is_counted() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Heard(RobotId(1), decision(u32::MAX, Some(0), 2, 1)));
    mind.handle(ms(900), Input::Open);
    assert_eq!(mind.refusals().count(Refusal::CountersUsedUp), 1);
}

#[test]
fn a_round_decided_elsewhere_is_adopted_without_opening() {
    let mut mind = mind(7);
    let out = mind.handle(ms(0), Input::Heard(RobotId(3), decision(9, Some(2), 4, 1)));
    assert_eq!(out, [Output::Hold(decision(9, Some(2), 4, 1))]);
    assert!(!mind.is_open());
    let have = Have {
        round: Some(round(12, 1)),
        decision: Some(decision(12, Some(1), 2, 1).rank()),
        votes: vec![],
        knowledge: None,
        answer: false,
    };
    let out = mind.handle(ms(1), says(3, 1, Message::Have(have)));
    assert!(matches!(told(&out)[..], [(3, Message::Have(Have { answer: true, .. }))]), "it asks for it");
    mind.handle(ms(2000), Input::Open);
    assert_eq!(mind.round().unwrap().counter, 13, "the counter heard of is taken");
}

// Voting

#[test]
fn votes_are_said_on_change_at_a_bounded_rate_and_repeated_while_open() {
    let mut mind = mind_with(7, MindConfig { alpha: 1e-9, ..MindConfig::default() });
    mind.handle(ms(0), Input::Open);
    let mut said = Vec::new();
    for t in (20..2000).step_by(20) {
        let out = mind.handle(ms(t), saw([0.4, 0.3, 0.3]));
        said.extend(broadcast(&out).iter().map(|vote| (t, vote.looks)));
    }
    assert_eq!(said.len(), 7, "one each 250 ms: {said:?}");
    assert!(said.is_sorted_by(|a, b| a.1 <= b.1) && said[0].1 < said[6].1, "the whole sum so far");
    let later: Vec<_> =
        live(&mut mind, ms(4500)).into_iter().filter(|(_, o)| matches!(o, Output::Broadcast(_))).collect();
    assert_eq!(later.iter().map(|(at, _)| *at).collect::<Vec<_>>(), [ms(2070), ms(3070), ms(4070)]);
    assert_eq!(later[1].1, later[2].1, "a repeated vote is the same message");
}

#[test]
fn frames_outside_a_round_count_for_nothing() {
    let mut mind = mind(7);
    mind.handle(ms(0), saw([0.9, 0.05, 0.05]));
    mind.handle(ms(10), Input::Open);
    mind.handle(ms(300), Input::Tick);
    assert_eq!(mind.held(), None);
    assert_eq!(mind.refusals(), &Refusals::default());
}

#[test]
fn a_frame_that_cannot_be_judged_is_counted_and_never_becomes_a_vote() {
    let mut seeing = mind(7);
    seeing.handle(ms(0), Input::Open);
    seeing.handle(ms(300), saw([f32::NAN, 0.0, 1.0]));
    seeing.handle(ms(600), saw([7.0, 0.0, 0.0]));
    let out = seeing.handle(ms(1000), Input::Tick);
    assert!(broadcast(&out)[0].evidence.is_empty());
    assert_eq!(seeing.refusals().count(Refusal::Unclassified), 2);
    let mut blind = blind(8);
    blind.handle(ms(0), Input::Open);
    blind.handle(ms(300), saw([0.9, 0.05, 0.05]));
    assert_eq!(blind.refusals().count(Refusal::NoClassifier), 1);
}

#[test]
fn a_vote_of_another_vocabulary_or_length_or_with_impossible_values_is_refused_and_counted() {
    let mut mind = mind(7);
    mind.handle(ms(0), votes(1, 1, Vote { vocabulary: VocabularyId(1), ..vote(1, 0, SURE) }));
    mind.handle(ms(1), votes(2, 1, Vote { evidence: vec![1.0, -1.0], ..vote(1, 0, SURE) }));
    assert_eq!(mind.refusals().count(Refusal::Vocabulary), 2);
    mind.handle(ms(2), votes(3, 1, Vote { evidence: vec![f32::NAN, 0.0, 0.0], ..vote(1, 0, SURE) }));
    assert_eq!(mind.refusals().count(Refusal::Impossible), 1);
    assert_eq!(mind.round(), None, "nothing of it is kept");
}

#[test]
fn a_new_vocabulary_makes_the_robot_look_afresh() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Blind(false));
    mind.handle(ms(0), Input::Open);
    mind.handle(ms(100), saw([0.6, 0.2, 0.2]));
    let other = Vocabulary::new(["left", "right", "up"]).unwrap();
    mind.handle(ms(200), Input::Learned(Arc::new(Verbatim(other.clone()))));
    let out = mind.handle(ms(300), Input::Tick);
    assert_eq!((broadcast(&out)[0].looks, broadcast(&out)[0].vocabulary), (0.0, other.id()));
}

#[test]
fn a_second_robot_with_my_id_is_counted_and_reported_but_my_echo_is_not() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Open);
    mind.handle(ms(1), says(7, 1, Message::Vote(null(1))));
    assert_eq!(mind.duplicate(), None, "the own null vote came back");
    mind.handle(ms(2), says(7, 40, Message::Vote(vote(1, 1, SURE))));
    assert_eq!(mind.refusals().count(Refusal::DuplicateId), 1);
    let held = HeldVote { robot: RobotId(7), stamp: Stamp { boot: 2, sequence: 1 }, vote: vote(1, 1, SURE) };
    mind.handle(ms(3), says(3, 1, Message::Give(Give { decision: None, votes: vec![held.clone()] })));
    assert_eq!(mind.duplicate(), Some(held.stamp));
    let earlier = HeldVote { stamp: Stamp { boot: 0, sequence: 9 }, ..held };
    mind.handle(ms(4), says(3, 2, Message::Give(Give { decision: None, votes: vec![earlier] })));
    assert_eq!(mind.refusals().count(Refusal::DuplicateId), 2, "a vote of an earlier life is merely old");
    assert_eq!(mind.held(), None, "none of it counts as this robot's evidence");
}

// Deciding

#[test]
fn one_sure_robot_decides_alone_and_says_what_the_decision_rests_on() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Open);
    mind.handle(ms(10), saw([0.01, 0.98, 0.01]));
    let all = live(&mut mind, ms(2000));
    let Some((at, Output::Hold(held))) = all.iter().find(|(_, o)| matches!(o, Output::Hold(_))) else {
        panic!("{all:?}")
    };
    assert_eq!((*at, held.class, held.author), (ms(250), Some(ClassId(1)), RobotId(7)));
    assert_eq!(held.certificate.elapsed_ms, 250);
    let counted = &held.certificate.votes;
    assert_eq!((counted.len(), counted[0].robot, counted[0].class), (1, RobotId(7), ClassId(1)));
    assert_eq!(held.confidence, held.certificate.probabilities[1]);
    assert!(all.contains(&(ms(450), Output::Closed(round(1, 7)))), "closed once settled");
}

#[test]
fn a_round_waits_until_every_live_robot_has_seen_something_but_not_beyond_patience() {
    let open = || {
        let mut mind = mind(7);
        mind.handle(ms(0), Input::Alive(robots([1, 2])));
        mind.handle(ms(0), votes(1, 1, vote(1, 0, SURE)));
        mind
    };
    let mut all_see = open();
    all_see.handle(ms(20), votes(2, 1, null(1)));
    assert_eq!(all_see.held(), None, "robot 2 may be about to see");
    let decided = all_see.handle(ms(30), votes(2, 2, vote(1, 0, SURE)));
    assert!(decided.iter().any(|o| matches!(o, Output::Hold(_))));
    let late = live(&mut open(), ms(3000));
    assert!(late.iter().any(|(at, o)| *at == ms(1000) && matches!(o, Output::Hold(_))));
}

#[test]
fn fewer_robots_than_the_quorum_decide_nothing() {
    let mut mind = mind_with(7, MindConfig { quorum: 2, ..MindConfig::default() });
    mind.handle(ms(0), votes(1, 1, vote(1, 0, SURE)));
    mind.handle(ms(1), votes(2, 1, null(1)));
    assert_eq!(mind.held(), None);
    mind.handle(ms(2), votes(3, 1, vote(1, 0, SURE)));
    assert_eq!(mind.held().unwrap().class, Some(ClassId(0)));
}

#[test]
fn at_the_deadline_the_outcome_is_no_decision_said_as_such() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Open);
    mind.handle(ms(1), votes(1, 1, vote(1, 0, 0.1)));
    mind.handle(ms(2), votes(2, 1, vote(1, 1, 0.1)));
    let all = live(&mut mind, ms(6000));
    let held: Vec<_> = all.iter().filter(|(_, o)| matches!(o, Output::Hold(_))).collect();
    assert_eq!(held.len(), 1);
    assert_eq!(held[0].0, ms(5000));
    assert_eq!(mind.held().unwrap().class, None);
    assert_eq!(mind.held().unwrap().certificate.votes.len(), 2);
    assert!(!mind.is_open());
}

#[test]
fn the_no_decision_of_an_impatient_robot_ends_nothing_for_the_others() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Open);
    mind.handle(ms(100), Input::Heard(RobotId(3), decision(1, None, 1, 3)));
    assert_eq!(mind.held(), None);
    mind.handle(ms(200), votes(1, 1, vote(1, 0, SURE)));
    assert_eq!(mind.held().unwrap().class, Some(ClassId(0)));
}

#[test]
fn a_robot_draws_one_conclusion_per_round_and_none_after_adopting_one() {
    let mut mind = mind(7);
    mind.handle(ms(0), votes(1, 1, vote(1, 0, SURE)));
    assert_eq!(mind.held().unwrap().author, RobotId(7));
    mind.handle(ms(10), votes(2, 1, vote(1, 1, SURE)));
    let out = mind.handle(ms(20), votes(3, 1, vote(1, 1, SURE)));
    assert!(holds(&out).is_empty());
    let mut other = mind_with(8, MindConfig::default());
    other.handle(ms(0), Input::Open);
    other.handle(ms(5), Input::Heard(RobotId(7), decision(1, Some(2), 1, 7)));
    let out = other.handle(ms(10), votes(1, 1, vote(1, 0, SURE)));
    assert!(holds(&out).is_empty());
    assert_eq!(other.held().unwrap().author, RobotId(7));
}

#[test]
fn a_liars_vote_is_clipped_and_f_liars_cannot_make_a_decision() {
    let config = MindConfig { liars: 1, ..MindConfig::default() };
    let mut mind = mind_with(7, config);
    mind.handle(ms(0), votes(66, 1, vote(1, 2, 1e30)));
    mind.handle(ms(1), votes(1, 1, vote(1, 0, LEANING)));
    assert_eq!(mind.held(), None, "one robot made this lead alone");
    for robot in 2..=6 {
        mind.handle(ms(10), votes(robot, 1, vote(1, 0, SURE)));
    }
    assert_eq!(mind.held().unwrap().class, Some(ClassId(0)));
}

#[test]
fn with_liars_a_heard_decision_needs_f_plus_1_holders() {
    let mut mind = mind_with(7, MindConfig { liars: 1, ..MindConfig::default() });
    mind.handle(ms(0), Input::Heard(RobotId(66), decision(1, Some(2), 9, 66)));
    mind.handle(ms(1), Input::Heard(RobotId(66), decision(1, Some(2), 9, 66)));
    mind.handle(ms(1), Input::Announced(decision(1, Some(2), 9, 66)));
    assert_eq!(mind.held(), None);
    assert!(mind.is_open(), "it takes part, to find out for itself");
    mind.handle(ms(2), Input::Heard(RobotId(1), decision(1, Some(2), 5, 1)));
    assert_eq!(mind.held().unwrap().class, Some(ClassId(2)));
}

#[test]
fn a_robot_without_a_classifier_fuses_what_the_others_saw() {
    let mut mind = blind(7);
    mind.handle(ms(0), votes(1, 1, vote(1, 1, SURE)));
    assert_eq!(mind.held().unwrap().class, Some(ClassId(1)));
    assert_eq!(mind.held().unwrap().certificate.vocabulary, vocabulary().id());
}

// Agreeing and announcing

#[test]
fn the_greater_decision_replaces_the_held_one_and_is_held_aloud() {
    let mut mind = mind(7);
    mind.handle(ms(0), votes(1, 1, vote(1, 0, SURE)));
    let out = mind.handle(ms(2), Input::Heard(RobotId(2), decision(1, Some(2), 2, 2)));
    assert_eq!(holds(&out), [Some(2)]);
    assert!(holds(&mind.handle(ms(3), Input::Heard(RobotId(2), decision(1, Some(2), 2, 2)))).is_empty());
}

#[test]
fn the_smallest_live_robot_announces_once_settled_and_only_once() {
    let mut mind = mind(2);
    mind.handle(ms(0), Input::Alive(robots([2, 5, 9])));
    mind.handle(ms(100), Input::Heard(RobotId(5), decision(1, Some(0), 3, 5)));
    let mut all = live(&mut mind, ms(150));
    // The same class by more robots is no reason to wait longer.
    mind.handle(ms(150), Input::Heard(RobotId(5), decision(1, Some(0), 4, 5)));
    all.extend(live(&mut mind, ms(20_000)));
    let announced: Vec<_> =
        all.iter().filter(|(_, o)| matches!(o, Output::Announce(_))).map(|(at, _)| *at).collect();
    assert_eq!(announced, [ms(300)]);
}

#[test]
fn the_next_robots_wait_for_the_spokesrobot_and_take_over_when_it_is_silent() {
    let next = |heard: bool| {
        let mut mind = mind(9);
        mind.handle(ms(0), Input::Alive(robots([2, 5, 9])));
        mind.handle(ms(0), Input::Heard(RobotId(5), decision(1, Some(0), 3, 5)));
        if heard {
            mind.handle(ms(500), Input::Announced(decision(1, Some(0), 3, 5)));
        }
        let all = live(&mut mind, ms(20_000));
        all.iter().filter(|(_, o)| matches!(o, Output::Announce(_))).map(|(at, _)| *at).collect::<Vec<_>>()
    };
    assert_eq!(next(true), []);
    assert_eq!(next(false), [ms(200 + 2 * 400)]);
}

#[test]
fn who_has_guests_speaks_for_them_too() {
    let mut host = mind(8);
    host.handle(ms(0), Input::Guests(robots([2, 3])));
    host.handle(ms(0), Input::Alive(robots([1, 5])));
    host.handle(ms(0), Input::Heard(RobotId(5), decision(1, Some(1), 2, 5)));
    let times = (1..40).map(|k| ms(k * 50));
    let announced = |mind: &mut Mind, mut times: Box<dyn Iterator<Item = Duration>>| {
        times.find(|at| announces(&mind.handle(*at, Input::Tick)) > 0)
    };
    // Robot 1 comes first, guests wait for nobody but it.
    assert_eq!(announced(&mut host, Box::new(times.clone())), Some(ms(600)));
    let mut host = mind(8);
    host.handle(ms(0), Input::Alive(robots([2, 5])));
    host.handle(ms(0), Input::Guests(robots([2])));
    host.handle(ms(0), Input::Heard(RobotId(5), decision(1, Some(1), 2, 5)));
    assert_eq!(announced(&mut host, Box::new(times)), Some(ms(200)));
}

#[test]
fn a_round_waits_for_guests_as_for_all_the_living() {
    let mut host = blind(8);
    host.handle(ms(0), Input::Guests(robots([2, 3])));
    let out = host.handle(ms(10), votes(2, 1, vote(1, 0, SURE)));
    assert_eq!(holds(&out), []);
    let out = host.handle(ms(20), votes(3, 1, vote(1, 0, SURE)));
    assert_eq!(holds(&out), [Some(0)]);
    let mut host = blind(8);
    host.handle(ms(0), Input::Guests(robots([2, 3])));
    host.handle(ms(10), votes(2, 1, vote(1, 0, SURE)));
    assert_eq!(holds(&host.handle(ms(20), Input::Guests(robots([2])))), [Some(0)], "one has left");
}

#[test]
fn a_changed_class_is_announced_again_and_the_same_class_is_not() {
    let mut mind = mind(2);
    mind.handle(ms(0), Input::Heard(RobotId(5), decision(1, Some(0), 3, 5)));
    assert_eq!(announces(&mind.handle(ms(200), Input::Tick)), 1);
    mind.handle(ms(300), Input::Heard(RobotId(5), decision(1, Some(0), 4, 5)));
    assert_eq!(announces(&mind.handle(ms(900), Input::Tick)), 0);
    mind.handle(ms(1000), Input::Heard(RobotId(5), decision(1, Some(1), 5, 5)));
    assert_eq!(announces(&mind.handle(ms(1200), Input::Tick)), 1);
}

// Repair

fn have(counter: u32, known: &[(u32, u32)]) -> Have {
    let stamp = |sequence| Stamp { boot: 1, sequence };
    Have {
        round: Some(round(counter, 1)),
        decision: None,
        votes: known.iter().map(|&(robot, sequence)| (RobotId(robot), stamp(sequence))).collect(),
        knowledge: None,
        answer: false,
    }
}

#[test]
fn a_new_neighbour_is_greeted_at_once_and_the_neighbours_in_turn_from_then_on() {
    let mut mind = mind(7);
    let out = mind.handle(ms(0), Input::Neighbours(robots([3, 4, 7])));
    assert_eq!(told(&out).iter().map(|(robot, _)| *robot).collect::<Vec<_>>(), [3, 4]);
    let all = live(&mut mind, ms(13_000));
    let turns: Vec<_> = all
        .iter()
        .filter_map(|(at, o)| match o {
            Output::Tell(robot, _) => Some((at.as_millis(), robot.0)),
            _ => None,
        })
        .collect();
    assert_eq!(turns[..3], [(500, 3), (1000, 4), (1500, 3)], "busy after the change");
    assert_eq!(turns[turns.len() - 2..], [(9000, 3), (13_000, 4)], "then idle");
}

#[test]
fn a_neighbour_is_given_the_votes_it_lacks_and_asked_for_those_lacking_here() {
    let mut mind = mind_with(7, MindConfig { quorum: 9, ..MindConfig::default() });
    mind.handle(ms(0), votes(1, 5, vote(1, 0, LEANING)));
    mind.handle(ms(0), votes(2, 5, vote(1, 0, LEANING)));
    let out = mind.handle(ms(10), says(3, 1, Message::Have(have(1, &[(1, 4), (2, 6), (7, 1)]))));
    let [(3, Message::Give(give)), (3, Message::Have(asked))] = &told(&out)[..] else { panic!("{out:?}") };
    assert_eq!(give.votes.iter().map(|held| held.robot.0).collect::<Vec<_>>(), [1]);
    assert!(asked.answer);
    let answer = Have { answer: true, ..have(1, &[(1, 4), (2, 6), (7, 1)]) };
    let out = mind.handle(ms(20), says(3, 2, Message::Have(answer)));
    assert!(matches!(told(&out)[..], [(3, Message::Give(_))]), "an answer is answered with a gift only");
    let out = mind.handle(ms(30), says(3, 3, Message::Have(have(1, &[(1, 5), (2, 5), (7, 1)]))));
    assert!(out.is_empty(), "equals have nothing to say");
}

#[test]
fn what_was_given_and_is_news_goes_on_to_the_other_neighbours_and_nothing_else_does() {
    let mut mind = mind_with(7, MindConfig { quorum: 9, ..MindConfig::default() });
    mind.handle(ms(0), Input::Neighbours(robots([3, 4])));
    mind.handle(ms(0), votes(1, 5, vote(1, 0, LEANING)));
    let held = |robot, sequence| HeldVote {
        robot: RobotId(robot),
        stamp: Stamp { boot: 1, sequence },
        vote: vote(1, 0, LEANING),
    };
    let give = Message::Give(Give { decision: None, votes: vec![held(1, 5), held(2, 2)] });
    let out = mind.handle(ms(10), says(3, 1, give.clone()));
    let [(4, Message::Give(passed))] = &told(&out)[..] else { panic!("{out:?}") };
    assert_eq!(passed.votes, [held(2, 2)]);
    assert!(mind.handle(ms(20), says(4, 1, give)).is_empty(), "a rumour dies where it is known");
}

#[test]
fn one_who_missed_the_round_is_given_the_decision_and_does_not_announce_it_again() {
    let mut knows = mind(7);
    knows.handle(ms(0), Input::Heard(RobotId(5), decision(3, Some(1), 3, 5)));
    let out = knows.handle(ms(10), says(1, 1, Message::Have(Have { round: None, ..have(1, &[]) })));
    let [(1, Message::Give(give))] = &told(&out)[..] else { panic!("{out:?}") };
    assert_eq!(give.decision.as_ref().unwrap().class, Some(ClassId(1)));
    let mut late = mind(1);
    let out = late.handle(ms(20), says(7, 1, Message::Give(give.clone())));
    assert_eq!(holds(&out), [Some(1)]);
    assert!(!late.is_open());
    assert!(live(&mut late, ms(9000)).iter().all(|(_, o)| !matches!(o, Output::Announce(_))));
}

#[test]
fn an_idle_mind_says_one_small_message_per_idle_period() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Neighbours(robots([3])));
    mind.handle(ms(0), Input::Heard(RobotId(5), decision(3, Some(1), 3, 5)));
    live(&mut mind, ms(10_000));
    let idle = live(&mut mind, ms(70_000));
    assert_eq!(idle.len(), 15);
    for (_, output) in idle {
        let Output::Tell(_, envelope) = output else { panic!("{output:?}") };
        assert!(envelope.encode().len() <= 40, "{} bytes", envelope.encode().len());
    }
}

#[test]
fn a_mind_with_nothing_to_do_wants_no_wake() {
    assert_eq!(mind(7).next_wake(), None);
}

// Everything received repeats harmlessly and commutes

mod order {
    use proptest::prelude::*;

    use super::*;

    /// Things robots may say about rounds 1 to 3: what has one author and stamp is one message.
    fn heard() -> impl Strategy<Value = Input> {
        prop_oneof![
            (1..6u32, 1..4u32, 1..4u32).prop_map(|(author, counter, n)| {
                let sequence = 10 * counter + n;
                let said = vote(counter, (sequence + author) as usize % 3, n as f32);
                votes(author, sequence, Vote { round: round(counter, author), ..said })
            }),
            (1..6u32, 1..4u32, 1..5u32).prop_map(|(robot, counter, n)| {
                Input::Heard(RobotId(robot), decision(counter, Some((n % 3) as u8), n, n))
            }),
            (1..6u32, 1..4u32, 1..5u32).prop_map(|(from, counter, n)| {
                let held = HeldVote {
                    robot: RobotId(n),
                    stamp: Stamp { boot: 1, sequence: 10 * counter + 2 },
                    vote: vote(counter, (10 * counter + 2 + n) as usize % 3, 2.0),
                };
                says(from, 90, Message::Give(Give { decision: None, votes: vec![held] }))
            }),
        ]
    }

    /// The ballot and the decision that a mind ends with which only listens: a quorum never met, no time passing.
    fn outcome(heard: &[Input]) -> (Option<RoundId>, BTreeMap<RobotId, Stamp>, Option<Decision>) {
        let mut mind = mind_with(100, MindConfig { quorum: 4096, ..MindConfig::default() });
        for input in heard {
            mind.handle(ms(1), input.clone());
        }
        let mut ballot: BTreeMap<_, _> = mind.ballot().map(|b| b.stamps().collect()).unwrap_or_default();
        ballot.remove(&RobotId(100));
        (mind.round(), ballot, mind.held().cloned())
    }

    proptest! {
        #[test]
        fn any_order_and_any_repetition_give_the_same_ballot_and_decision(
            (heard, shuffled) in prop::collection::vec(heard(), 1..25).prop_flat_map(|heard| {
                let twice: Vec<_> = heard.iter().chain(&heard).cloned().collect();
                (Just(heard), Just(twice).prop_shuffle())
            })
        ) {
            prop_assert_eq!(outcome(&heard), outcome(&shuffled));
        }

        #[test]
        fn nothing_heard_makes_a_mind_spin_or_panic(
            heard in prop::collection::vec((heard(), 0..3000u64), 1..40)
        ) {
            let mut mind = mind(3);
            mind.handle(ms(0), Input::Neighbours(robots([1, 2, 4])));
            let mut now = ms(0);
            for (input, pause) in heard {
                now += ms(pause);
                live(&mut mind, now);
                mind.handle(now, input);
            }
            live(&mut mind, now + ms(20_000));
        }
    }
}

#[test]
fn a_gesture_shown_opens_one_round_however_many_robots_saw_it() {
    let mut slow = mind(2);
    // Another saw the hand hold still at 900 ms; this one, of a slow camera, at 1,300.
    slow.handle(ms(900), votes(1, 1, vote(1, 0, SURE)));
    slow.handle(ms(1000), Input::Tick);
    let opened = |out: &[Output]| out.iter().any(|output| matches!(output, Output::Opened(_)));
    assert!(!opened(&slow.handle(ms(1300), Input::Shown(ms(500)))), "that gesture has its round");
    for at in (1400..9000).step_by(100) {
        assert!(!opened(&slow.handle(ms(at), Input::Tick)), "{at}");
    }
    slow.handle(ms(9000), Input::Left);
    assert!(opened(&slow.handle(ms(10_000), Input::Shown(ms(9100)))), "this is the next");
}

#[test]
fn a_gesture_shown_while_the_last_is_undecided_has_its_round_afterwards() {
    let mut robot = mind(1);
    robot.handle(ms(0), Input::Open);
    robot.handle(ms(3000), Input::Shown(ms(2000)));
    let opened: Vec<u64> = (3100..7000)
        .step_by(100)
        .filter(|at| robot.handle(ms(*at), Input::Tick).contains(&Output::Opened(round(2, 1))))
        .collect();
    assert_eq!(opened, [5200], "after the deadline, and the time decisions have to meet");
    // One that is gone by then has none.
    let mut robot = mind(1);
    robot.handle(ms(0), Input::Open);
    robot.handle(ms(3000), Input::Shown(ms(2000)));
    robot.handle(ms(4000), Input::Left);
    for at in (4000..9000).step_by(100) {
        assert!(!robot.handle(ms(at), Input::Tick).contains(&Output::Opened(round(2, 1))));
    }
}

#[test]
fn a_round_ends_early_when_the_hand_has_left() {
    let mut mind = mind(1);
    mind.handle(ms(0), Input::Shown(ms(0)));
    mind.handle(ms(1500), Input::Left);
    assert!(holds(&mind.handle(ms(2400), Input::Tick)).is_empty(), "votes may still be on their way");
    assert_eq!(holds(&mind.handle(ms(2500), Input::Tick)), [None], "and not only at the deadline");
}

#[test]
fn nobody_waits_for_a_robot_that_says_it_is_blind() {
    let mut blinded = mind(2);
    let said = blinded.handle(ms(10), votes(1, 1, vote(1, 0, SURE)));
    let [theirs] = broadcast(&said)[..] else { panic!("{said:?}") };
    let mut other = mind(7);
    other.handle(ms(0), Input::Alive(robots([1, 2])));
    other.handle(ms(10), votes(1, 1, vote(1, 0, SURE)));
    assert_eq!(other.held(), None);
    assert_eq!(holds(&other.handle(ms(20), votes(2, 1, theirs.clone()))), [Some(0)]);
    // It sees again: in the same round it is a voter like any other.
    let mut out = blinded.handle(ms(20), Input::Blind(false));
    out.extend(blinded.handle(ms(400), saw([0.2, 0.7, 0.1])));
    assert!(broadcast(&out).iter().any(|vote| vote.vocabulary == vocabulary().id()), "{out:?}");
}

#[test]
fn a_robot_that_may_still_see_waits_for_itself_as_the_others_do_for_it() {
    let mut slow = mind(7);
    slow.handle(ms(0), Input::Blind(false));
    slow.handle(ms(0), Input::Alive(robots([1])));
    slow.handle(ms(10), votes(1, 1, vote(1, 0, SURE)));
    slow.handle(ms(300), Input::Tick);
    assert_eq!(slow.held(), None, "its own frame is due");
    assert_eq!(holds(&slow.handle(ms(450), saw([0.9, 0.05, 0.05]))), [Some(0)]);
}
