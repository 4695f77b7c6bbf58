//! Robots in one process, linked explicitly.

use std::time::{Duration, Instant};

use gestalt_protocol::ClassId;
use gestalt_strategies::MindConfig;
use gestalt_tests::{Watched, config, start, unique};

const PATIENCE: Duration = Duration::from_secs(10);

/// Starts a line in which robot `i` dials `i - 1`.
pub async fn line(n: u32, sees: impl Fn(u32) -> Option<ClassId>) -> Vec<Watched> {
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

#[tokio::test(flavor = "multi_thread")]
async fn twenty_robots_agree_in_each_of_fifty_rounds() {
    let mut robots = line(20, |id| (id % 4 == 0).then_some(ClassId(2))).await;
    let began = Instant::now();
    for round in 1..=50 {
        robots[round as usize % 20].robot.open_round();
        for robot in &mut robots {
            let decision = robot.decision(round, PATIENCE).await;
            let decision = decision.unwrap_or_else(|| panic!("round {round}: {:?}", robot.robot.status()));
            assert_eq!(decision.round.counter, round);
            assert_eq!(decision.class, Some(ClassId(2)), "{decision:?}");
        }
        // A round may be opened only some time after the one before.
        tokio::time::sleep(MindConfig::default().refractory).await;
    }
    eprintln!("20 robots in a line, 50 rounds: {:?} a round", began.elapsed() / 50);
    for robot in robots {
        robot.stop().await;
    }
}
