//! What robots do ahead of their turn is what they would have done at their turn.

use super::*;

/// All that happens, what came of it, and how many turns were taken ahead: on so many threads, wherever robots can.
fn everything(scenario: &Scenario, seed: u64, threads: usize) -> (String, Report, u64) {
    let mut bytes = Vec::new();
    let mut observers = statistical_observers(scenario).unwrap();
    let school = school_of_scores(scenario, &mut observers).unwrap();
    let emulation = Emulation::new(scenario, seed, observers, school, Trace::to(&mut bytes)).unwrap();
    let mut emulation = emulation.on_threads(threads);
    emulation.swarm.worthwhile = 1;
    while emulation.show_next() {}
    let taken_ahead = emulation.swarm.taken_ahead;
    let (report, written) = emulation.finish();
    written.unwrap();
    (String::from_utf8(bytes).unwrap(), report, taken_ahead)
}

fn is_the_same_ahead(what: &str, scenario: &Scenario, seeds: std::ops::Range<u64>) {
    for seed in seeds {
        let (in_turn, ahead) = (everything(scenario, seed, 1), everything(scenario, seed, 2));
        let differing = in_turn.0.lines().zip(ahead.0.lines()).find(|(one, other)| one != other);
        assert_eq!(differing, None, "{what}, seed {seed}");
        assert_eq!(in_turn.0, ahead.0, "{what}, seed {seed}");
        assert_eq!(in_turn.1, ahead.1, "{what}, seed {seed}");
        assert!(in_turn.2 == 0 && ahead.2 > 100, "{what}, seed {seed}: {} turns were taken ahead", ahead.2);
    }
}

#[test]
fn robots_that_go_ahead_do_what_they_would_have_done_at_their_turn() {
    is_the_same_ahead("churn", &shipped("churn.json5"), 0..4);
    is_the_same_ahead("a large swarm", &large(), 0..1);
    let mut taught = learning(8, 1.0, NetworkShape::Ring);
    taught.rounds = 4;
    taught.link.loss = 0.1;
    is_the_same_ahead("learning", &taught, 0..4);
}

/// What is due at one instant has an order that only the queue knows; long ways make long stretches of time to go ahead in.
#[test]
fn so_they_do_where_much_is_due_at_one_instant_and_where_messages_take_long() {
    for latency in [Duration::from_millis(1), Duration::from_millis(250), Duration::from_secs(2)] {
        let mut scenario = learning(8, 1.0, NetworkShape::Grid);
        scenario.rounds = 4;
        scenario.link = LinkModel { latency, jitter: Duration::ZERO, ..scenario.link };
        is_the_same_ahead("in step", &scenario, 0..3);
        scenario.link.jitter = Duration::from_nanos(2);
        is_the_same_ahead("nearly in step", &scenario, 0..3);
    }
}

#[test]
fn so_they_do_among_liars_poisoners_and_robots_that_stop_die_and_start_again() {
    let mut lied = calm(9, 1, NetworkShape::Random, 5);
    for lies in [Lies::Choosing, Lies::TwoFaced, Lies::Together] {
        lied.robots[1].lies = Some(lies);
        lied.mind.liars = 1;
        is_the_same_ahead("liars", &lied, 0..2);
    }
    let mut scenario = learning(9, 1.0, NetworkShape::Random);
    let others = Group {
        name: "others".to_owned(),
        count: 2,
        poison: Some(Poison::NearBoundary),
        ..scenario.robots[0].clone()
    };
    scenario.robots.push(others);
    scenario.rounds = 6;
    let fault = |ms: u64, event| Fault { at: Duration::from_millis(ms), event };
    let (dies, stops) = (RobotId(2), RobotId(3));
    // In the midst of rounds.
    scenario.faults = vec![
        fault(3_100, Event::Kill(dies)),
        fault(3_150, Event::Freeze(stops)),
        fault(9_200, Event::Restart(dies)),
        fault(9_300, Event::Thaw(stops)),
        fault(15_050, Event::Kill(dies)),
        fault(15_250, Event::Restart(dies)),
    ];
    is_the_same_ahead("faults", &scenario, 0..4);
    // They say what follows from what they hold just then, while much comes in.
    let mut poisoned = scenario.clone();
    poisoned.faults.clear();
    poisoned.link.latency = Duration::from_millis(600);
    for poison in [Poison::Copycat, Poison::NearBoundary] {
        poisoned.robots[1].poison = Some(poison);
        is_the_same_ahead("poison", &poisoned, 0..3);
    }
    for feedback in [Feedback::Partial, Feedback::Asked] {
        scenario.learning.as_mut().unwrap().feedback = feedback;
        scenario.link.latency = Duration::from_secs(1);
        is_the_same_ahead("questions", &scenario, 0..2);
    }
}
