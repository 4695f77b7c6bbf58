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

const PATIENCE: Duration = Duration::from_secs(10);

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

/// How many samples a status says are held.
fn held(status: &Value) -> u64 {
    let of = |part: &str| {
        status["learning"][part].as_array().map_or(0, |n| n.iter().filter_map(Value::as_u64).sum())
    };
    of("personal") + of("shared") + of("external")
}

/// The status as told last before a position.
fn last_status(told: &[Value]) -> Option<&Value> {
    told.iter().rev().find(|told| told["event"] == "status").map(|told| &told["status"])
}

#[tokio::test(flavor = "multi_thread")]
async fn killed_at_any_moment_it_remembers_and_shares_nothing_twice() {
    let lives = if std::env::var_os("GESTALT_LONG").is_some() { 100 } else { 15 };
    let folder = tempfile::tempdir().unwrap();
    let memory = folder.path().join("robot.memory");
    let swarm = unique("memory");
    let ada: InstructorId = "ada".parse().unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let (mut boots, mut shared) = (Vec::new(), Vec::<(u64, u64)>::new());
    // By round, how many samples of it were acknowledged.
    let mut answered = BTreeMap::<String, u64>::new();
    for life in 0..lives {
        let mut robot = robot(&swarm, &memory);
        let locator = locator(&robot);
        robot.order("status");
        let status =
            robot.wait(PATIENCE, |told| last_status(told).filter(|s| s["learning"].is_object()).cloned());
        let status = status.expect("the memory opens, and it tells what it has");
        let acknowledged: u64 = answered.values().sum();
        assert!(held(&status) >= acknowledged, "life {life}: {} of {acknowledged} samples", held(&status));
        boots.push(status["boot"].as_u64().expect("a boot number"));
        let link = LinkConfig { connect: vec![locator], ..LinkConfig::default() };
        let client = Client::open(&swarm, &link).await.unwrap();
        let death = Instant::now() + Duration::from_millis(100 + u64::from(rng.next_u32() % 2500));
        let teach = async {
            for class in 0..6 {
                robot.order(&format!("shown {class}"));
                client.instruct(&ada, &Instruction::Open).await.unwrap();
                let news = client.news().await.unwrap();
                while news.newest().is_none() {
                    tokio::time::sleep(Duration::from_millis(10)).await;
                }
                let Some(last) = client.last_decision(Duration::from_millis(300)).await.unwrap() else {
                    continue;
                };
                let was =
                    Instruction::Was { round: last.decision.round, class: Gesture::Class(ClassId(class)) };
                let _ = client.teach(&ada, &was, Duration::from_secs(2)).await;
            }
        };
        let _ = tokio::time::timeout_at(death.into(), teach).await;
        robot.kill();
        // All it said before its death has been read when the pipe is empty.
        tokio::time::sleep(Duration::from_millis(100)).await;
        for told in robot.told() {
            match told["event"].as_str() {
                Some("answered") => {
                    let samples = told["answer"]["samples"].as_u64().unwrap_or(0);
                    answered.insert(told["answer"]["to"]["round"].to_string(), samples);
                }
                Some("shared") => shared.extend(
                    told["samples"]
                        .as_array()
                        .into_iter()
                        .flatten()
                        .map(|id| (id["author"].as_u64().unwrap(), id["number"].as_u64().unwrap())),
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
    robot.order("status");
    let status =
        robot.wait(PATIENCE, |told| last_status(told).filter(|s| s["learning"].is_object()).cloned());
    let acknowledged: u64 = answered.values().sum();
    eprintln!(
        "{lives} lives, {acknowledged} samples acknowledged, {} held, {} shared, each once",
        held(&status.unwrap()),
        shared.len()
    );
}

/// A file system of two megabytes; `None` where this process may not make one.
struct SmallDisk(tempfile::TempDir);

impl SmallDisk {
    fn new() -> Option<Self> {
        let folder = tempfile::tempdir().ok()?;
        let mount =
            Command::new("mount").args(["-t", "tmpfs", "-o", "size=4m", "tmpfs"]).arg(folder.path()).output();
        mount.is_ok_and(|done| done.status.success()).then_some(Self(folder))
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        // Left mounted it would stay until the machine restarts, which is no reason to panic.
        let _ = Command::new("umount").arg("-l").arg(self.0.path()).status();
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_full_disk_is_reported_and_the_robot_votes_on_and_recovers() {
    let Some(disk) = SmallDisk::new() else {
        return eprintln!("skipped: this process may not mount a small disk");
    };
    let swarm = unique("full");
    let mut robot = robot(&swarm, &disk.0.path().join("robot.memory"));
    let link = LinkConfig { connect: vec![locator(&robot)], ..LinkConfig::default() };
    let client = Client::open(&swarm, &link).await.unwrap();
    let junk = disk.0.path().join("junk");
    std::fs::write(&junk, vec![0_u8; 8 << 20]).expect_err("the disk is full");
    let ada: InstructorId = "ada".parse().unwrap();
    let mut outcomes = BTreeMap::new();
    for class in 0..4 {
        robot.order(&format!("shown {class}"));
        let mut news = client.news().await.unwrap();
        client.instruct(&ada, &Instruction::Open).await.unwrap();
        let decided =
            tokio::time::timeout(PATIENCE, news.decision_after(None)).await.expect("it votes on").unwrap();
        let was = Instruction::Was { round: decided.decision.round, class: Gesture::Class(ClassId(class)) };
        let answer = client.teach(&ada, &was, Duration::from_secs(3)).await.unwrap();
        outcomes.insert(class, answer.is_some());
        tokio::time::sleep(Duration::from_millis(500)).await;
    }
    let told = robot.told();
    let failing =
        |status: &Value| status["learning"]["memory"].as_str().is_some_and(|m| m.starts_with("failing"));
    robot.order("status");
    let status = robot.wait(PATIENCE, |told| last_status(told).filter(|status| failing(status)).cloned());
    let status = status.unwrap_or_else(|| panic!("the full disk is not reported: {:?} {told:#?}", outcomes));
    let errors = status["errors"].to_string();
    assert!(errors.contains("make room"), "{errors}");
    std::fs::remove_file(&junk).unwrap();
    let remembered = robot.wait(PATIENCE, |now| {
        let news = &now[told.len().min(now.len())..];
        news.iter().any(|told| told["event"] == "remembered").then_some(())
    });
    assert!(remembered.is_some(), "with room again, all is remembered");
    client.close().await;
}
