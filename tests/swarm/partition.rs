//! A swarm that falls apart in the middle of a round.

use std::time::Duration;

use serde_json::json;

use crate::field::Field;

const PATIENCE: Duration = Duration::from_secs(20);

const HERE: [usize; 3] = [0, 1, 2];
const THERE: [usize; 3] = [3, 4, 5];

pub fn the_parts_of_a_cut_swarm_decide_apart_and_agree_at_the_heal() {
    let links: Vec<_> = (0..5).map(|i| (i, i + 1)).collect();
    // Three see one thing and three another, equally sure of it: as long as all hear all, nobody can decide.
    let mut field = Field::new(6, &links, 3, |node| Some((if node < 3 { 1 } else { 2 }, 0.7)));
    field.robots[0].order("open");
    let opened = |told: &[serde_json::Value]| told.iter().any(|t| t["event"] == "opened").then_some(());
    for robot in &field.robots {
        robot.wait(PATIENCE, opened).expect("all take part");
    }
    field.namespaces.cut((2, 3));
    let (here, there) = (field.agreed(1, &HERE, PATIENCE), field.agreed(1, &THERE, PATIENCE));
    assert_eq!([&here["class"], &there["class"]], [&json!(1), &json!(2)], "{here} {there}");
    field.namespaces.heal((2, 3));
    let all: Vec<usize> = (0..6).collect();
    let agreed = field.agreed(1, &all, Duration::from_secs(30));
    assert!(agreed == here || agreed == there, "one of the two wins, as it was: {agreed}");
}
