//! Whole robots on the loopback interface, whose parts fail and whose neighbours do not read.

mod asked;
mod failing;
mod links;
mod memory;
mod sealed;
mod silent;
mod slow;
mod told;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use gestalt_protocol::{Decision, RobotId, Status};
use gestalt_strategies::{
    Classify, ClassifyError, Components, FeatureSpace, LearningConfig, MindConfig, Observation,
    ScalingMethod, Vocabulary,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tokio::sync::broadcast;
use tokio::time::{Instant, sleep, timeout, timeout_at};

use crate::{Event, LinkConfig, Robot, RobotConfig, RobotLearning, fresh_nonce};

/// How long anything is waited for that is to happen; robots wait for each other longer, see [`config`]. In two of some eighty runs nothing came
/// over a link for more than 20 s; a silent one is made anew after 48 s.
const PATIENCE: Duration = Duration::from_secs(60);

/// Takes the features for the probabilities of two gestures.
#[derive(Debug)]
struct Fixed(Vocabulary);

impl Default for Fixed {
    fn default() -> Self {
        Self(Vocabulary::new(["left", "right"]).unwrap())
    }
}

impl Classify for Fixed {
    fn vocabulary(&self) -> &Vocabulary {
        &self.0
    }

    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        // What a researcher's own may do.
        assert!(features[0] >= 0.0, "a negative probability");
        Ok(features.iter().map(|p| f64::from(*p)).collect())
    }
}

fn look() -> Observation {
    Observation { features: vec![0.05, 0.95], quality: 1.0 }
}

/// A name that no other test has.
fn unique() -> String {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    format!("link-{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed))
}

/// A robot that dials `connect`, and in a round waits two minutes for whoever is alive and has seen nothing yet.
fn config(id: u32, swarm: &str, connect: &[String]) -> RobotConfig {
    RobotConfig {
        id: RobotId(id),
        name: format!("robot {id}"),
        boot: 1,
        swarm: swarm.to_owned(),
        mind: MindConfig {
            patience: Duration::from_secs(120),
            deadline: Duration::from_secs(150),
            ..MindConfig::default()
        },
        fusion: None,
        link: LinkConfig {
            listen: vec!["tcp/127.0.0.1:0".to_owned()],
            connect: connect.to_vec(),
            // One that was not scheduled for a second, on a machine that compiles beside, is not dead.
            lease: Duration::from_secs(5),
            ..LinkConfig::default()
        },
        vocabulary: None,
        learning: None,
        nonce: fresh_nonce(),
        seal: None,
    }
}

/// How a robot learns in a space of two coordinates.
fn learning(memory: Option<PathBuf>) -> RobotLearning {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let rows: Vec<Vec<f32>> = (0..40).map(|_| vec![rng.random(), rng.random()]).collect();
    let rows = rows.iter().map(Vec::as_slice);
    let space = FeatureSpace::fit("test", rows, ScalingMethod::PerComponent, Components::Count(2), &mut rng);
    RobotLearning {
        config: LearningConfig { keep: 2, spacing: Duration::from_millis(20), ..LearningConfig::default() },
        space: Arc::new(space),
        vocabulary: Fixed::default().0,
        base: None,
        memory,
        seed: 1,
        rules: gestalt_strategies::OwnRules::default(),
    }
}

/// A robot that looks ten times a second while a round is open.
struct Watched {
    robot: Arc<Robot>,
    events: broadcast::Receiver<Event>,
    looking: tokio::task::JoinHandle<()>,
}

async fn start(config: RobotConfig) -> Watched {
    let robot = Arc::new(Robot::start(config).await.expect("the robot starts"));
    let events = robot.events();
    robot.learned(Arc::new(Fixed::default()), "fixed");
    let eye = Arc::downgrade(&robot);
    let looking = tokio::spawn(async move {
        while let Some(robot) = eye.upgrade() {
            if robot.open().is_some() {
                robot.observe(look());
            }
            drop(robot);
            sleep(Duration::from_millis(100)).await;
        }
    });
    Watched { robot, events, looking }
}

/// Robots 1 to `n`, each but the first linked to the first.
async fn swarm(name: &str, n: u32, first: RobotConfig) -> Vec<Watched> {
    let mut swarm = vec![start(first).await];
    for id in 2..=n {
        let hub = swarm[0].robot.locators().to_vec();
        swarm.push(start(config(id, name, &hub)).await);
    }
    for watched in &swarm {
        watched.status("all are alive", |status| status.alive.len() == n as usize).await;
    }
    swarm
}

impl Watched {
    /// Waits until the status is such.
    async fn status(&self, what: &str, such: impl Fn(&Status) -> bool) {
        let end = Instant::now() + PATIENCE;
        while !such(&self.robot.status()) {
            assert!(Instant::now() < end, "never so: {what}: {:#?}", self.robot.status());
            sleep(Duration::from_millis(10)).await;
        }
    }

    /// Waits for an event that suits.
    async fn event<T>(&mut self, what: &str, suits: impl Fn(&Event) -> Option<T>) -> T {
        self.event_within(PATIENCE, what, suits).await
    }

    async fn event_within<T>(
        &mut self,
        patience: Duration,
        what: &str,
        suits: impl Fn(&Event) -> Option<T>,
    ) -> T {
        let end = Instant::now() + patience;
        loop {
            let event = timeout_at(end, self.events.recv()).await;
            let event = event.unwrap_or_else(|_| panic!("never: {what}: {:#?}", self.robot.status()));
            if let Some(found) = event.ok().as_ref().and_then(&suits) {
                return found;
            }
        }
    }

    /// Opens a round, and waits for a decision of a later round than `before`, of a gesture.
    async fn decide(&mut self, before: u32) -> Decision {
        sleep(MindConfig::default().refractory).await;
        self.robot.open_round();
        let suits = |event: &Event| match event {
            Event::Held(held) if held.round.counter > before && held.class.is_some() => Some(held.clone()),
            _ => None,
        };
        self.event("decided", suits).await
    }

    async fn stop(self) {
        self.looking.abort();
        let _ = self.looking.await;
        let robot = Arc::into_inner(self.robot).expect("nobody else holds it");
        timeout(PATIENCE, robot.stop()).await.expect("it stops");
    }
}
