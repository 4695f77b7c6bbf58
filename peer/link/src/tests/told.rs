//! What a program tells its robot while that is busy.

use std::sync::atomic::AtomicBool;
use std::sync::{Mutex, PoisonError};

use gestalt_protocol::{Announcement, Keys, Topic};

use super::*;
use crate::GuestConfig;

/// Judges when the gate is open.
#[derive(Debug, Default)]
struct Slow {
    fixed: Fixed,
    gate: Mutex<()>,
    is_asked: AtomicBool,
}

impl Classify for Slow {
    fn vocabulary(&self) -> &Vocabulary {
        &self.fixed.0
    }

    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        self.is_asked.store(true, Ordering::Relaxed);
        let _open = self.gate.lock().unwrap_or_else(PoisonError::into_inner);
        self.fixed.probabilities(features)
    }
}

/// Whoever acts on what is announced acts on nothing that its robot refuses.
#[tokio::test(flavor = "multi_thread")]
async fn what_is_announced_under_a_false_label_is_not_told() {
    let name = unique();
    let mut robots = swarm(&name, 2, config(1, &name, &[])).await;
    robots[0].decide(0).await;
    let is_announced = |event: &Event| match event {
        Event::Announced(announcement) if announcement.decision.class.is_some() => Some(announcement.clone()),
        _ => None,
    };
    let mut announced = Vec::new();
    for watched in &mut robots {
        announced.push(watched.event("it is announced", is_announced).await);
    }
    let [said, _] = &announced[..] else { unreachable!() };
    assert!(announced.iter().all(|other| other.label == said.label), "each is told, by whichever of them");
    let mut forged = Announcement { label: Some("left".to_owned()), announcer: RobotId(2), ..said.clone() };
    forged.stamp.sequence += 1000;
    assert_ne!(forged.label, said.label);
    let link = LinkConfig { connect: robots[0].robot.locators().to_vec(), ..LinkConfig::default() };
    let liar = zenoh::open(link.client().unwrap()).await.unwrap();
    let key = Keys::new(&name).unwrap().key(&Topic::Decision);
    liar.put(key, serde_json::to_string(&forged).unwrap()).await.unwrap();
    let refused = |status: &Status| status.counters.contains_key("refused_decision_label");
    robots[0].status("it is refused", refused).await;
    while let Ok(event) = robots[0].events.try_recv() {
        assert!(is_announced(&event).is_none_or(|told| told.label != forged.label), "{event:?}");
    }
    liar.close().await.unwrap();
    for robot in robots {
        robot.stop().await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn a_classifier_is_not_lost_and_is_named_when_it_is_in_use() {
    let name = unique();
    let host = start(config(1, &name, &[])).await;
    host.looking.abort();
    let guest = GuestConfig { id: RobotId(2), name: "guest".to_owned(), boot: 1, identity: None };
    let guest = host.robot.guest(guest).await.unwrap();
    host.robot.open_round();
    for robot in [&*host.robot, &guest] {
        let slow = Arc::new(Slow::default());
        robot.learned(slow.clone(), "slow");
        let end = Instant::now() + PATIENCE;
        while robot.open().is_none() || robot.status().model != "slow" {
            assert!(Instant::now() < end, "it is not in use: {:#?}", robot.status());
            sleep(Duration::from_millis(10)).await;
        }
        let fast: Arc<dyn Classify> = Arc::new(Fixed::default());
        {
            let _closed = slow.gate.lock().unwrap();
            while !slow.is_asked.load(Ordering::Relaxed) {
                assert!(Instant::now() < end, "it is not asked");
                robot.observe(look());
                std::thread::sleep(Duration::from_millis(10));
            }
            while !robot.status().counters.contains_key("refused_command_full") {
                robot.observe(look());
            }
            robot.learned(fast.clone(), "fast");
            assert_eq!(robot.status().model, "slow", "it judges with that still");
        }
        while robot.status().model != "fast" {
            assert!(Instant::now() < end, "it is not taken up: {:#?}", robot.status());
            sleep(Duration::from_millis(10)).await;
        }
        assert!(robot.classifier().is_some_and(|held| Arc::ptr_eq(&held, &fast)));
    }
    guest.stop().await;
    host.stop().await;
}
