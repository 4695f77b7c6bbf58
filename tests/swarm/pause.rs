//! All robots stand still at once, for longer than their links last: a machine that sleeps, a switch that is off.

use std::time::Duration;

use gestalt_strategies::Quorum;
use serde_json::json;

use crate::field::Field;

const NODES: u32 = 10;

/// As long as silent links take to be found and made anew.
const PATIENCE: Duration = Duration::from_secs(40);

pub fn a_line_that_stood_still_agrees_again() {
    let links: Vec<_> = (1..NODES).map(|i| (i - 1, i)).collect();
    let mut field = Field::new(NODES, &links, Quorum::Evidence(2), |node| match node {
        0 | 5 => Some((2, 0.9)),
        9 => Some((4, 0.5)),
        _ => None,
    });
    let all: Vec<usize> = (0..NODES as usize).collect();
    let mut round = 0;
    for pause in [1200, 2000, 4000] {
        for robot in &field.robots {
            robot.signal("STOP");
        }
        std::thread::sleep(Duration::from_millis(pause));
        for robot in &field.robots {
            robot.signal("CONT");
        }
        // At once, and when all is quiet again.
        for wait in [0, 2000] {
            std::thread::sleep(Duration::from_millis(wait));
            round += 1;
            field.robots[round as usize % 10].order("open");
            let decision = field.agreed(round, &all, PATIENCE);
            if wait > 0 {
                assert_eq!(decision["class"], json!(2), "{decision}");
            }
        }
    }
}
