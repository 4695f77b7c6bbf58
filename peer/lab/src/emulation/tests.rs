//! Whole swarms in the emulated network.

mod ahead;
mod answering;
mod certified;
mod faults;
mod forgetting;
mod lying;
mod partition;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Mutex;
use std::time::Duration;

use gestalt_protocol::{ClassId, FusionRule, RobotId};
use gestalt_strategies::{Classify, MindConfig, Observation, Refusal, SetPart};

use super::*;
use crate::shape::NetworkShape;

fn shipped(name: &str) -> Scenario {
    Scenario::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/emulation").join(name)).unwrap()
}

/// Robots that see perfectly well, or not at all, on some topology.
fn calm(seeing: usize, blind: usize, topology: NetworkShape, rounds: u32) -> Scenario {
    let view = Some(View { fps: 2.0, signal: 1.5, persistence: 0.0, likeness: 0.0 });
    Scenario {
        robots: vec![
            Group { name: "seeing".to_owned(), count: seeing, view, lies: None, poison: None },
            Group { name: "blind".to_owned(), count: blind, view: None, lies: None, poison: None },
        ],
        topology,
        rounds,
        ..Scenario::parse("{ robots: [{ name: 'a', count: 1 }], topology: 'line' }", "test").unwrap()
    }
}

fn traced(scenario: &Scenario, seed: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    run_traced(scenario, seed, Trace::to(&mut bytes)).unwrap().1.unwrap();
    bytes
}

#[test]
fn the_same_seed_writes_the_same_trace_and_another_does_not() {
    let scenario = shipped("churn.json5");
    let first = traced(&scenario, 1);
    assert!(first.len() > 10_000);
    assert!(first == traced(&scenario, 1), "the traces of one seed differ");
    assert!(first != traced(&scenario, 2));
}

#[test]
fn a_calm_swarm_agrees_in_every_round_and_announces_each_decision_once() {
    for topology in
        [NetworkShape::Line, NetworkShape::Ring, NetworkShape::Grid, NetworkShape::Star, NetworkShape::Random]
    {
        let report = run(&calm(6, 2, topology, 8), 7).unwrap();
        assert_eq!((report.unanimous.hits, report.unanimous.trials), (8, 8), "{topology:?}");
        assert_eq!((report.announcements.mean, report.announcements.half_width), (1.0, 0.0), "{topology:?}");
        assert!(report.agreed_at_the_end);
    }
}

#[test]
fn the_eighth_in_a_line_decides_what_only_the_first_sees() {
    let report = run(&calm(1, 7, NetworkShape::Line, 10), 3).unwrap();
    assert_eq!(report.unanimous.hits, 10);
    assert!(report.right.hits >= 8, "{:?}", report.right);
}

#[test]
fn a_hundred_robots_with_thirty_percent_loss_decide_a_round() {
    let scenario = shipped("hundred.json5");
    assert_eq!((scenario.swarm_size(), scenario.link.loss), (100, 0.3));
    let report = run(&scenario, 0).unwrap();
    assert_eq!((report.right.hits, report.unanimous.hits), (1, 1));
}

#[test]
fn a_hundred_honest_robots_are_refused_nothing_for_being_too_often() {
    let hundred = Scenario { rounds: 3, ..shipped("hundred.json5") };
    let calm = Scenario { link: LinkModel::default(), ..hundred.clone() };
    let churn = Churn {
        from: Duration::from_secs(3),
        until: Duration::from_secs(25),
        period: Duration::from_millis(100),
    };
    let cut = Scenario { churn: Some(churn), topology: NetworkShape::Grid, ..calm.clone() };
    let star = Scenario { topology: NetworkShape::Star, ..hundred.clone() };
    for scenario in [hundred, calm, cut, star] {
        let mut emulation = emulation(&scenario, 1);
        while emulation.show_next() {}
        let count = |refusal| (0..100).map(|i| emulation.refusals(i).unwrap().count(refusal)).sum::<u64>();
        let refused = [Refusal::DecisionTooOften, Refusal::HaveTooOften].map(count);
        assert_eq!(refused, [0, 0], "{:?}, {:?}", scenario.topology, scenario.link);
    }
}

