//! Who is served: robots come with their first frame, and are let go when they have been silent for long.

use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

use gestalt_protocol::{CameraState, RobotId};
use gestalt_strategies::Classify;
use thiserror::Error;
use tokio::sync::mpsc;
use tokio::time::MissedTickBehavior;

use super::Frames;
use super::desk::Put;
use super::seat::Seat;
use crate::config::{CameraChoice, CameraSection, Config, Fuse};
use gestalt_link::boot_number;
use gestalt_link::{FrameArrival, GuestConfig, LinkConfig, LinkError, Robot, RobotConfig, fresh_nonce};
use gestalt_vision::model::RobotModel;

use gestalt_vision::sight::{Sight, SightError};

/// Where the centre listens for the robots in its own process.
pub(super) const LOOPBACK: &str = "tcp/127.0.0.1:0";

/// How often silent robots are looked for, and how it goes is put into the status.
const PERIOD: Duration = Duration::from_secs(1);

/// The lease of a link within this process: its ends live and die together, and a short one would only mistake a busy
/// processor for a lost robot.
const LEASE: Duration = Duration::from_secs(10);

/// Why a robot is not served.
#[derive(Debug, Error)]
enum Refusal {
    #[error(
        "robot {0} streams, but a robot of that id runs elsewhere: stop one of the two, or give it an id of its own"
    )]
    Elsewhere(RobotId),
    #[error(
        "robot {0} streams, but {1} are served already: raise center.max_robots, or start another centre"
    )]
    TooMany(RobotId, usize),
    #[error("robot {0}: {1}")]
    Link(RobotId, LinkError),
    #[error("robot {0}: {1}")]
    Perception(RobotId, SightError),
}

impl Refusal {
    fn counter(&self) -> &'static str {
        match self {
            Self::Elsewhere(_) => "refused_frame_elsewhere",
            Self::TooMany(..) => "refused_frame_too_many",
            Self::Link(..) | Self::Perception(..) => "refused_frame_start",
        }
    }
}

pub(super) struct Door {
    config: Config,
    model: RobotModel,
    robot: Arc<Robot>,
    desk: Arc<Frames>,
}

impl Door {
    pub fn new(config: Config, model: RobotModel, robot: Arc<Robot>, desk: Arc<Frames>) -> Self {
        Self { config, model, robot, desk }
    }

    /// Runs until the centre is left; then all robots leave.
    pub async fn run(self, mut knocks: mpsc::Receiver<FrameArrival>, mut left: mpsc::Receiver<()>) {
        let mut rounds = tokio::time::interval(PERIOD);
        rounds.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                Some(frame) = knocks.recv() => self.open(frame).await,
                _ = rounds.tick() => self.look_after().await,
                _ = left.recv() => break,
            }
        }
        for (robot, seat) in self.desk.seats() {
            drop(self.desk.dismiss(robot));
            seat.leave().await;
        }
    }

    /// A frame of a robot that is not served, or was not when it arrived.
    async fn open(&self, frame: FrameArrival) {
        let Put::Unknown(frame) = self.desk.put(frame.robot, frame) else { return };
        match self.admit(&frame).await {
            // It has its seat now: it waits there.
            Ok(()) => drop(self.desk.put(frame.robot, frame)),
            Err(refusal) => {
                self.robot.count(refusal.counter());
                self.robot.report_error(&refusal.to_string());
            }
        }
    }

    async fn admit(&self, frame: &FrameArrival) -> Result<(), Refusal> {
        let (id, served) = (frame.robot, self.desk.seats().len());
        if served >= self.config.center.max_robots {
            return Err(Refusal::TooMany(id, served));
        }
        if self.robot.status().alive.contains(&id) {
            return Err(Refusal::Elsewhere(id));
        }
        let about = self.config.center.robots.get(&id).cloned().unwrap_or_default();
        let stated = CameraChoice::named(&frame.header.camera);
        let model = about.camera.or(stated).unwrap_or_else(|| self.config.camera.model.clone());
        let name = about.name.unwrap_or_else(|| format!("{}-{id}", model.properties().name));
        let camera = CameraSection { model, ..self.config.camera.clone() };
        let sight = Sight::new(camera.sight(), self.model.features)
            .map_err(|cause| Refusal::Perception(id, cause))?;
        let robot = self.start(id, name).await.map_err(|cause| Refusal::Link(id, cause))?;
        robot.update_camera(|camera| {
            camera.source = "stream".to_owned();
            camera.state = CameraState::Opening;
        });
        // Nobody reads them, so none need be kept.
        drop(robot.events());
        // Until a picture of it was seen.
        robot.blind(true);
        robot.learned(self.model.classifier.clone(), &self.model.name);
        self.desk.admit(id, Arc::new(Seat::new(Arc::new(robot), sight, Instant::now())));
        Ok(())
    }

    async fn start(&self, id: RobotId, name: String) -> Result<Robot, LinkError> {
        // Grows from one admission to the next, also when the centre was killed between them.
        let boot = boot_number(SystemTime::now());
        match self.config.center.fuse {
            Fuse::Central => self.robot.guest(GuestConfig { id, name, boot }).await,
            Fuse::Swarm => {
                let locators = self.robot.locators();
                let here = LOOPBACK.trim_end_matches('0');
                let centre = locators.iter().find(|at| at.starts_with(here)).or(locators.first());
                let link = LinkConfig {
                    listen: Vec::new(),
                    connect: centre.into_iter().cloned().collect(),
                    lease: LEASE,
                    ..LinkConfig::default()
                };
                Robot::start(RobotConfig {
                    id,
                    name,
                    boot,
                    swarm: self.config.swarm.0.clone(),
                    mind: self.config.mind(),
                    fusion: None,
                    link,
                    vocabulary: Some(self.model.classifier.vocabulary().clone()),
                    learning: None,
                    nonce: fresh_nonce(),
                })
                .await
            }
        }
    }

    /// Reports how each robot is served, and lets those go that have been silent for too long.
    async fn look_after(&self) {
        let now = Instant::now();
        let center = &self.config.center;
        let seats = self.desk.seats();
        self.robot.set("robots_served", seats.len() as u64);
        for (robot, seat) in seats {
            if seat.report(now, self.desk.count(robot), center.frozen_after) >= center.gone_after {
                self.robot.count("robots_gone");
                drop(self.desk.dismiss(robot));
                seat.leave().await;
            }
        }
    }
}
