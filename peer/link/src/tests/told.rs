//! What a program tells its robot while that is busy.

use std::sync::atomic::AtomicBool;
use std::sync::{Mutex, PoisonError};

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