#[test]
fn ten_robots_with_bad_eyes_are_right_in_95_percent_of_rounds() {
    let scenario = shipped("fusion.json5");
    assert_eq!(scenario.swarm_size(), 10);
    let contender = Contender { rule: FusionRule::LogPool, alpha: None };
    let summaries = compare(&Scenario { compare: vec![contender], ..scenario }, 10, || ()).unwrap();
    let summary = &summaries[0];
    assert!((0.55..=0.67).contains(&summary.frames_right.mean), "{:?}", summary.frames_right);
    assert!(summary.right.share >= 0.95, "{:?}", summary.right);
}

/// What each robot sees first of each showing.
type FirstFrames = BTreeMap<(usize, u32), Vec<f32>>;

/// Notes what is seen first of each showing.
struct Noting {
    eyes: Box<dyn Observer>,
    robot: usize,
    showing: u32,
    noted: Arc<Mutex<FirstFrames>>,
}

impl Observer for Noting {
    fn classifier(&self) -> Option<Arc<dyn Classify>> {
        self.eyes.classifier()
    }

    fn period(&self) -> f64 {
        self.eyes.period()
    }

    fn show(&mut self, shown: ClassId, rng: &mut dyn rand::Rng) {
        self.showing += 1;
        self.eyes.show(shown, rng);
    }

    fn frame(&mut self, rng: &mut dyn rand::Rng) -> Option<Observation> {
        let frame = self.eyes.frame(rng)?;
        let mut noted = self.noted.lock().unwrap();
        noted.entry((self.robot, self.showing)).or_insert_with(|| frame.features.clone());
        Some(frame)
    }
}

#[test]
fn every_fusion_rule_is_compared_on_the_same_frames() {
    let scenario = Scenario { rounds: 5, ..shipped("fusion.json5") };
    let first_frames = |contender: &Contender| {
        let contending = scenario.contending(*contender);
        let noted = Arc::new(Mutex::new(FirstFrames::new()));
        let noting = |(robot, eyes)| -> Box<dyn Observer> {
            Box::new(Noting { eyes, robot, showing: 0, noted: noted.clone() })
        };
        let observers = (0..).zip(statistical_observers(&scenario).unwrap()).map(noting).collect();
        run_with(&contending, 1, observers, Trace::none()).unwrap().1.unwrap();
        std::mem::take(&mut *noted.lock().unwrap())
    };
    let frames: Vec<_> = scenario.compare.iter().map(first_frames).collect();
    assert_eq!((frames.len(), frames[0].len()), (4, 50));
    assert!(frames.iter().all(|of_rule| *of_rule == frames[0]), "a rule is shown other frames");

    let scenario = Scenario { rounds: 3, ..scenario };
    let summaries = compare(&scenario, 2, || ()).unwrap();
    assert_eq!(summaries.len(), 4);
    assert!(summaries.iter().all(|summary| summary.right.trials == 6));
    let share = summaries[0].frames_right;
    assert!(summaries.iter().all(|summary| summary.frames_right == share), "frames are not counted alike");
    let table = Table(&summaries).to_string();
    assert!(
        table.contains("confidence_weighted") && table.contains("10 robots, 6 rounds of 2 seeds"),
        "{table}"
    );
}

#[test]
fn after_cuts_and_heals_all_agree() {
    let scenario = shipped("churn.json5");
    for seed in 0..10 {
        let report = run(&scenario, seed).unwrap();
        assert!(report.agreed_at_the_end, "seed {seed}: {report:?}");
    }
}

#[test]
fn within_three_seconds_of_calm_all_hold_the_last_decision() {
    let churn = Churn {
        from: Duration::from_secs(3),
        until: Duration::from_secs(33),
        period: Duration::from_millis(300),
    };
    let calm_for = Duration::from_secs(3);
    let rounds = 11;
    // A round that a part of the swarm cannot decide is over before the next.
    let mind = MindConfig { deadline: Duration::from_secs(2), ..MindConfig::default() };
    let scenario = Scenario {
        mind,
        interval: (churn.until + calm_for) / (rounds + 1),
        rounds,
        churn: Some(churn),
        ..calm(9, 0, NetworkShape::Grid, rounds)
    };
    for seed in 1..21 {
        let report = run(&scenario, seed).unwrap();
        assert!(report.agreed_at_the_end, "seed {seed}: {report:?}");
    }
}

