//! A robot killed at any moment has all that it had acknowledged, and shares nothing twice.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use gestalt_link::{Client, LinkConfig};
use gestalt_protocol::{ClassId, Gesture, Instruction, InstructorId};
use gestalt_tests::{Process, unique};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde_json::{Value, json};

const PATIENCE: Duration = Duration::from_secs(30);

fn robot(swarm: &str, memory: &Path) -> Process {
    let orders = json!({
        "id": 1,
        "swarm": swarm,
        "sees": 0,
        "learn": {"keep": 3, "share": 0.5, "memory": memory},
        "link": {"listen": ["tcp/127.0.0.1:0"], "connect": []},
    });
    Process::start(Path::new(env!("CARGO_BIN_EXE_test-robot")), None, &orders)
}

fn locator(robot: &Process) -> String {
    let started = |told: &[Value]| {
        let started = told.iter().find(|told| told["event"] == "started")?;
        Some(started["locators"][0].as_str()?.to_owned())
    };
    robot.wait(PATIENCE, started).expect("it listens")
}

/// How many samples of a class a status says are held.
fn held_of(status: &Value, class: usize) -> u64 {
    let of = |part: &str| status["learning"][part][class].as_u64().unwrap_or(0);
    of("personal") + of("shared") + of("external")
}

/// How many of all classes.
fn held(status: &Value) -> u64 {
    (0..6).map(|class| held_of(status, class)).sum()
}

/// What it answers to the question how it is, once it knows what it has learned.
fn asked(robot: &mut Process) -> Value {
    let before = robot.told().len();
    robot.order("status");
    let learned =
        |told: &[Value]| last_status(&told[before..]).filter(|s| s["learning"].is_object()).cloned();
    robot.wait(PATIENCE, learned).expect("the memory opens, and it tells what it has")
}

/// The status told last.
fn last_status(told: &[Value]) -> Option<&Value> {
    told.iter().rev().find(|told| told["event"] == "status").map(|told| &told["status"])
}

pub async fn killed_at_any_moment_it_remembers_and_shares_nothing_twice() {
    let lives = if std::env::var_os("GESTALT_LONG").is_some() { 100 } else { 15 };
    let folder = tempfile::tempdir().unwrap();
    let memory = folder.path().join("robot.memory");
    let swarm = unique("memory");
    let ada: InstructorId = "ada".parse().unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let (mut boots, mut shared) = (Vec::new(), Vec::<[u64; 3]>::new());
    // By round, as what it was learned and how many samples of it were acknowledged.
    let mut answered = BTreeMap::<String, (usize, u64)>::new();
    let acknowledged_of = |answered: &BTreeMap<String, (usize, u64)>, class| -> u64 {
        answered.values().filter(|(of, _)| *of == class).map(|(_, samples)| samples).sum()
    };
    for life in 0..lives {
        let mut robot = robot(&swarm, &memory);
        let locator = locator(&robot);
        let status = asked(&mut robot);
        for class in 0..6 {
            let (held, acknowledged) = (held_of(&status, class), acknowledged_of(&answered, class));
            assert!(held >= acknowledged, "life {life}: {held} of {acknowledged} samples of class {class}");
        }
        let before: BTreeSet<String> = answered.keys().cloned().collect();
        boots.push(status["boot"].as_u64().expect("a boot number"));
        let link = LinkConfig { connect: vec![locator], ..LinkConfig::default() };
        let client = Client::open(&swarm, &link).await.unwrap();
        let death = Instant::now() + Duration::from_millis(100 + u64::from(rng.next_u32() % 2500));
        let teach = async {
            let mut taught = None;
            // Other gestures than in the life before, in another order.
            for showing in 0..6 {
                let class = ((showing * 5 + life) % 6) as u8;
                robot.order(&format!("shown {class}"));
                client.instruct(&ada, &Instruction::Open).await.unwrap();
                let news = client.news().await.unwrap();
                while news.newest().is_none() {
                    tokio::time::sleep(Duration::from_millis(10)).await;
                }
                let Some(last) = client.last_decision(Duration::from_millis(300)).await.unwrap() else {
                    continue;
                };
                // A second word on a round may hold without being acknowledged when the robot dies.
                if taught.replace(last.decision.round) == Some(last.decision.round) {
                    continue;
                }
                let was = Instruction::Was {
                    round: last.decision.round,
                    class: Gesture::Class(ClassId(class.into())),
                };
                let _ = client.teach(&ada, &was, Duration::from_secs(2)).await;
            }
        };
        let _ = tokio::time::timeout_at(death.into(), teach).await;
        for told in robot.told_to_the_end() {
            match told["event"].as_str() {
                Some("answered") => {
                    let answer = &told["answer"];
                    let round = answer["to"]["round"].to_string();
                    assert!(!before.contains(&round), "life {life}: {round} is an earlier showing's name");
                    let class = answer["to"]["class"].as_u64().expect("what it was") as usize;
                    answered.insert(round, (class, answer["samples"].as_u64().unwrap_or(0)));
                }
                Some("shared") => shared.extend(
                    told["samples"]
                        .as_array()
                        .into_iter()
                        .flatten()
                        .map(|id| ["author", "life", "number"].map(|part| id[part].as_u64().unwrap())),
                ),
                _ => {}
            }
        }
        drop(robot);
        client.close().await;
    }
    assert!(boots.windows(2).all(|pair| pair[0] < pair[1]), "every start is counted: {boots:?}");
    let distinct: BTreeSet<_> = shared.iter().copied().collect();
    assert_eq!(distinct.len(), shared.len(), "a sample was shared twice");
    assert!(shared.len() > lives / 4, "it hardly learned: {} samples shared in {lives} lives", shared.len());
    let mut robot = robot(&swarm, &memory);
    let status = asked(&mut robot);
    let held = held(&status);
    let acknowledged: u64 = answered.values().map(|(_, samples)| samples).sum();
    eprintln!(
        "{lives} lives, {acknowledged} samples acknowledged, {held} held, {} shared, each once",
        shared.len()
    );
    for class in 0..6 {
        let (held, acknowledged) = (held_of(&status, class), acknowledged_of(&answered, class));
        assert!(
            held >= acknowledged,
            "after the last life: {held} of {acknowledged} samples of class {class}"
        );
    }
    assert!(held >= shared.len() as u64, "after the last life: {held} samples, and {} shared", shared.len());
}

