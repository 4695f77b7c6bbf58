//! Robots in one process, linked explicitly.

use std::time::Duration;

use gestalt_protocol::ClassId;
use gestalt_tests::{Watched, config, start, unique};

const PATIENCE: Duration = Duration::from_secs(10);

/// Starts a line in which robot `i` dials `i - 1`.
async fn line(n: u32, sees: impl Fn(u32) -> Option<ClassId>) -> Vec<Watched> {
    let swarm = unique("line");
    let mut robots: Vec<Watched> = Vec::new();
    for id in 0..n {
        let connect = robots.last().map(|before| before.robot.locators().to_vec()).unwrap_or_default();
        robots.push(start(config(id, &swarm, &connect), sees(id)).await);
    }
    for robot in &robots {
        assert!(robot.sees_alive(n as usize - 1, PATIENCE).await, "{:?}", robot.robot.status());
    }
    robots
}

#[tokio::test(flavor = "multi_thread")]
async fn what_the_first_of_a_line_sees_the_last_decides() {
    let mut robots = line(4, |id| (id == 0).then_some(ClassId(3))).await;
    robots[3].robot.open_round();
    for robot in &mut robots {
        let decision = robot.decision(1, PATIENCE).await.expect("a decision");
        assert_eq!(decision.class, Some(ClassId(3)), "{decision:?}");
    }
    for robot in robots {
        robot.stop().await;
    }
}