#[test]
fn a_robot_that_missed_a_round_is_told_of_it_when_it_is_back() {
    let fault = |at: u64, event| Fault { at: Duration::from_secs(at), event };
    let scenario = Scenario {
        faults: vec![
            fault(6, Event::Cut(RobotId(1), RobotId(2))),
            fault(11, Event::Heal(RobotId(1), RobotId(2))),
            fault(20, Event::Freeze(RobotId(2))),
            fault(26, Event::Thaw(RobotId(2))),
            fault(34, Event::Kill(RobotId(3))),
            fault(39, Event::Restart(RobotId(3))),
        ],
        ..calm(2, 1, NetworkShape::Line, 5)
    };
    let report = run(&scenario, 2).unwrap();
    assert_eq!(report.unanimous.hits, report.unanimous.trials, "{report:?}");
    assert!(report.agreed_at_the_end);
}

#[test]
fn votes_cost_at_most_a_kilobyte_a_second() {
    let mut scenario = calm(10, 0, NetworkShape::Random, 3);
    // Nobody is ever sure, so every round lasts until its deadline.
    scenario.mind.alpha = Some(1e-12);
    scenario.robots[0].view = Some(View { fps: 30.0, signal: 0.1, persistence: 0.0, likeness: 0.0 });
    let report = run(&scenario, 1).unwrap();
    assert!((1.0..=1000.0).contains(&report.vote_bytes_per_open_second), "{report:?}");
}

#[test]
fn another_number_of_eyes_than_robots_is_refused() {
    let error = run_with(&calm(2, 0, NetworkShape::Line, 1), 0, vec![Box::new(BlindObserver)], Trace::none());
    assert!(matches!(error, Err(ScenarioError::Value { key: "robots", .. })));
}

#[test]
fn robots_that_could_share_nothing_are_refused() {
    let mut scenario = Scenario { classes: 30, ..learning(2, 1.0, NetworkShape::Line) };
    scenario.learning.as_mut().unwrap().robots.share_bytes = Some(128);
    let error = run(&scenario, 1).unwrap_err().to_string();
    assert!(error.starts_with("learning.robots: share_bytes is 128"), "{error}");
}

/// Robots on a ring that are shown each gesture once, see five looks of it and learn from nothing.
pub(super) fn learning(robots: usize, fraction: f64, topology: NetworkShape) -> Scenario {
    let json = "{ keep: 5, share_bytes: null, precision: 'f32' }";
    let mut teaching = Teaching { robots: json5::from_str(json).unwrap(), ..Teaching::default() };
    teaching.robots.share_fraction = fraction;
    let mut scenario = calm(robots, 0, topology, 6);
    scenario.robots.pop();
    scenario.robots[0].view = Some(View { fps: 2.5, signal: 3.0, persistence: 0.5, likeness: 0.0 });
    let mind = MindConfig { patience: Duration::from_millis(600), ..scenario.mind };
    Scenario { mind, order: Order::InTurn, learning: Some(teaching), ..scenario }
}

/// A run without a trace, to be looked into.
pub(super) fn emulation(scenario: &Scenario, seed: u64) -> Emulation<'_> {
    let mut observers = statistical_observers(scenario).unwrap();
    let school = school_of_scores(scenario, &mut observers).unwrap();
    Emulation::new(scenario, seed, observers, school, Trace::none()).unwrap()
}

/// Personal, shared and external samples of each robot at the end, and how many are known to all.
fn held(scenario: &Scenario, seed: u64) -> (Vec<[usize; 3]>, usize) {
    let mut emulation = emulation(scenario, seed);
    while emulation.show_next() {}
    let sets = (0..scenario.swarm_size()).map(|i| emulation.training_set(i).unwrap());
    let ids = |set: &TrainingSet| set.common().filter_map(|sample| sample.id).collect::<BTreeSet<_>>();
    let mut common = sets.clone().map(ids);
    let first = common.next().unwrap();
    let of_all = common.fold(first, |all, ids| all.intersection(&ids).copied().collect());
    let parts = [SetPart::Personal, SetPart::Shared, SetPart::External];
    (sets.map(|set| parts.map(|part| set.total(part))).collect(), of_all.len())
}