/// A file system of four megabytes.
pub struct SmallDisk(pub tempfile::TempDir);

impl SmallDisk {
    pub fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut mount = Command::new("mount");
        let mount = mount.args(["-t", "tmpfs", "-o", "size=4m", "tmpfs"]).arg(folder.path()).status();
        assert!(mount.unwrap().success(), "the file system is mounted");
        Self(folder)
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        // Left mounted it would stay until the machine restarts, which is no reason to panic.
        let _ = Command::new("umount").arg("-l").arg(self.0.path()).status();
    }
}

pub async fn a_full_disk_is_reported_and_the_robot_votes_on_and_recovers() {
    let disk = SmallDisk::new();
    let swarm = unique("full");
    let memory = disk.0.path().join("robot.memory");
    let mut robot = robot(&swarm, &memory);
    let began = Instant::now();
    let link = LinkConfig { connect: vec![locator(&robot)], ..LinkConfig::default() };
    let client = Client::open(&swarm, &link).await.unwrap();
    let junk = disk.0.path().join("junk");
    std::fs::write(&junk, vec![0_u8; 8 << 20]).expect_err("the disk is full");
    let ada: InstructorId = "ada".parse().unwrap();
    for class in 0..4 {
        robot.order(&format!("shown {class}"));
        let mut news = client.news().await.unwrap();
        client.instruct(&ada, &Instruction::Open).await.unwrap();
        let decided =
            tokio::time::timeout(PATIENCE, news.decision_after(None)).await.expect("it votes on").unwrap();
        let was = Instruction::Was { round: decided.decision.round, class: Gesture::Class(ClassId(class)) };
        // Nothing is acknowledged that could not be remembered, so there may be no answer.
        let _ = client.teach(&ada, &was, Duration::from_secs(3)).await.unwrap();
        // A request to open a round right after the last one counts as a copy of that one's.
        tokio::time::sleep(Duration::from_millis(500)).await;
    }
    let status = loop {
        let status = asked(&mut robot);
        if status["learning"]["memory"].as_str().is_some_and(|memory| memory.starts_with("failing")) {
            break status;
        }
        assert!(began.elapsed() < 4 * PATIENCE, "the full disk is not reported: {status:#}");
        tokio::time::sleep(Duration::from_millis(100)).await;
    };
    let errors = status["errors"].to_string();
    assert!(errors.contains("make room"), "{errors}");
    let taught = held(&status);
    assert!(taught >= 12, "three samples of each of four rounds are learned, disk or not: {taught}");
    let before = robot.told().len();
    std::fs::remove_file(&junk).unwrap();
    let remembered = |now: &[Value]| now[before..].iter().any(|t| t["event"] == "remembered").then_some(());
    assert!(robot.wait(PATIENCE, remembered).is_some(), "with room again, all is remembered");
    while asked(&mut robot)["learning"]["memory"].as_str().is_some_and(|memory| memory.starts_with("failing"))
    {
        assert!(began.elapsed() < 5 * PATIENCE, "it goes on saying that the disk is full");
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    client.close().await;
    // Killed and started again, it knows all that it was taught while there was no room.
    robot.kill();
    let mut again = self::robot(&swarm, &memory);
    let status = asked(&mut again);
    assert_eq!(held(&status), taught, "{status:#}");
}
