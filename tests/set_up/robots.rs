//! Robots in this process.

use std::sync::atomic::{AtomicU8, AtomicU32, Ordering};
use std::sync::{Arc, Weak};
use std::time::Duration;

use gestalt_link::{Event, LinkConfig, Robot, RobotConfig, fresh_nonce};
use gestalt_protocol::{ClassId, Decision, RobotId};
use gestalt_strategies::{Classify, MindConfig, Observation};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tokio::sync::broadcast;
use tokio::time::{Instant, MissedTickBehavior, timeout_at};

use crate::{Fixed, gesture, look};

/// A name that no other scenario and no other run has.
#[must_use]
pub fn unique(what: &str) -> String {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    format!("{what}-{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed))
}

/// Robots in one process share its cores with other scenarios, and with whatever else runs here. One that was not scheduled for a
/// second is not dead; scenarios about time on a link say another.
const LEASE: Duration = Duration::from_secs(5);

/// A robot on the loopback interface that dials `connect`.
#[must_use]
pub fn config(id: u32, swarm: &str, connect: &[String]) -> RobotConfig {
    RobotConfig {
        id: RobotId(id),
        name: format!("robot {id}"),
        boot: 1,
        swarm: swarm.to_owned(),
        mind: MindConfig::default(),
        fusion: None,
        link: LinkConfig {
            listen: vec!["tcp/127.0.0.1:0".to_owned()],
            connect: connect.to_vec(),
            lease: LEASE,
            ..LinkConfig::default()
        },
        vocabulary: Some(Fixed::default().vocabulary().clone()),
        learning: None,
        nonce: fresh_nonce(),
        seal: None,
    }
}

/// A robot with its events kept from the start.
pub struct Watched {
    /// The robot.
    pub robot: Arc<Robot>,
    events: broadcast::Receiver<Event>,
    looking: Option<tokio::task::JoinHandle<()>>,
}

/// Starts a robot; one that sees a class looks at it ten times a second.
///
/// # Panics
/// When it cannot start.
pub async fn start(config: RobotConfig, sees: Option<ClassId>) -> Watched {
    let robot = Arc::new(Robot::start(config).await.expect("the robot starts"));
    let events = robot.events();
    let looking = sees.map(|class| {
        robot.learned(Arc::new(Fixed::default()), "fixed");
        let frame = move || look(class, 0.9);
        tokio::spawn(look_when_open(
            Arc::downgrade(&robot),
            robot.events(),
            Duration::from_millis(100),
            frame,
        ))
    });
    Watched { robot, events, looking }
}

/// Starts a robot that learns, and sees what `shown` says at each look.
///
/// # Panics
/// When it cannot start.
pub async fn start_learning(config: RobotConfig, shown: Arc<AtomicU8>) -> Watched {
    let seed = u64::from(config.id.0) << 32 | u64::from(config.nonce as u32);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    start_looking(config, move || gesture(ClassId(shown.load(Ordering::Relaxed).into()), &mut rng)).await
}

/// Starts a robot that looks fifty times a second, and sees that.
///
/// # Panics
/// When it cannot start.
pub async fn start_looking(
    config: RobotConfig,
    frame: impl FnMut() -> Observation + Send + 'static,
) -> Watched {
    let robot = Arc::new(Robot::start(config).await.expect("the robot starts"));
    let (events, of_eye) = (robot.events(), robot.events());
    let period = Duration::from_millis(20);
    let looking = tokio::spawn(look_when_open(Arc::downgrade(&robot), of_eye, period, frame));
    Watched { robot, events, looking: Some(looking) }
}

/// Shows the robot a frame every `period` while it wants to see.
async fn look_when_open(
    robot: Weak<Robot>,
    mut events: broadcast::Receiver<Event>,
    period: Duration,
    mut frame: impl FnMut() -> Observation,
) {
    let mut frames = tokio::time::interval(period);
    frames.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut open = false;
    loop {
        tokio::select! {
            event = events.recv() => match event {
                Ok(Event::Opened(_)) => open = true,
                Ok(Event::Closed(_)) => open = false,
                Err(broadcast::error::RecvError::Closed) => return,
                _ => {}
            },
            _ = frames.tick(), if open => {
                let Some(robot) = robot.upgrade() else { return };
                robot.observe(frame());
            }
        }
    }
}

/// Waits until a round is over for all robots and all hold one and the same decision of it, certificate and all.
///
/// # Panics
/// When they do not within `patience`.
pub async fn agreed(robots: &mut [Watched], counter: u32, patience: Duration) -> Decision {
    let deadline = Instant::now() + patience;
    let mut held = Vec::new();
    for robot in &mut *robots {
        let left = deadline.saturating_duration_since(Instant::now());
        let decision = robot.decision(counter, left).await;
        held.push(decision.unwrap_or_else(|| panic!("round {counter}: {:?}", robot.robot.status())));
    }
    // Who decided early hears of a greater decision later.
    while held.iter().any(|decision| *decision != held[0]) {
        assert!(
            Instant::now() < deadline,
            "round {counter} ended differently: {}",
            differences(robots, &held)
        );
        tokio::time::sleep(Duration::from_millis(20)).await;
        for (robot, held) in robots.iter_mut().zip(&mut held) {
            let greater = |event| match event {
                Event::Held(decision) if decision.round.counter == counter => Some(decision),
                _ => None,
            };
            if let Some(decision) = robot.wait(Duration::ZERO, greater).await {
                *held = decision;
            }
        }
    }
    held.swap_remove(0)
}

/// Who holds what else than the first robot, and how they are.
fn differences(robots: &[Watched], held: &[Decision]) -> String {
    let mut lines = Vec::new();
    for (robot, decision) in robots.iter().zip(held) {
        if lines.is_empty() || *decision != held[0] {
            let (status, rank) = (robot.robot.status(), decision.rank());
            lines.push(format!("robot {} holds {rank:?}: {decision:?}\n  and is {status:?}", status.robot));
        }
    }
    lines.join("\n")
}

impl Watched {
    /// Waits for an event for which `pick` has a value.
    pub async fn wait<T>(
        &mut self,
        patience: Duration,
        mut pick: impl FnMut(Event) -> Option<T>,
    ) -> Option<T> {
        let deadline = Instant::now() + patience;
        loop {
            match timeout_at(deadline, self.events.recv()).await.ok()? {
                Ok(event) => {
                    if let Some(found) = pick(event) {
                        return Some(found);
                    }
                }
                Err(broadcast::error::RecvError::Lagged(missed)) => eprintln!("{missed} events missed"),
                Err(broadcast::error::RecvError::Closed) => return None,
            }
        }
    }

    /// The decision it holds once that round is over, or `None` when the time is up.
    pub async fn decision(&mut self, counter: u32, patience: Duration) -> Option<Decision> {
        let mut held = None;
        // A robot that hears of a round by its decision takes no part in it.
        let mut over = true;
        self.wait(patience, |event| {
            match event {
                Event::Opened(round) if round.counter >= counter => over = false,
                Event::Held(decision) if decision.round.counter >= counter => held = Some(decision),
                Event::Closed(round) if round.counter >= counter => over = true,
                _ => {}
            }
            held.clone().filter(|_| over)
        })
        .await
    }

    /// Waits until it knows `others` other robots to be alive.
    pub async fn sees_alive(&self, others: usize, patience: Duration) -> bool {
        let deadline = Instant::now() + patience;
        while self.robot.status().alive.len() <= others {
            if Instant::now() > deadline {
                return false;
            }
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        true
    }

    /// Stops it and waits until its session is closed.
    pub async fn stop(self) {
        if let Some(looking) = self.looking {
            looking.abort();
            let _ = looking.await;
        }
        if let Some(robot) = Arc::into_inner(self.robot) {
            robot.stop().await;
        }
    }
}
