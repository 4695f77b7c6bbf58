//! Whole swarms in the emulated network.

use std::path::Path;
use std::time::{Duration, Instant};

use gestalt_protocol::{FusionRule, RobotId};

use super::*;
use crate::topology::Topology;

fn shipped(name: &str) -> Scenario {
    Scenario::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/emulation").join(name)).unwrap()
}

/// Robots that see perfectly well, or not at all, on some topology.
fn calm(seeing: usize, blind: usize, topology: Topology, rounds: u32) -> Scenario {
    let view = Some(View { fps: 2.0, signal: 1.5, persistence: 0.0 });
    Scenario {
        robots: vec![
            Group { name: "seeing".to_owned(), count: seeing, view },
            Group { name: "blind".to_owned(), count: blind, view: None },
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
    for topology in [Topology::Line, Topology::Ring, Topology::Grid, Topology::Star, Topology::Random] {
        let report = run(&calm(6, 2, topology, 8), 7).unwrap();
        assert_eq!((report.unanimous.hits, report.unanimous.trials), (8, 8), "{topology:?}");
        assert_eq!((report.announcements.mean, report.announcements.half_width), (1.0, 0.0), "{topology:?}");
        assert!(report.agreed_at_the_end);
    }
}

#[test]
fn the_eighth_in_a_line_decides_what_only_the_first_sees() {
    let report = run(&calm(1, 7, Topology::Line, 10), 3).unwrap();
    assert_eq!(report.unanimous.hits, 10);
    assert!(report.right.hits >= 8, "{:?}", report.right);
}

#[test]
fn a_hundred_robots_with_thirty_percent_loss_decide_a_round_in_a_second_of_wall_time() {
    let scenario = shipped("hundred.json5");
    assert_eq!((scenario.swarm_size(), scenario.link.loss), (100, 0.3));
    let began = Instant::now();
    let report = run(&scenario, 0).unwrap();
    let took = began.elapsed();
    assert_eq!((report.right.hits, report.unanimous.hits), (1, 1));
    assert!(took < Duration::from_secs(1), "{took:?}");
}

#[test]
fn ten_robots_with_bad_eyes_are_right_in_95_percent_of_rounds() {
    let scenario = shipped("fusion.json5");
    assert_eq!(scenario.swarm_size(), 10);
    let contender = Contender { rule: FusionRule::LogPool, alpha: None };
    let summaries = compare(&Scenario { compare: vec![contender], ..scenario }, 10, || ()).unwrap();
    let summary = &summaries[0];
    assert!((0.5..=0.7).contains(&summary.frames_right.share), "{:?}", summary.frames_right);
    assert!(summary.right.share >= 0.95, "{:?}", summary.right);
}

#[test]
fn every_fusion_rule_is_compared_on_the_same_frames() {
    let scenario = Scenario { rounds: 3, ..shipped("fusion.json5") };
    let summaries = compare(&scenario, 2, || ()).unwrap();
    assert_eq!(summaries.len(), 4);
    assert!(summaries.iter().all(|summary| summary.right.trials == 6));
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
    let scenario = Scenario {
        interval: (churn.until + calm_for) / (rounds + 1),
        rounds,
        churn: Some(churn),
        ..calm(9, 0, Topology::Grid, rounds)
    };
    for seed in 0..20 {
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
        ..calm(2, 1, Topology::Line, 5)
    };
    let report = run(&scenario, 1).unwrap();
    assert_eq!(report.unanimous.hits, report.unanimous.trials, "{report:?}");
    assert!(report.agreed_at_the_end);
}

#[test]
fn votes_cost_at_most_a_kilobyte_a_second() {
    let mut scenario = calm(10, 0, Topology::Random, 3);
    // Nobody is ever sure, so every round lasts until its deadline.
    scenario.mind.alpha = 1e-12;
    scenario.robots[0].view = Some(View { fps: 30.0, signal: 0.1, persistence: 0.0 });
    let report = run(&scenario, 1).unwrap();
    assert!((1.0..=1000.0).contains(&report.vote_bytes_per_open_second), "{report:?}");
}

#[test]
fn another_number_of_eyes_than_robots_is_refused() {
    let error = run_with(&calm(2, 0, Topology::Line, 1), 0, vec![Box::new(BlindObserver)], Trace::none());
    assert!(matches!(error, Err(ScenarioError::Value { key: "robots", .. })));
}
