//! Robots that find each other by multicast.

use std::time::{Duration, Instant};

use gestalt_protocol::ClassId;
use gestalt_strategies::MindConfig;
use gestalt_tests::{Watched, config, in_crowd, processor_time, start, sums, unique};

/// Far above what any of this takes: who is not there by then is stuck.
const PATIENCE: Duration = Duration::from_secs(60);

async fn converged(robots: &[Watched], patience: Duration) -> bool {
    let deadline = Instant::now() + patience;
    for robot in robots {
        let left = deadline.saturating_duration_since(Instant::now());
        if !robot.sees_alive(robots.len() - 1, left).await {
            return false;
        }
    }
    true
}

pub async fn a_hundred_robots_in_hearing_keep_four_links_each_and_agree() {
    let swarm = unique("scouting");
    let began = Instant::now();
    // Ten see the gesture. Disagreement is for smaller swarms: a hundred sessions in one process deliver votes too slowly for a
    // quorum of theirs.
    let sees = |id: u32| id.is_multiple_of(10).then_some(ClassId(1));
    let starts = (0..100).map(|id| start(in_crowd(config(id, &swarm, &[])), sees(id)));
    let mut robots = Vec::new();
    for robot in starts {
        robots.push(robot.await);
    }
    let started = began.elapsed();
    let complete = converged(&robots, PATIENCE).await;
    eprintln!("100 robots by scouting: started in {started:?}, all know all after {:?}", began.elapsed());
    let known: Vec<usize> = robots.iter().map(|robot| robot.robot.status().alive.len()).collect();
    assert!(complete, "known: {known:?}; links: {:?}; {:?}", links(&robots), sums(&robots));

    let long = std::env::var_os("GESTALT_LONG").is_some();
    let rounds = if long { 10 } else { 4 };
    let mut slowest = Duration::ZERO;
    for round in 1..=rounds {
        let opened = Instant::now();
        robots[round as usize * 7 % 100].robot.open_round();
        // A hundred robots in one process settle on one certificate later than on the gesture: that is what smaller
        // swarms are asked for.
        for robot in &mut robots {
            let decision = robot.decision(round, PATIENCE).await;
            let decision = decision.unwrap_or_else(|| panic!("round {round}: {:?}", robot.robot.status()));
            assert_eq!((decision.round.counter, decision.class), (round, Some(ClassId(1))), "{decision:?}");
        }
        slowest = slowest.max(opened.elapsed());
        tokio::time::sleep(MindConfig::default().refractory).await;
    }
    eprintln!("100 robots by scouting: the slowest of {rounds} rounds took {slowest:?}; {:?}", sums(&robots));

    // Links beyond the fourth are given up one after the other.
    let deadline = Instant::now() + PATIENCE;
    while links(&robots).iter().any(|links| *links > 4) {
        assert!(Instant::now() < deadline, "{:?}", links(&robots));
        tokio::time::sleep(Duration::from_millis(200)).await;
    }
    let mean = links(&robots).iter().sum::<usize>() as f64 / 100.0;
    eprintln!("100 robots by scouting: {mean} links each");
    if long {
        tokio::time::sleep(Duration::from_secs(15)).await;
        let (before, since) = (processor_time(), Instant::now());
        tokio::time::sleep(Duration::from_secs(10)).await;
        let load = (processor_time() - before) / since.elapsed().as_secs_f64();
        eprintln!("100 robots by scouting: idle load {:.1} % of a core", load * 100.0);
    }
    for robot in robots {
        robot.stop().await;
    }
}

/// How many robots each is linked to.
fn links(robots: &[Watched]) -> Vec<usize> {
    robots.iter().map(|robot| robot.robot.status().neighbours.len()).collect()
}