#[test]
fn ten_robots_on_a_ring_hold_what_the_source_says() {
    let (parts, common) = held(&learning(10, 0.2, NetworkShape::Ring), 1);
    assert_eq!(parts, vec![[24, 6, 54]; 10]);
    assert_eq!(common, 60);
}

#[test]
fn with_three_messages_of_ten_lost_no_sample_is_missing_after_a_calm() {
    let mut scenario = learning(10, 0.2, NetworkShape::Ring);
    scenario.link.loss = 0.3;
    // Repair speaks every four seconds through the same bad links, and one question and answer of three messages gets
    // through in one of three: nearly a minute follows the last word.
    scenario.interval = Duration::from_secs(60);
    let mut as_without_loss = 0;
    for seed in 0..20 {
        let (parts, common) = held(&scenario, seed);
        assert_eq!(common, parts.iter().map(|[_, shared, _]| shared).sum::<usize>(), "seed {seed}");
        assert!(parts.iter().all(|[_, shared, external]| shared + external == common), "seed {seed}");
        as_without_loss += u32::from(parts == vec![[24, 6, 54]; 10]);
    }
    // A robot that hears of a round first by its decision did not look, and has nothing to share of it.
    assert!(as_without_loss >= 12, "{as_without_loss} of 20");
}

#[test]
fn the_size_of_a_training_set_follows_the_formula() {
    for (robots, fraction) in
        [5_usize, 20].into_iter().flat_map(|n| [0.0, 0.1, 0.5, 1.0].map(|fraction| (n, fraction)))
    {
        let (parts, common) = held(&learning(robots, fraction, NetworkShape::Ring), 2);
        let shared = (30.0 * fraction) as usize;
        let expected = [30 - shared, shared, shared * (robots - 1)];
        assert_eq!(parts, vec![expected; robots], "{robots} robots, B = {fraction}");
        assert_eq!(common, shared * robots);
    }
}

#[test]
fn with_learning_too_a_seed_fixes_every_byte() {
    let mut scenario = learning(5, 0.5, NetworkShape::Random);
    scenario.link.loss = 0.2;
    scenario.learning.as_mut().unwrap().robots.capacity = 40;
    let first = traced(&scenario, 1);
    assert!(String::from_utf8_lossy(&first).contains("learn"));
    assert!(first == traced(&scenario, 1), "the traces of one seed differ");
    assert!(first != traced(&scenario, 2));
}

#[test]
fn robots_that_share_learn_faster_than_robots_that_do_not() {
    let frames_right = |fraction| {
        let mut scenario = learning(8, fraction, NetworkShape::Ring);
        scenario.rounds = 18;
        scenario.learning.as_mut().unwrap().robots.keep = 2;
        // Nobody is ever sure: only what is learned differs.
        scenario.mind = MindConfig { alpha: Some(1e-12), clip: 0.5, ..scenario.mind };
        (0..3).map(|seed| run(&scenario, seed).unwrap().frames_right.share).sum::<f64>() / 3.0
    };
    let (alone, together) = (frames_right(0.0), frames_right(1.0));
    assert!(together > alone + 0.03, "{together} together, {alone} alone");
}

#[test]
fn a_robot_that_was_away_has_all_its_samples_back_and_gets_what_it_missed() {
    let fault = |at: u64, event| Fault { at: Duration::from_secs(at), event };
    let mut scenario = learning(4, 1.0, NetworkShape::Ring);
    scenario.faults = vec![fault(27, Event::Kill(RobotId(2))), fault(29, Event::Restart(RobotId(2)))];
    let (parts, common) = held(&scenario, 3);
    // Of three gestures it saw all five looks before, of one or two after; its own from then are still its own.
    assert!(parts[1][1] > 15, "{parts:?}");
    assert_eq!(common, parts.iter().map(|part| part[1]).sum::<usize>(), "{parts:?}");
    assert!(parts.iter().all(|[personal, shared, external]| *personal == 0 && shared + external == common));
}

