//! Who was convicted counts no more, also after those who know were killed and nobody else is there who could tell them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use gestalt_link::{Bearer, Certificate, Credentials, LinkConfig, Robot, RobotConfig, Seal, fresh_nonce};
use gestalt_protocol::{Envelope, Keys, Message, RobotId, RoundId, Stamp, Topic, VocabularyId, Vote};
use gestalt_strategies::MindConfig;
use gestalt_trust::{Identity, Instructor, Membership, Roles, statement};
use zenoh::qos::CongestionControl;

const PATIENCE: Duration = Duration::from_secs(30);

/// The number of the authority's key.
const AUTHORITY: u32 = 1000;

/// The number of the key of a client that may listen and nothing else.
const EVE: u32 = 666;

fn key(id: u32) -> Identity {
    let mut secret = [7; 32];
    secret[..4].copy_from_slice(&id.to_le_bytes());
    Identity::from_bytes(&secret)
}

/// Robots 0 to 3, and eve.
fn members() -> Membership {
    let eve = Instructor { key: key(EVE).public_key(), roles: Roles::NONE };
    Membership {
        swarm: format!("convicted-{}", std::process::id()),
        epoch: 1,
        robots: (0..4).map(|id| (RobotId(id), key(id).public_key())).collect(),
        instructors: BTreeMap::from([("eve".parse().unwrap(), eve)]),
        ..Membership::default()
    }
}

/// Where a robot keeps its roster: each in a folder of its own.
fn roster_file(folder: &Path, id: u32) -> PathBuf {
    let of_robot = folder.join(id.to_string());
    std::fs::create_dir_all(&of_robot).unwrap();
    of_robot.join("roster.json")
}

async fn start(id: u32, members: &Membership, folder: &Path, connect: &[String]) -> Robot {
    let roster = members.clone().sign(&key(AUTHORITY)).unwrap();
    let seal = Seal::issue(&key(AUTHORITY), roster, RobotId(id), Arc::new(key(id))).unwrap();
    let config = RobotConfig {
        id: RobotId(id),
        name: format!("robot {id}"),
        boot: 1,
        swarm: members.swarm.clone(),
        mind: MindConfig::default(),
        fusion: None,
        link: LinkConfig {
            listen: vec!["tls/127.0.0.1:0".to_owned()],
            connect: connect.to_vec(),
            ..LinkConfig::default()
        },
        vocabulary: None,
        learning: None,
        nonce: fresh_nonce(),
        seal: Some(Seal { roster_file: Some(roster_file(folder, id)), ..seal }),
    };
    Robot::start(config).await.unwrap()
}

/// A Zenoh client that is let in, as eve, and then says what it likes.
async fn enter(members: &Membership, locators: &[String]) -> zenoh::Session {
    let (roster, swarm) = (members.clone().sign(&key(AUTHORITY)).unwrap(), &members.swarm);
    let holder = Bearer::Client("eve".parse().unwrap());
    let certificate =
        Certificate::issue(&key(AUTHORITY), swarm, holder.clone(), &key(EVE).public_key()).unwrap();
    let tls = Credentials::new(&roster, holder, Arc::new(key(EVE)), certificate).unwrap().tls();
    let mut config = zenoh::Config::default();
    config.insert_json5("mode", "\"client\"").unwrap();
    config.insert_json5("connect/endpoints", &serde_json::json!(locators).to_string()).unwrap();
    config.insert_json5("scouting/multicast/enabled", "false").unwrap();
    config.insert_json5("transport/link/tls", &tls.to_string()).unwrap();
    zenoh::open(config).await.unwrap()
}

/// A vote of robot 3, its only one under that stamp that is true.
fn vote(members: &Membership, looks: f32) -> Vec<u8> {
    let round = RoundId { counter: 1, opener: RobotId(3), life: 7 };
    let (vocabulary, evidence) = (VocabularyId(9), vec![1.0, -1.0]);
    let vote = Vote { round, vocabulary, evidence, looks, unknown: None, named: vec![] };
    let stamp = Stamp { boot: 1, sequence: 1 };
    let said = Envelope { author: RobotId(3), stamp, message: Message::Vote(vote), signature: None };
    let swarm = members.clone().sign(&key(AUTHORITY)).unwrap().swarm_id();
    let signature = Some(statement::sign(&key(3), &swarm, &said.statement()));
    Envelope { signature, ..said }.encode()
}

fn convicts(robot: &Robot) -> bool {
    robot.status().counters.contains_key("convicted_3")
}

async fn comes_true(what: &str, is_true: impl Fn() -> bool) {
    let deadline = Instant::now() + PATIENCE;
    while !is_true() {
        assert!(Instant::now() < deadline, "{what}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn who_was_convicted_counts_no_more_after_its_judges_were_killed() {
    let (members, folder) = (members(), tempfile::tempdir().unwrap());
    let kept = |id| roster_file(folder.path(), id).with_file_name("convicted").join("robot-3.evidence");
    let first = start(0, &members, folder.path(), &[]).await;
    let locators = first.locators().to_vec();
    let robots = [first, start(1, &members, folder.path(), &locators).await];
    comes_true("they meet", || robots.iter().all(|robot| robot.status().alive.len() == 2)).await;

    let liar = enter(&members, &locators).await;
    let keys = Keys::new(&members.swarm).unwrap();
    // One word may come before the link carries any; the second thing said convicts, whenever.
    let deadline = Instant::now() + PATIENCE;
    while !robots.iter().all(convicts) {
        for looks in [1.0, 2.0] {
            let put = liar.put(keys.key(&Topic::Vote(RobotId(3))), vote(&members, looks));
            put.congestion_control(CongestionControl::Block).await.unwrap();
        }
        assert!(Instant::now() < deadline, "both find it out");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    liar.close().await.unwrap();
    comes_true("it is written", || (0..2).all(|id| kept(id).exists())).await;
    // Nothing is closed.
    drop(robots);

    for id in 0..2 {
        let alone = start(id, &members, folder.path(), &[]).await;
        assert!(convicts(&alone), "robot {id} knows who lied: {:?}", alone.status().counters);
        alone.stop().await;
    }
    // Who lost what it kept knows of nothing, until somebody tells it.
    std::fs::remove_file(kept(1)).unwrap();
    let lost = start(1, &members, folder.path(), &[]).await;
    assert!(!convicts(&lost));
    let knows = start(0, &members, folder.path(), lost.locators()).await;
    comes_true("it is told", || convicts(&lost)).await;
    comes_true("and keeps it", || kept(1).exists()).await;
    knows.stop().await;
    lost.stop().await;
}
