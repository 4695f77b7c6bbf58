//! What goes wrong, and is well again.

use super::*;

#[test]
fn what_failed_at_random_is_well_when_it_is_to_be_and_what_was_cut_by_name_is_not() {
    let (from, until) = (Duration::from_secs(3), Duration::from_secs(20));
    let cut = Fault { at: Duration::from_secs(8), event: Event::Cut(RobotId(1), RobotId(2)) };
    // No change falls on the end.
    let churn = Churn { from, until, period: Duration::from_millis(1600) };
    let scenario = Scenario { churn: Some(churn), faults: vec![cut], ..calm(9, 0, NetworkShape::Grid, 4) };
    for seed in 0..10 {
        let mut cut = BTreeSet::new();
        for line in String::from_utf8(traced(&scenario, seed)).unwrap().lines() {
            let line: serde_json::Value = serde_json::from_str(line).unwrap();
            assert!(
                line["what"] != "fault" || line["at_us"].as_u64() <= Some(20_000_000),
                "seed {seed}: {line}"
            );
            if !line["event"]["heal"].is_null() {
                assert!(cut.remove(&line["event"]["heal"].to_string()), "seed {seed}: {line}");
            } else if !line["event"]["cut"].is_null() {
                cut.insert(line["event"]["cut"].to_string());
            }
        }
        assert_eq!(cut, ["[1,2]".to_owned()].into(), "seed {seed}");
    }
}

#[test]
fn a_fault_that_changes_nothing_did_not_happen() {
    // Each seed draws other links.
    let all = (1..9).flat_map(|a| (a + 1..10).map(move |b| (a, b)));
    let cut = |(a, b)| Fault { at: Duration::from_secs(8), event: Event::Cut(RobotId(a), RobotId(b)) };
    let scenario = Scenario { faults: all.map(cut).collect(), ..calm(9, 0, NetworkShape::Random, 1) };
    for seed in 0..3 {
        let trace = String::from_utf8(traced(&scenario, seed)).unwrap();
        let cut = trace.lines().filter(|line| line.contains("\"what\":\"fault\"")).count();
        assert!((8..=12).contains(&cut), "seed {seed}: a tree of nine and four links more, not {cut}");
    }
}
