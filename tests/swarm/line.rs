//! Eight processes in a line of network namespaces: each hears its two neighbours only.

use std::time::Duration;

use gestalt_strategies::Quorum;
use serde_json::json;

use crate::field::Field;

pub fn the_eighth_in_a_line_decides_what_the_first_two_see() {
    let links: Vec<_> = (0..7).map(|i| (i, i + 1)).collect();
    // The sixth sees something else, and is outvoted.
    let mut field = Field::new(8, &links, Quorum::Evidence(2), |node| match node {
        0 | 1 => Some((4, 0.9)),
        5 => Some((2, 0.9)),
        _ => None,
    });
    field.robots[0].order("open");
    let all: Vec<usize> = (0..8).collect();
    let decision = field.agreed(1, &all, Duration::from_secs(20));
    assert_eq!(decision["class"], json!(4), "{decision}");
    let far = field.robots[7].told();
    let neighbours = far.iter().rev().find(|told| told["event"] == "neighbours").expect("it has neighbours");
    assert_eq!(neighbours["robots"], json!([6]), "the line is no line");
}
