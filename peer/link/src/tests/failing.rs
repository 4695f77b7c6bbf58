//! Each part of a running robot is made to fail: that is told, the part is back or the robot has ended, and nobody else
//! waits for it.

use std::sync::Arc;
use std::time::{Duration, Instant};

use gestalt_strategies::{Classify, Observation};
use tokio::time::timeout;

use super::{Fixed, PATIENCE, Watched, config, learning, swarm, unique};
use crate::{Event, GuestConfig, Part};

/// Makes a part fail, and waits until status and events name it.
async fn fail(watched: &mut Watched, part: Part) {
    watched.robot.make_fail(part);
    told(watched, part).await;
}

async fn told(watched: &mut Watched, part: Part) {
    let named = |event: &Event| match event {
        Event::Failed { part: failed, cause } if *failed == part => Some(cause.clone()),
        _ => None,
    };
    let cause = watched.event(part.name(), named).await;
    assert!(!cause.is_empty());
    let status = watched.robot.status();
    assert!(status.counters[&format!("failed_{part}")] >= 1);
    assert!(
        status.errors.iter().any(|error| error.what.starts_with(&format!("{part} failed: "))),
        "{status:#?}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_part_that_can_begin_anew_does_and_the_robot_votes_on() {
    let name = unique();
    let folder = tempfile::tempdir().unwrap();
    let learns = Some(learning(Some(folder.path().join("memory"))));
    let mut robots = swarm(&name, 3, crate::RobotConfig { learning: learns, ..config(1, &name, &[]) }).await;
    let mut counter = 0;
    for part in [Part::Training, Part::Memory, Part::Speaking, Part::Census, Part::Presence, Part::Session] {
        fail(&mut robots[0], part).await;
        // It is back when it can fail again.
        fail(&mut robots[0], part).await;
        for robot in &robots {
            robot.status("all are alive", |status| status.alive.len() == 3).await;
        }
        // A round that began while its links came back may be decided without it.
        let began = Instant::now();
        loop {
            let decision = robots[1].decide(counter).await;
            counter = decision.round.counter;
            if decision.certificate.votes.len() == 3 {
                break;
            }
            assert!(began.elapsed() < PATIENCE, "{part}: not all three vote again: {decision:?}");
        }
    }
    assert!(timeout(Duration::ZERO, robots[0].robot.ended()).await.is_err(), "it has not ended");
    for robot in robots {
        robot.stop().await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_without_its_mind_or_session_ends_and_nobody_waits_for_it() {
    for part in [Part::Mind, Part::Session] {
        let name = unique();
        let mut robots = swarm(&name, 3, config(1, &name, &[])).await;
        // The last: the others stay linked.
        let mut ended = robots.pop().unwrap();
        if part == Part::Mind {
            fail(&mut ended, part).await;
        } else {
            ended.robot.session.close().await.unwrap();
            told(&mut ended, part).await;
        }
        let failure = timeout(PATIENCE, ended.robot.ended()).await.expect("it ends");
        assert_eq!(failure.part, part);
        let decision = robots[0].decide(0).await;
        assert_eq!(decision.certificate.votes.len(), 2, "{part}: decided without it");
        ended.stop().await;
        for robot in robots {
            robot.stop().await;
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_classifier_that_panics_makes_its_robot_blind_until_there_is_another() {
    let name = unique();
    let mut robots = swarm(&name, 2, config(1, &name, &[])).await;
    robots[0].looking.abort();
    robots[0].robot.open_round();
    robots[0].event("opened", |event| matches!(event, Event::Opened(_)).then_some(())).await;
    robots[0].robot.observe(Observation { features: vec![-1.0, 2.0], quality: 1.0 });
    told(&mut robots[0], Part::Classifier).await;
    // A camera that shows something does not make it see.
    robots[0].robot.blind(false);
    let held = |event: &Event| match event {
        Event::Held(held) if held.class.is_some() => Some(held.clone()),
        _ => None,
    };
    let decision = robots[1].event("decided without waiting", held).await;
    assert_eq!(decision.certificate.votes.len(), 1);
    robots[0].robot.learned(Arc::new(Fixed::default()), "mended");
    let robot = robots[0].robot.clone();
    robots[0].looking = tokio::spawn(async move {
        loop {
            robot.observe(super::look());
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    });
    let decision = robots[1].decide(decision.round.counter).await;
    assert_eq!(decision.certificate.votes.len(), 2, "it sees again");
    for robot in robots {
        robot.looking.abort();
        let _ = timeout(PATIENCE, robot.looking).await;
        drop(robot.robot);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_guest_ends_with_its_host_and_its_classifier_is_guarded_too() {
    let name = unique();
    let mut robots = swarm(&name, 1, config(1, &name, &[])).await;
    let guest =
        GuestConfig { id: gestalt_protocol::RobotId(2), name: "guest".to_owned(), boot: 1, identity: None };
    let guest = robots[0].robot.guest(guest).await.unwrap();
    let classifier: Arc<dyn Classify> = Arc::new(Fixed::default());
    guest.learned(classifier, "fixed");
    let mut guest =
        Watched { events: guest.events(), robot: Arc::new(guest), looking: tokio::spawn(async {}) };
    robots[0].robot.open_round();
    guest.event("opened", |event| matches!(event, Event::Opened(_)).then_some(())).await;
    guest.robot.observe(Observation { features: vec![-1.0, 2.0], quality: 1.0 });
    told(&mut guest, Part::Classifier).await;
    fail(&mut robots[0], Part::Mind).await;
    let failure = timeout(PATIENCE, guest.robot.ended()).await.expect("it ends");
    assert_eq!(failure.part, Part::Host);
    guest.stop().await;
    robots.pop().unwrap().stop().await;
}
