//! Bad input and bad luck: each is refused, counted or repaired, and the swarm goes on.

use std::time::Duration;

use gestalt_link::{LinkConfig, LinkError, Robot, RobotConfig};
use gestalt_protocol::{
    Announcement, Certificate, ClassId, CountedVote, Decision, Envelope, FusionRule, Give, Keys, Message,
    RobotId, RoundId, Stamp, Terms, Topic, Vote,
};
use gestalt_strategies::{Classify, MindConfig, Quorum};
use gestalt_tests::{Fixed, Watched, agreed, config, start, unique};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde_json::json;
use zenoh::qos::CongestionControl;

use crate::in_process::line;

const PATIENCE: Duration = Duration::from_secs(30);

/// A plain Zenoh client.
pub async fn attach(locators: &[String]) -> zenoh::Session {
    let mut zenoh = zenoh::Config::default();
    zenoh.insert_json5("mode", "\"client\"").unwrap();
    zenoh.insert_json5("connect/endpoints", &json!(locators).to_string()).unwrap();
    zenoh.insert_json5("scouting/multicast/enabled", "false").unwrap();
    zenoh::open(zenoh).await.unwrap()
}

/// Waits until the robot's counters that begin like this come to so many.
pub async fn counted(robot: &Watched, prefix: &str, wanted: u64) {
    let deadline = tokio::time::Instant::now() + PATIENCE;
    loop {
        let counters = robot.robot.status().counters;
        let of_it = counters.iter().filter(|(name, _)| name.starts_with(prefix));
        if of_it.map(|(_, count)| count).sum::<u64>() >= wanted {
            return;
        }
        assert!(tokio::time::Instant::now() < deadline, "{wanted} of {prefix}: {counters:?}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

pub async fn random_bytes_on_every_key_are_refused_by_name_and_the_swarm_goes_on() {
    let swarm = unique("garbage");
    let mut first = start(config(0, &swarm, &[]), Some(ClassId(4))).await;
    let mut second = start(config(1, &swarm, first.robot.locators()), None).await;
    let vandal = attach(first.robot.locators()).await;
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
            Topic::Question,
            Topic::Feedback("vandal".parse().unwrap()),
            Topic::Answer("vandal".parse().unwrap()),
        ] {
            let mut bytes = vec![0; length];
            rng.fill_bytes(&mut bytes);
            let put = vandal.put(keys.key(&topic), bytes).congestion_control(CongestionControl::Block);
            put.await.unwrap();
        }
    }
    for robot in [&first, &second] {
        for kind in
            ["vote", "sample", "repair", "robot_decision", "decision", "question", "feedback", "answer"]
        {
            counted(robot, &format!("refused_{kind}_"), 8).await;
        }
        let status = robot.robot.status();
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

/// A decision that follows from nothing: its fields are in range, its certificate names votes that nobody cast.
pub fn invented(round: RoundId, author: RobotId, class: u8, robots: u32) -> Decision {
    let vocabulary = Fixed::default().vocabulary().id();
    let mut evidence = vec![-1.0; 6];
    evidence[usize::from(class)] = 5.0;
    let vote = |robot| CountedVote {
        robot: RobotId(robot),
        stamp: Stamp { boot: 1, sequence: 1 },
        class: ClassId(class.into()),
        weight: 1.0,
        vote: Vote {
            round,
            vocabulary,
            evidence: evidence.clone(),
            looks: 1.0,
            unknown: None,
            named: vec![],
        },
        signature: None,
    };
    let mut probabilities = vec![0.002; 6];
    probabilities[usize::from(class)] = 0.99;
    Decision {
        round,
        class: Some(ClassId(class.into())),
        confidence: 0.99,
        author,
        is_final: false,
        certificate: Certificate {
            vocabulary,
            rule: FusionRule::LogPool,
            pool: None,
            probabilities,
            unknown: None,
            votes: (0..robots).map(vote).collect(),
            others: Vec::new(),
            robots,
            quorum: 1,
            elapsed_ms: 1,
            named: vec![],
            terms: Terms::default(),
        },
    }
}

/// What an unsigned announcement of it is.
pub fn announcing(announcer: RobotId, decision: Decision) -> Announcement {
    let stamp = Stamp { boot: u32::MAX, sequence: 1 };
    Announcement { decision, label: None, announcer, stamp, signature: None }
}

pub async fn well_formed_lies_are_refused_and_the_swarm_goes_on() {
    let swarm = unique("lies");
    let mut robots = vec![start(config(0, &swarm, &[]), Some(ClassId(4))).await];
    let locators = robots[0].robot.locators().to_vec();
    robots.push(start(config(1, &swarm, &locators), None).await);
    assert!(robots[0].sees_alive(1, PATIENCE).await && robots[1].sees_alive(1, PATIENCE).await);
    // They know of a round, and so which one can be next.
    robots[0].robot.open_round();
    agreed(&mut robots, 1, PATIENCE).await;
    let liar = attach(&locators).await;
    let keys = Keys::new(&swarm).unwrap();
    let (nine, round) = (RobotId(9), RoundId { counter: 2, opener: RobotId(0), life: 0 });
    let vocabulary = Fixed::default().vocabulary().id();
    let vote = |evidence: Vec<f32>| {
        Message::Vote(Vote { round, vocabulary, evidence, looks: 1.0, unknown: None, named: vec![] })
    };
    let say = async |topic: Topic, author, message| {
        let stamp = Stamp { boot: 1, sequence: 1 };
        liar.put(keys.key(&topic), Envelope { author, stamp, message, signature: None }.encode())
            .await
            .unwrap();
    };
    // What cannot be, what is somebody else's to say, and what belongs elsewhere.
    let cases = [
        ("refused_vote_", Topic::Vote(nine), nine, vote(vec![f32::NAN; 6])),
        ("refused_vote_", Topic::Vote(nine), nine, vote(vec![f32::INFINITY, 0.0, 0.0, 0.0, 0.0, 0.0])),
        ("refused_vote_", Topic::Vote(RobotId(8)), nine, vote(vec![0.0; 6])),
        (
            "refused_vote_",
            Topic::Vote(nine),
            nine,
            Message::Give(Give { decision: None, votes: vec![], holders: vec![] }),
        ),
        ("refused_robot_decision_", Topic::RobotDecision(nine), nine, vote(vec![0.0; 6])),
        (
            "refused_robot_decision_",
            Topic::RobotDecision(RobotId(8)),
            nine,
            Message::Holding(invented(round, nine, 2, 3).holding(false)),
        ),
        ("refused_sample_", Topic::Sample(nine), nine, vote(vec![0.0; 6])),
        ("refused_repair_", Topic::Repair(RobotId(0)), nine, vote(vec![0.0; 6])),
    ];
    for (n, (counter, topic, author, message)) in cases.into_iter().enumerate() {
        let before = refusals(&robots[0]);
        say(topic, author, message).await;
        counted(&robots[0], "refused_", before + 1).await;
        counted(&robots[0], counter, 1).await;
        eprintln!("lie {n} is counted as {counter}…");
    }
    // A round that nobody can have come to yet: who believed it would refuse all that follow.
    let before = refusals(&robots[0]);
    let far = RoundId { counter: u32::MAX, ..round };
    let ahead =
        Vote { round: far, vocabulary, evidence: vec![0.0; 6], looks: 1.0, unknown: None, named: vec![] };
    say(Topic::Vote(nine), nine, Message::Vote(ahead)).await;
    counted(&robots[0], "refused_", before + 1).await;
    // Decisions that cannot be.
    let sound = invented(round, nine, 2, 3);
    let mut certain = sound.clone();
    certain.confidence = 1.5;
    let mut twice = sound.clone();
    twice.certificate.votes[1] = twice.certificate.votes[0].clone();
    let mut beyond = sound.clone();
    beyond.class = Some(ClassId(200));
    for lie in [certain, twice, beyond] {
        let before = refusals(&robots[0]);
        let json = serde_json::to_string(&announcing(nine, lie)).unwrap();
        liar.put(keys.key(&Topic::Decision), json).await.unwrap();
        counted(&robots[0], "refused_", before + 1).await;
    }
    robots[1].robot.open_round();
    let decision = agreed(&mut robots, 2, PATIENCE).await;
    assert_eq!((decision.round.counter, decision.class), (2, Some(ClassId(4))), "{decision:?}");
    assert!(decision.certificate.votes.iter().all(|vote| vote.robot != nine), "{decision:?}");
    liar.close().await.unwrap();
    for robot in robots {
        robot.stop().await;
    }
}

fn refusals(robot: &Watched) -> u64 {
    let counters = robot.robot.status().counters;
    counters.iter().filter(|(name, _)| name.starts_with("refused_")).map(|(_, count)| count).sum()
}

pub async fn a_robot_with_anothers_id_is_reported_and_the_swarm_goes_on() {
    let swarm = unique("twin");
    let first = start(config(0, &swarm, &[]), Some(ClassId(1))).await;
    let mut second = start(config(1, &swarm, first.robot.locators()), None).await;
    let twin = start(config(0, &swarm, second.robot.locators()), Some(ClassId(1))).await;
    for robot in [&first, &twin] {
        counted(robot, "twin", 1).await;
    }
    second.robot.open_round();
    assert!(second.decision(1, PATIENCE).await.is_some());
    for robot in [&first, &twin] {
        let status = robot.robot.status();
        assert!(status.errors.iter().any(|error| error.what.contains("give each its own")), "{status:?}");
    }
    for robot in [first, second, twin] {
        robot.stop().await;
    }
}

pub async fn an_occupied_port_is_an_error_that_names_it() {
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

pub async fn a_black_hole_in_the_routing_delays_and_loses_nothing() {
    let swarm = unique("hole");
    let mut robots = Vec::new();
    let mut before = Vec::new();
    for (id, sees) in (0..).zip([Some(3), Some(3), None, Some(1)]) {
        let plain = config(id, &swarm, &before);
        let zenoh = if id == 2 { black_hole() } else { serde_json::Map::new() };
        let link = LinkConfig { zenoh, ..plain.link.clone() };
        let mind = MindConfig { quorum: Quorum::Evidence(2), ..MindConfig::default() };
        let robot = start(RobotConfig { link, mind, ..plain }, sees.map(ClassId)).await;
        before = robot.robot.locators().to_vec();
        robots.push(robot);
    }
    for robot in &robots {
        assert!(robot.sees_alive(3, PATIENCE).await);
    }
    let opened = std::time::Instant::now();
    robots[0].robot.open_round();
    let decision = agreed(&mut robots, 1, PATIENCE).await;
    assert_eq!(decision.class, Some(ClassId(3)), "{decision:?}");
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

pub async fn votes_cost_little_while_a_round_is_open_and_nothing_otherwise() {
    // They see nothing clear, so that the round stays open until its deadline.
    let robots = line(4, 1, |_| None).await;
    let unclear = std::sync::Arc::new(Fixed::default());
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
