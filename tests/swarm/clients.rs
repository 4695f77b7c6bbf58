//! What a client hears, wherever it is attached.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use gestalt_link::{Client, Decisions, Event, LinkConfig};
use gestalt_protocol::{ClassId, Instruction};
use gestalt_strategies::MindConfig;
use gestalt_tests::{Process, Watched, config, start, unique};
use serde_json::{Value, json};
use tokio::time::timeout;

const PATIENCE: Duration = Duration::from_secs(30);

async fn attach(swarm: &str, locators: &[String]) -> Client {
    let link = LinkConfig { connect: locators.to_vec(), ..LinkConfig::default() };
    Client::open(swarm, &link).await.expect("a robot is there")
}

/// How often each round was announced, until nothing comes for a while.
async fn announced(decisions: &mut Decisions, quiet: Duration) -> BTreeMap<u32, u32> {
    let mut rounds = BTreeMap::new();
    while let Ok(Some(decision)) = timeout(quiet, decisions.next()).await {
        let decision = decision.expect("it is a decision");
        assert_eq!(decision.label.as_deref(), Some("2"));
        *rounds.entry(decision.decision.round.counter).or_default() += 1;
    }
    rounds
}

pub async fn a_client_hears_each_decision_once_and_can_ask_and_instruct() {
    let swarm = unique("client");
    let mut robots = Vec::new();
    let mut before = Vec::new();
    for id in 0..4 {
        let robot = start(config(id, &swarm, &before), (id == 1).then_some(ClassId(2))).await;
        before = robot.robot.locators().to_vec();
        robots.push(robot);
    }
    for robot in &robots {
        assert!(robot.sees_alive(3, PATIENCE).await);
    }
    let client = attach(&swarm, &before).await;
    let mut decisions = client.decisions().await.unwrap();
    tokio::time::sleep(Duration::from_millis(300)).await;
    for round in 1..=5 {
        client.instruct(&"ada".parse().unwrap(), &Instruction::Open).await.unwrap();
        for robot in &mut robots {
            assert!(robot.decision(round, PATIENCE).await.is_some(), "round {round}");
        }
        tokio::time::sleep(MindConfig::default().refractory * 2).await;
    }
    let heard = announced(&mut decisions, Duration::from_secs(3)).await;
    assert_eq!(heard, (1..=5).map(|round| (round, 1)).collect());
    let statuses = client.statuses(PATIENCE).await.unwrap();
    assert_eq!(statuses.iter().map(|status| status.robot.0).collect::<Vec<_>>(), [0, 1, 2, 3]);
    assert_eq!(statuses[1].model, "fixed");
    let last = client.last_decision(PATIENCE).await.unwrap().expect("somebody knows it");
    assert_eq!((last.decision.round.counter, last.decision.class), (5, Some(ClassId(2))));
    client.close().await;
    for robot in robots {
        robot.stop().await;
    }
}

pub async fn a_decision_is_announced_once_though_the_spokesrobot_is_killed() {
    let swarm = unique("spokesrobot");
    let first = start(config(1, &swarm, &[]), Some(ClassId(2))).await;
    let second = start(config(2, &swarm, first.robot.locators()), None).await;
    let client = attach(&swarm, second.robot.locators()).await;
    let mut decisions = client.decisions().await.unwrap();
    let mut robots = [first, second];
    let announcements = |robots: &[Watched; 2]| {
        let said = |robot: &Watched| robot.robot.status().counters.get("sent_decision").copied();
        [0, 1].map(|i| said(&robots[i]).unwrap_or_default())
    };
    for round in 1..=3 {
        // The smallest id: the one to speak for the swarm. It is stopped in mid-round, and dies without having spoken.
        let orders = json!({
            "id": 0, "boot": round, "swarm": swarm,
            "link": {"listen": ["tcp/127.0.0.1:0"], "connect": robots[0].robot.locators()},
        });
        let mut spokesrobot = Process::start(Path::new(env!("CARGO_BIN_EXE_test-robot")), None, &orders);
        for robot in &robots {
            assert!(robot.sees_alive(2, PATIENCE).await);
        }
        let before = announcements(&robots);
        robots[1].robot.open_round();
        let opened = |told: &[Value]| told.iter().any(|t| t["event"] == "opened").then_some(());
        spokesrobot.wait(PATIENCE, opened).expect("it takes part");
        spokesrobot.signal("STOP");
        let held =
            |event| matches!(event, Event::Held(decision) if decision.round.counter == round).then_some(());
        robots[0].wait(PATIENCE, held).await.expect("a decision");
        let spoken = spokesrobot.told_to_the_end().iter().any(|told| told["event"] == "announced");
        assert!(!spoken, "it spoke before it was stopped");
        let heard = announced(&mut decisions, Duration::from_secs(3)).await;
        assert_eq!(heard, BTreeMap::from([(round, 1)]), "announced once");
        let now = announcements(&robots);
        assert_eq!(
            [now[0] - before[0], now[1] - before[1]],
            [1, 0],
            "the next smallest id takes over, alone"
        );
    }
    client.close().await;
    for robot in robots {
        robot.stop().await;
    }
}
