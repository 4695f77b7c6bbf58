//! Your own test with robots in one process: three in a line, of which only the first sees the hand.
//!
//! ```text
//! cargo test -p gestalt-examples --example in_process
//! ```

use std::sync::Arc;
use std::time::Duration;

use gestalt_link::{Event, LinkConfig, Robot, RobotConfig, fresh_nonce};
use gestalt_protocol::{ClassId, RobotId};
use gestalt_strategies::{Classify, ClassifyError, MindConfig, Observation, Vocabulary};
use tokio::time::timeout;

/// Knows what it is shown: the features are the probabilities.
#[derive(Debug)]
struct Oracle(Vocabulary);

impl Classify for Oracle {
    fn vocabulary(&self) -> &Vocabulary {
        &self.0
    }

    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        Ok(features.iter().map(|p| f64::from(*p)).collect())
    }
}

/// A robot on a free port of this machine, linked to those endpoints.
async fn robot(id: u32, connect: &[String]) -> Robot {
    let link = LinkConfig {
        listen: vec!["tcp/127.0.0.1:0".to_owned()],
        connect: connect.to_vec(),
        ..LinkConfig::default()
    };
    let config = RobotConfig {
        id: RobotId(id),
        name: format!("robot-{id}"),
        boot: 1,
        // Tests that run side by side must not hear each other.
        swarm: format!("example-{}", std::process::id()),
        mind: MindConfig::default(),
        fusion: None,
        link,
        vocabulary: None,
        learning: None,
        nonce: fresh_nonce(),
        seal: None,
    };
    let robot = Robot::start(config).await.expect("a free port of this machine");
    let vocabulary = Vocabulary::new(["rock", "paper", "scissors"]).expect("three labels");
    robot.learned(Arc::new(Oracle(vocabulary)), "oracle");
    robot
}

async fn what_the_first_sees_the_last_decides() {
    let first = robot(1, &[]).await;
    let relay = robot(2, first.locators()).await;
    let last = robot(3, relay.locators()).await;
    let mut events = last.events();
    while last.status().alive.len() < 3 {
        tokio::time::sleep(Duration::from_millis(50)).await;
    }

    first.open_round();
    first.observe(Observation { features: vec![0.01, 0.01, 0.98], quality: 1.0 });
    let held = timeout(Duration::from_secs(10), async {
        loop {
            if let Event::Held(decision) = events.recv().await.expect("the robot is running")
                && decision.class.is_some()
            {
                break decision;
            }
        }
    });
    let decision = held.await.expect("a decision within the deadline");
    println!("robot 3, which saw nothing, holds {:?}", decision.class);
    assert_eq!(decision.class, Some(ClassId(2)));
    for robot in [last, relay, first] {
        robot.stop().await;
    }
}

#[tokio::main]
async fn main() {
    what_the_first_sees_the_last_decides().await;
}

#[cfg(test)]
#[tokio::test(flavor = "multi_thread")]
async fn a_relay_that_sees_nothing_passes_the_decision_on() {
    let seen = timeout(Duration::from_secs(60), what_the_first_sees_the_last_decides());
    seen.await.expect("within a minute");
}
