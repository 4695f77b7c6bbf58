//! Your own controller around a robot: it takes part in the swarm's decisions, and acts on them. Neither OpenCV nor
//! libclang is needed to build it.
//!
//! ```text
//! cargo run -p gestalt-examples --example embed
//! ```
//!
//! The robot's camera and perception are the controller's own; what it hands over are feature vectors and a
//! classifier for them. Here the "camera" is a number, and the classifier tells small from large.

use std::sync::Arc;
use std::time::{Duration, SystemTime};

use gestalt_link::{Event, LinkConfig, Robot, RobotConfig, boot_number, fresh_nonce};
use gestalt_protocol::RobotId;
use gestalt_strategies::{Classify, ClassifyError, MindConfig, Observation, Vocabulary};

#[derive(Debug)]
struct SmallOrLarge(Vocabulary);

impl Classify for SmallOrLarge {
    fn vocabulary(&self) -> &Vocabulary {
        &self.0
    }

    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        let &[size] = features else {
            return Err(ClassifyError::Length { found: features.len(), expected: 1 });
        };
        let large = 1.0 / (1.0 + f64::from(-size).exp());
        Ok(vec![1.0 - large, large])
    }
}

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let robot = Robot::start(RobotConfig {
        id: RobotId(1),
        name: "my-robot".to_owned(),
        // Higher at every start; a robot with a key of its own takes `counted_boot`.
        boot: boot_number(SystemTime::now()),
        swarm: "embed".to_owned(),
        mind: MindConfig::default(),
        fusion: None,
        link: LinkConfig { connect: std::env::args().skip(1).collect(), ..LinkConfig::default() },
        vocabulary: None,
        learning: None,
        nonce: fresh_nonce(),
        seal: None,
    })
    .await?;
    robot.learned(Arc::new(SmallOrLarge(Vocabulary::new(["small", "large"])?)), "a threshold");
    let mut events = robot.events();
    robot.open_round();
    loop {
        match tokio::time::timeout(Duration::from_secs(10), events.recv()).await?? {
            // Your camera, your perception.
            Event::Opened(_) => robot.observe(Observation { features: vec![4.0], quality: 1.0 }),
            // Your motors.
            Event::Announced(decision) => break println!("the swarm decided {:?}", decision.label),
            _ => {}
        }
    }
    robot.stop().await;
    Ok(())
}
