//! Robots in one process, linked explicitly.

use std::time::Duration;

use gestalt_link::RobotConfig;
use gestalt_protocol::ClassId;
use gestalt_strategies::{MindConfig, Quorum};
use gestalt_tests::{Watched, agreed, config, start, unique};

const PATIENCE: Duration = Duration::from_secs(30);

/// Starts a line in which robot `i` dials `i - 1`. They decide when `quorum` of them have seen something.
pub async fn line(n: u32, quorum: u32, sees: impl Fn(u32) -> Option<ClassId>) -> Vec<Watched> {
    let swarm = unique("line");
    let mut robots: Vec<Watched> = Vec::new();
    for id in 0..n {
        let connect = robots.last().map(|before| before.robot.locators().to_vec()).unwrap_or_default();
        let mind = MindConfig { quorum: Quorum::Evidence(quorum), ..MindConfig::default() };
        robots.push(start(RobotConfig { mind, ..config(id, &swarm, &connect) }, sees(id)).await);
    }
    for robot in &robots {
        assert!(robot.sees_alive(n as usize - 1, PATIENCE).await, "{:?}", robot.robot.status());
    }
    robots
}

pub async fn what_the_first_two_of_a_line_see_the_last_decides() {
    let sees = |id| [Some(3), Some(3), Some(5), None][id as usize].map(ClassId);
    let mut robots = line(4, 2, sees).await;
    robots[3].robot.open_round();
    let decision = agreed(&mut robots, 1, PATIENCE).await;
    assert_eq!(decision.class, Some(ClassId(3)), "{decision:?}");
    for robot in robots {
        robot.stop().await;
    }
}

pub async fn twenty_robots_agree_in_each_of_twenty_rounds() {
    // Two of the seven who see are mistaken. Any four of the seven are enough, and never for the wrong gesture.
    let sees = |id| match id {
        0 | 4 | 8 | 12 | 16 => Some(ClassId(2)),
        3 | 10 => Some(ClassId(4)),
        _ => None,
    };
    let mut robots = line(20, 4, sees).await;
    let mut outvoted = 0;
    for round in 1..=20 {
        robots[round as usize % 20].robot.open_round();
        let decision = agreed(&mut robots, round, PATIENCE).await;
        assert_eq!((decision.round.counter, decision.class), (round, Some(ClassId(2))), "{decision:?}");
        outvoted += usize::from(decision.certificate.votes.iter().any(|vote| vote.class == ClassId(4)));
        // A round may be opened only some time after the one before.
        tokio::time::sleep(MindConfig::default().refractory).await;
    }
    assert!(outvoted > 0, "nobody disagreed in any round");
    for robot in robots {
        robot.stop().await;
    }
}
