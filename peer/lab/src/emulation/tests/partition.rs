//! A swarm that falls apart for a minute and comes together again.

use super::*;

#[test]
fn five_seconds_after_a_cut_of_a_minute_all_hold_one_decision_and_know_the_same() {
    let (interval, rounds) = (Duration::from_secs(6), 14);
    let healed = interval * rounds - Duration::from_secs(5);
    for seed in 0..10 {
        // Four and five of a ring, at another moment of the round each time.
        let cut = Duration::from_millis(12_000 + seed * 137 % 4000);
        let both = |at, event: fn(RobotId, RobotId) -> Event| {
            [(1, 9), (4, 5)].map(|(a, b)| Fault { at, event: event(RobotId(a), RobotId(b)) })
        };
        let faults = [both(cut, Event::Cut), both(healed, Event::Heal)].concat();
        let scenario = Scenario { faults, rounds, interval, ..learning(9, 0.5, NetworkShape::Ring) };
        let mut emulation = emulation(&scenario, seed);
        while emulation.show_next() {}
        let known = |i| {
            let common = emulation.training_set(i).unwrap().common();
            common.filter_map(|sample| Some((sample.id?, sample.class))).collect::<BTreeSet<_>>()
        };
        let first = known(0);
        assert!(!first.is_empty() && (1..9).all(|i| known(i) == first), "seed {seed}");
        let (report, _) = emulation.finish();
        assert!(report.agreed_at_the_end, "seed {seed}: {report:?}");
    }
}

/// Before the second showing nothing was shown for longer than votes are remembered; and just then, or a while before, the swarm falls into three.
#[test]
fn no_part_of_a_swarm_that_rested_decides_alone() {
    for cut in [280, 299] {
        let faults = [(2, 3), (3, 4)]
            .map(|(a, b)| Fault { at: Duration::from_secs(cut), event: Event::Cut(RobotId(a), RobotId(b)) });
        let interval = Duration::from_secs(150);
        let scenario = Scenario { faults: faults.into(), interval, ..calm(5, 0, NetworkShape::Line, 2) };
        assert!(interval > scenario.mind.lately);
        for seed in 0..10 {
            let report = run(&scenario, seed).unwrap();
            let decided = report.right.hits + report.wrong.hits;
            assert_eq!((decided, report.undecided.hits), (1, 1), "cut at {cut}, seed {seed}: {report:?}");
        }
    }
}

/// Both parts count their rounds alike, for different showings: what one holds of its own is no outcome of the other's.
#[test]
fn parts_that_stay_apart_and_see_well_are_never_wrong_and_contradict_nobody() {
    let cut = [(1, 9), (4, 5)].map(|(a, b)| Event::Cut(RobotId(a), RobotId(b)));
    let faults = cut.map(|event| Fault { at: Duration::from_secs(10), event });
    let mut scenario = Scenario { faults: faults.into(), ..calm(9, 0, NetworkShape::Ring, 12) };
    scenario.robots[0].view = Some(View { fps: 4.0, signal: 8.0, persistence: 0.0, likeness: 0.0 });
    for seed in 0..20 {
        let report = run(&scenario, seed).unwrap();
        let wrong = [report.wrong, report.finally_wrong].map(|share| share.hits);
        assert_eq!((wrong, report.conflicts), ([0, 0], 0), "seed {seed}: {report:?}");
        // Each showing but the first is met by one part alone, and the part of five decides.
        assert_eq!((report.unanimous.hits, report.announcements.mean), (1, 1.0), "seed {seed}: {report:?}");
        assert!(report.right.hits > 1 && report.undecided.hits > 0, "seed {seed}: {report:?}");
    }
}
