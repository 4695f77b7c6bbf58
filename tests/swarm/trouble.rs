//! Bad input and bad luck: each is refused, counted or repaired, and the swarm goes on.

use std::time::Duration;

use gestalt_link::{LinkConfig, LinkError, Robot, RobotConfig};
use gestalt_protocol::{ClassId, Keys, RobotId, Topic};
use gestalt_strategies::MindConfig;
use gestalt_tests::{config, start, unique};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde_json::json;

use crate::in_process::line;

const PATIENCE: Duration = Duration::from_secs(10);

#[tokio::test(flavor = "multi_thread")]
async fn random_bytes_on_every_key_are_refused_by_name_and_the_swarm_goes_on() {
    let swarm = unique("garbage");
    let mut first = start(config(0, &swarm, &[]), Some(ClassId(4))).await;
    let mut second = start(config(1, &swarm, first.robot.locators()), None).await;
    let mut zenoh = zenoh::Config::default();
    zenoh.insert_json5("mode", "\"client\"").unwrap();
    zenoh.insert_json5("connect/endpoints", &json!(first.robot.locators()).to_string()).unwrap();
    zenoh.insert_json5("scouting/multicast/enabled", "false").unwrap();
    let vandal = zenoh::open(zenoh).await.unwrap();
    assert!(first.sees_alive(1, PATIENCE).await && second.sees_alive(1, PATIENCE).await);
    let keys = Keys::new(&swarm).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for length in [0, 1, 2, 3, 10, 100, 1000, 100_000, 3_000_000] {
        for topic in [
            Topic::Vote(RobotId(9)),
            Topic::Vote(RobotId(0)),
            Topic::Sample(RobotId(9)),
            Topic::Repair(RobotId(0)),
            Topic::Repair(RobotId(1)),
            Topic::RobotDecision(RobotId(9)),
            Topic::Decision,
            Topic::Feedback("vandal".parse().unwrap()),
            Topic::Answer("vandal".parse().unwrap()),
        ] {
            let mut bytes = vec![0; length];
            rng.fill_bytes(&mut bytes);
            vandal.put(keys.key(&topic), bytes).await.unwrap();
        }
    }
    tokio::time::sleep(Duration::from_millis(500)).await;
    for robot in [&first, &second] {
        let status = robot.robot.status();
        for kind in ["vote", "sample", "repair", "robot_decision", "decision", "feedback", "answer"] {
            let refused =
                status.counters.iter().filter(|(name, _)| name.starts_with(&format!("refused_{kind}_")));
            assert!(refused.map(|(_, count)| count).sum::<u64>() >= 8, "{kind}: {:?}", status.counters);
        }
        assert!(!status.errors.is_empty() && status.errors.len() <= 16);
    }
    second.robot.open_round();
    for robot in [&mut first, &mut second] {
        assert_eq!(robot.decision(1, PATIENCE).await.expect("a decision").class, Some(ClassId(4)));
    }
    vandal.close().await.unwrap();
    first.stop().await;
    second.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_with_anothers_id_is_reported_and_the_swarm_goes_on() {
    let swarm = unique("twin");
    let first = start(config(0, &swarm, &[]), Some(ClassId(1))).await;
    let mut second = start(config(1, &swarm, first.robot.locators()), None).await;
    let twin = start(config(0, &swarm, second.robot.locators()), Some(ClassId(1))).await;
    tokio::time::sleep(Duration::from_secs(5)).await;
    second.robot.open_round();
    assert!(second.decision(1, PATIENCE).await.is_some());
    for robot in [&first, &twin] {
        let status = robot.robot.status();
        assert!(status.counters.contains_key("twin"), "{status:?}");
        assert!(status.errors.iter().any(|error| error.what.contains("give each its own")), "{status:?}");
    }
    for robot in [first, second, twin] {
        robot.stop().await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn an_occupied_port_is_an_error_that_names_it() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let endpoint = format!("tcp/{}", taken.local_addr().unwrap());
    let plain = config(0, &unique("port"), &[]);
    let link = LinkConfig { listen: vec![endpoint.clone()], ..plain.link };
    let error = Robot::start(RobotConfig { link, ..plain }).await.expect_err("the port is taken");
    assert!(matches!(error, LinkError::Start { .. }));
    assert!(error.to_string().contains(&endpoint), "{error}");
}

/// Denies votes and decisions, but not repair, to and from one robot.
fn black_hole() -> serde_json::Map<String, serde_json::Value> {
    let deny = json!({
        "id": "deaf", "messages": ["put"], "flows": ["egress", "ingress"], "permission": "deny",
        "key_exprs": ["gestalt/*/robot/*/vote", "gestalt/*/robot/*/decision", "gestalt/*/decision"],
    });
    let zenoh = json!({"access_control": {
        "enabled": true, "default_permission": "allow", "rules": [deny],
        "subjects": [{"id": "all"}], "policies": [{"rules": ["deaf"], "subjects": ["all"]}],
    }});
    zenoh.as_object().unwrap().clone()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_black_hole_in_the_routing_delays_and_loses_nothing() {
    let swarm = unique("hole");
    let mut robots = Vec::new();
    let mut before = Vec::new();
    for id in 0..4 {
        let plain = config(id, &swarm, &before);
        let zenoh = if id == 2 { black_hole() } else { serde_json::Map::new() };
        let link = LinkConfig { zenoh, ..plain.link.clone() };
        let robot = start(RobotConfig { link, ..plain }, (id == 0).then_some(ClassId(3))).await;
        before = robot.robot.locators().to_vec();
        robots.push(robot);
    }
    for robot in &robots {
        assert!(robot.sees_alive(3, PATIENCE).await);
    }
    let opened = std::time::Instant::now();
    robots[0].robot.open_round();
    for robot in &mut robots {
        assert_eq!(robot.decision(1, PATIENCE).await.expect("a decision").class, Some(ClassId(3)));
    }
    eprintln!("behind a black hole in a line of 4: all decided after {:?}", opened.elapsed());
    let deaf = robots[3].robot.status().counters;
    assert!(!deaf.contains_key("received_vote"), "the hole is none: {deaf:?}");
    for robot in robots {
        robot.stop().await;
    }
}

/// Bytes that robot has sent in votes, with 64 a message for the key and the framing, and in everything.
fn sent(robot: &Robot) -> (u64, u64) {
    let counters = robot.status().counters;
    let bytes = |prefix: &str| -> u64 {
        let of_it = counters.iter().filter(|(name, _)| name.starts_with(prefix));
        of_it.map(|(name, count)| if name.ends_with("_bytes") { *count } else { *count * 64 }).sum()
    };
    (bytes("sent_vote"), bytes("sent_"))
}

#[tokio::test(flavor = "multi_thread")]
async fn votes_cost_little_while_a_round_is_open_and_nothing_otherwise() {
    // They see nothing clear, so that the round stays open until its deadline.
    let robots = line(4, |_| None).await;
    let unclear = std::sync::Arc::new(gestalt_tests::Fixed::default());
    robots.iter().for_each(|robot| robot.robot.learned(unclear.clone(), "fixed"));
    tokio::time::sleep(Duration::from_secs(6)).await;
    let before: Vec<_> = robots.iter().map(|robot| sent(&robot.robot)).collect();
    let pause = Duration::from_secs(5);
    tokio::time::sleep(pause).await;
    let idle: Vec<_> = robots.iter().map(|robot| sent(&robot.robot)).collect();
    robots[0].robot.open_round();
    let open = MindConfig::default().deadline - Duration::from_millis(500);
    let until = std::time::Instant::now() + open;
    while std::time::Instant::now() < until {
        for robot in &robots {
            robot.robot.observe(gestalt_tests::look(ClassId(0), 0.17));
        }
        tokio::time::sleep(Duration::from_millis(33)).await;
    }
    for (i, robot) in robots.iter().enumerate() {
        assert!(robot.robot.status().open, "the round ended early");
        let rate = |after: u64, before: u64, time: Duration| (after - before) as f64 / time.as_secs_f64();
        let now = sent(&robot.robot);
        let votes = rate(now.0, idle[i].0, open);
        let repair = rate(now.1, idle[i].1, open) - votes;
        let at_rest = rate(idle[i].1, before[i].1, pause);
        eprintln!(
            "robot {i} sends {votes:.0} B/s of votes and {repair:.0} B/s of repair; {at_rest:.0} B/s at rest"
        );
        assert!(votes > 0.0 && votes <= 1000.0 && repair <= 1000.0);
        assert!(at_rest <= 100.0 && idle[i].0 == before[i].0);
    }
    for robot in robots {
        robot.stop().await;
    }
}