#[test]
fn bytes_of_samples_are_counted_apart() {
    let scenario = learning(6, 0.2, NetworkShape::Ring);
    let mut emulation = emulation(&scenario, 1);
    while emulation.show_next() {}
    let bytes: Traffic = (0..6).map(|i| emulation.traffic(i)).sum();
    // One vector of six f32 in each of six messages of each robot, with what surrounds it.
    assert!((36 * 24..36 * 64).contains(&bytes.published_samples), "{bytes:?}");
    // On a ring each goes over five links.
    assert_eq!(bytes.samples + bytes.relayed_samples, 5 * bytes.published_samples);
    let alone = run(&learning(6, 0.0, NetworkShape::Ring), 1).unwrap().bytes_per_robot;
    assert_eq!((alone.published_samples, alone.samples_on_links), (0.0, 0.0));
}

#[test]
fn told_only_right_or_wrong_robots_that_know_nothing_learn_nothing() {
    let mut scenario = learning(3, 1.0, NetworkShape::Ring);
    scenario.learning.as_mut().unwrap().feedback = Feedback::Partial;
    let learned = run(&scenario, 1).unwrap().learned.unwrap();
    assert_eq!(learned.samples.mean, 0.0);
}

/// So many that a committee votes, two of whom are killed, with messages lost.
fn large() -> Scenario {
    let mut scenario = learning(130, 1.0, NetworkShape::Random);
    scenario.link.loss = 0.05;
    scenario.rounds = 2;
    scenario.learning.as_mut().unwrap().robots.capacity = 60;
    let fault = |at: u64, event| Fault { at: Duration::from_secs(at), event };
    scenario.faults = vec![fault(9, Event::Kill(RobotId(5))), fault(12, Event::Kill(RobotId(77)))];
    scenario
}

#[test]
fn of_a_large_swarm_too_a_seed_fixes_every_byte_on_any_number_of_threads() {
    let scenario = large();
    assert_eq!(scenario.mind.committee_of(130), Some(72));
    let on = |threads: usize, most_unread: Option<usize>| {
        let mut bytes = Vec::new();
        let mut observers = statistical_observers(&scenario).unwrap();
        let school = school_of_scores(&scenario, &mut observers).unwrap();
        let emulation = Emulation::new(&scenario, 1, observers, school, Trace::to(&mut bytes)).unwrap();
        let mut emulation = emulation.on_threads(threads);
        emulation.swarm.most_unread = most_unread.unwrap_or(emulation.swarm.most_unread);
        let (report, written) = emulation.finish();
        written.unwrap();
        (bytes, report)
    };
    let first = on(1, None);
    assert!(String::from_utf8_lossy(&first.0).contains("learn"));
    assert!(first == on(2, None), "two threads make another trace than one");
    assert!(first == on(8, None), "eight threads make another trace than one");
    assert!(first == on(1, Some(1)), "minds that are told at once what could wait do another thing");
    assert!(first == on(8, Some(usize::MAX)), "minds that are told as late as can be do another thing");
}

#[test]
fn a_committee_decides_for_all_and_costs_each_less_than_all_would() {
    let run = |committee| {
        let mut scenario = calm(150, 0, NetworkShape::Random, 6);
        scenario.robots.pop();
        scenario.mind.committee = committee;
        run(&scenario, 3).unwrap()
    };
    let (some, all) = (run(72), run(0));
    for report in [&some, &all] {
        assert_eq!((report.right.hits, report.unanimous.hits), (6, 6), "{report:?}");
        assert_eq!(report.announcements.mean, 1.0);
    }
    let bytes = |report: &Report| report.bytes_per_robot.votes + report.bytes_per_robot.relayed;
    assert!(bytes(&some) < 0.6 * bytes(&all), "{} and {}", bytes(&some), bytes(&all));
}

#[test]
fn a_small_swarm_knows_neither_committee_nor_budget() {
    // Of ten the budget leaves each ten samples: those of two rounds, if the lesson of one is heard late.
    let mut scenario = learning(10, 1.0, NetworkShape::Random);
    scenario.link.loss = 0.1;
    scenario.rounds = 3;
    let by_default = traced(&scenario, 1);
    scenario.mind.committee = 0;
    scenario.learning.as_mut().unwrap().robots.share_per_round = None;
    assert!(by_default == traced(&scenario, 1));
}
