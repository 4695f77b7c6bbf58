//! What a robot starts with when its memory is damaged, missing, or comes late.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{ClassId, Gesture, Instruction, RobotId, RoundId, Status};
use gestalt_strategies::{Mind, MindConfig, RecordChange};
use tokio::time::timeout;

use super::{PATIENCE, Watched, config, learning, start, swarm, unique};
use crate::apprentice::Prepared;
use crate::identity;
use crate::memory::Store;
use crate::memory::tests::faulty::Disk;
use crate::{Client, Event, LinkConfig, LinkError, Robot, RobotConfig, StoreError};

fn with_memory(name: &str, path: &Path) -> RobotConfig {
    RobotConfig { learning: Some(learning(Some(path.to_owned()))), ..config(1, name, &[]) }
}

/// Says which gesture a round showed, and waits until that is acknowledged.
async fn teach(watched: &Watched, name: &str, round: RoundId, class: u32) {
    let link = LinkConfig { connect: watched.robot.locators().to_vec(), ..LinkConfig::default() };
    let client = Client::open(name, &link).await.unwrap();
    let was = Instruction::Was { round, class: Gesture::Class(ClassId(class)) };
    let answer = client.teach(&"ada".parse().unwrap(), &was, PATIENCE).await.unwrap();
    assert!(answer.is_some(), "what is remembered is acknowledged");
    client.close().await;
}

fn samples(status: &gestalt_protocol::Status) -> usize {
    let all = |learning: &gestalt_protocol::LearningStatus| {
        [&learning.personal, &learning.shared, &learning.external].into_iter().flatten().sum()
    };
    status.learning.as_ref().map_or(0, all)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_damaged_or_foreign_memory_refuses_the_start() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("memory");
    fs::write(&path, "something else altogether").unwrap();
    let error = Robot::start(with_memory(&unique(), &path)).await.unwrap_err();
    assert!(matches!(error, LinkError::Memory(StoreError::Foreign(_))), "{error}");
    let name = unique();
    swarm(&name, 1, with_memory(&name, &folder.path().join("sound"))).await.pop().unwrap().stop().await;
    let mut bytes = fs::read(folder.path().join("sound")).unwrap();
    bytes.truncate(bytes.len() / 2);
    fs::write(&path, bytes).unwrap();
    let error = Robot::start(with_memory(&name, &path)).await.unwrap_err();
    assert!(matches!(error, LinkError::Memory(StoreError::Damaged { .. })), "{error}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_memory_that_comes_late_is_taken_up() {
    let folder = tempfile::tempdir().unwrap();
    let (name, disk) = (unique(), folder.path().join("disk"));
    fs::create_dir(&disk).unwrap();
    let mut robot = swarm(&name, 1, with_memory(&name, &disk.join("memory"))).await.pop().unwrap();
    let taught = robot.decide(0).await.round;
    teach(&robot, &name, taught, 1).await;
    let learned = samples(&robot.robot.status());
    assert!(learned > 0);
    robot.stop().await;
    // The disk is not mounted when the robot starts again.
    let unmounted = folder.path().join("unmounted");
    fs::rename(&disk, &unmounted).unwrap();
    let mut robot = swarm(&name, 1, with_memory(&name, &disk.join("memory"))).await.pop().unwrap();
    let failing = |status: &gestalt_protocol::Status| {
        let says =
            |learning: &gestalt_protocol::LearningStatus| learning.memory.contains("its folder is not there");
        status.learning.as_ref().is_some_and(says)
    };
    robot.status("it says so", failing).await;
    let decision = robot.decide(0).await;
    assert!(decision.class.is_some(), "it votes");
    let boot = robot.robot.status().boot;
    fs::rename(&unmounted, &disk).unwrap();
    robot.status("it is taken up", |status| status.counters.contains_key("memory_taken_up")).await;
    robot.status("what it knew is back", |status| samples(status) >= learned).await;
    assert!(robot.robot.status().boot > boot, "what it said meanwhile was said under another number");
    // And what it hears now is remembered: a correction of what it was taught before.
    teach(&robot, &name, taught, 0).await;
    timeout(PATIENCE, robot.stop()).await.expect("it stops");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_memory_that_can_be_read_and_not_written_is_known_and_no_start_has_a_number_twice() {
    const AHEAD: u32 = 1 << 31;
    let me = RobotId(1);
    let folder = tempfile::tempdir().unwrap();
    let (name, path) = (unique(), folder.path().join("memory"));
    let mut robot = swarm(&name, 1, with_memory(&name, &path)).await.pop().unwrap();
    let taught = robot.decide(0).await.round;
    teach(&robot, &name, taught, 1).await;
    let learned = samples(&robot.robot.status());
    assert!(learned > 0);
    robot.stop().await;
    let mut numbers = BTreeSet::new();
    for full in [true, false, true, false] {
        let disk = Disk::holding(fs::read(&path).unwrap());
        drop(Store::open(Arc::new(disk.clone()), me, AHEAD).unwrap());
        disk.fill(full);
        disk.lock_up(!full);
        let mut prepared = Prepared::with_nothing(1, learning(Some(path.clone())));
        prepared.open_at(Arc::new(disk), me).unwrap();
        numbers.insert(prepared.boot);
        let life = identity::life(prepared.boot, 1);
        let mind = prepared.bring_up(Mind::new(me, life, MindConfig::default()).unwrap()).unwrap();
        let status = Status { learning: mind.learned(), ..Status::new(me, name.clone(), 1) };
        assert!(samples(&status) >= learned, "{status:?}");
    }
    assert!(numbers.len() == 4 && numbers.first() > Some(&AHEAD), "{numbers:?}");
}

#[test]
fn a_start_that_the_memory_refuses_does_not_count() {
    let me = RobotId(1);
    let disk = Disk::default();
    let store = Store::open(Arc::new(disk.clone()), me, 5).unwrap().0;
    store.write(&[RecordChange { key: vec![200], value: Some(vec![1; 40]) }], None).unwrap();
    drop(store);
    let mut prepared = Prepared::with_nothing(1, learning(Some("memory".into())));
    let error = prepared.open_at(Arc::new(disk.clone()), me).unwrap_err();
    assert!(matches!(error, StoreError::Damaged { .. }), "{error}");
    assert_eq!(Store::look(Arc::new(disk), me).unwrap().0.boot(), 5);
}

/// Nothing was taught, so nothing is remembered but that it was there.
#[tokio::test(flavor = "multi_thread")]
async fn who_has_started_again_counts_for_no_gesture_of_a_round_that_it_hears_of_soon() {
    let folder = tempfile::tempdir().unwrap();
    let (name, path) = (unique(), folder.path().join("memory"));
    for is_final in [true, false] {
        let first = start(with_memory(&name, &path)).await;
        let other = config(2, &name, first.robot.locators());
        // It says so when the time of the round is over; the first one may have been in one before for longer than this takes.
        let times = MindConfig {
            patience: Duration::from_secs(1),
            deadline: Duration::from_secs(8),
            ..other.mind.clone()
        };
        let mut second = start(RobotConfig { mind: times, ..other }).await;
        for robot in [&first, &second] {
            robot.status("both are alive", |status| status.alive.len() == 2).await;
        }
        second.robot.open_round();
        let said = |event: &Event| match event {
            Event::Announced(announcement) => Some(announcement.decision.is_final),
            _ => None,
        };
        assert_eq!(second.event("announced", said).await, is_final, "both are a majority");
        first.stop().await;
        second.stop().await;
    }
}
