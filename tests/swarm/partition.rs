//! A swarm that falls apart in the middle of a round.

use std::time::Duration;

use gestalt_strategies::Quorum;
use serde_json::{Value, json};

use crate::field::Field;

const PATIENCE: Duration = Duration::from_secs(20);

const HERE: [usize; 3] = [0, 1, 2];
const THERE: [usize; 3] = [3, 4, 5];

/// With a fixed quorum, which each part has.
pub fn the_parts_of_a_cut_swarm_decide_apart_and_agree_at_the_heal() {
    let links: Vec<_> = (0..5).map(|i| (i, i + 1)).collect();
    // Three see one thing and three another, equally sure of it: as long as all hear all, nobody can decide.
    let mut field =
        Field::new(6, &links, Quorum::Evidence(3), |node| Some((if node < 3 { 1 } else { 2 }, 0.7)));
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
    assert!([&here["class"], &there["class"]].contains(&&agreed["class"]), "one of the two wins: {agreed}");
}

/// Four of nine robots are cut off from the others, while instructors on both sides go on; with `GESTALT_LONG` ten times for 60 s.
pub fn a_part_without_the_majority_decides_nothing_and_says_why() {
    let long = std::env::var_os("GESTALT_LONG").is_some();
    let (runs, rounds) = if long { (10, 10) } else { (1, 2) };
    for _ in 0..runs {
        cut_off(rounds);
    }
}

const FEW: [usize; 4] = [0, 1, 2, 3];
const MOST: [usize; 5] = [4, 5, 6, 7, 8];

fn cut_off(rounds: u64) {
    let links: Vec<_> = (0..8).map(|i| (i, i + 1)).collect();
    let mut field = Field::new(9, &links, Quorum::Majority, |_| Some((3, 0.9)));
    let all: Vec<usize> = (0..9).collect();
    field.robots[0].order("open");
    assert_eq!(field.agreed(1, &all, PATIENCE)["class"], json!(3));
    std::thread::sleep(Duration::from_millis(700));
    field.robots[0].order("open");
    let opened =
        |told: &[Value]| told.iter().any(|t| t["event"] == "opened" && t["round"] == 2).then_some(());
    for robot in &field.robots {
        robot.wait(PATIENCE, opened).expect("all take part");
    }
    field.namespaces.cut((3, 4));
    // A round that is decided by nobody takes the five seconds of its deadline.
    for _ in 0..rounds {
        std::thread::sleep(Duration::from_secs(6));
        field.robots[0].order("open");
        field.robots[8].order("open");
    }
    std::thread::sleep(Duration::from_secs(6));
    let (few, most) = (decided(&field, &FEW), decided(&field, &MOST));
    for held in &few {
        let certificate = &held["certificate"];
        let reached =
            certificate["votes"].as_array().unwrap().len() + certificate["others"].as_array().unwrap().len();
        assert!(held["class"].is_null(), "four of nine decided: {held}");
        assert_eq!([&certificate["robots"], &certificate["quorum"]], [&json!(9), &json!(5)], "{held}");
        assert!(reached < 5, "{held}");
    }
    assert!(
        few.len() as u64 >= 4 * rounds && most.len() as u64 >= 5 * rounds,
        "{} {}",
        few.len(),
        most.len()
    );
    assert!(most.iter().all(|held| held["class"] == json!(3)), "five of nine did not decide: {most:#?}");
    field.namespaces.heal((3, 4));
    field.wait_for_all(Duration::from_secs(30));
    let newest = |told: &[Value]| {
        told.iter().filter(|t| t["event"] == "held").filter_map(|t| t["round"].as_u64()).max()
    };
    let last =
        field.robots.iter().filter_map(|robot| newest(&robot.told())).max().expect("rounds were decided");
    std::thread::sleep(Duration::from_secs(6));
    field.robots[0].order("open");
    let agreed = field.agreed(last + 1, &all, PATIENCE);
    assert_eq!([&agreed["class"], &agreed["certificate"]["robots"]], [&json!(3), &json!(9)], "{agreed}");
}

/// The last decision of each of these robots in each round that was opened after the cut.
fn decided(field: &Field, robots: &[usize]) -> Vec<Value> {
    let mut last = std::collections::BTreeMap::new();
    for robot in robots {
        for told in field.robots[*robot].told() {
            if told["event"] == "held" && told["round"].as_u64() > Some(2) {
                last.insert((*robot, told["round"].as_u64()), told["decision"].clone());
            }
        }
    }
    last.into_values().collect()
}
