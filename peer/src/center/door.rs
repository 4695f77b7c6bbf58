//! Who is served: robots come with their first frames, and are let go when they have been silent for long.

use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

use gestalt_protocol::RobotId;
use gestalt_strategies::Classify;
use thiserror::Error;
use tokio::sync::{Mutex, mpsc};
use tokio::task::{JoinSet, block_in_place};
use tokio::time::MissedTickBehavior;

use super::frame_queue::Put;
use super::pace::Paces;
use super::seat::Seat;
use super::waiting::{Waiting, turn};
use super::{Frames, MAX_WAITING};
use crate::config::{CameraChoice, CameraSection, Config, Fuse};
use gestalt_link::{FrameArrival, GuestConfig, LinkConfig, LinkError, Robot, RobotConfig, fresh_nonce};
use gestalt_trust::Identity;
use gestalt_vision::model::RobotModel;

use gestalt_vision::sight::{Sight, SightError};

/// Where the centre listens for the robots in its own process.
pub(super) fn loopback(sealed: bool) -> &'static str {
    if sealed { "tls/127.0.0.1:0" } else { "tcp/127.0.0.1:0" }
}

/// How often silent robots are looked for, and how it goes is put into the status.
const PERIOD: Duration = Duration::from_secs(1);

/// The lease of a link within this process: its ends live and die together, and a short one would only mistake a busy
/// processor for a lost robot.
const LEASE: Duration = Duration::from_secs(10);

/// Why a robot is not served.
#[derive(Debug, Error)]
enum Refusal {
    #[error(
        "robot {0} streams, but a robot of that id runs elsewhere: stop one of the two, or give it an id of its own; where another centre serves it, \
         stop one of the centres, for a swarm has one"
    )]
    Elsewhere(RobotId),
    #[error(
        "robot {0} streams, but {1} are served already: raise center.max_robots, up to 256. A swarm has one centre: for more cameras make two swarms"
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
    queue: Arc<Frames>,
}

/// What reaches the door.
pub(super) struct Calls {
    /// Frames of robots that are not served yet.
    pub knocks: mpsc::Receiver<FrameArrival>,
    /// Closed when the centre is left.
    pub left: mpsc::Receiver<()>,
}

impl Door {
    pub fn new(config: Config, model: RobotModel, robot: Arc<Robot>, queue: Arc<Frames>) -> Self {
        Self { config, model, robot, queue }
    }

    /// Runs until the centre is left; then all robots leave. A panic costs what was at hand, and is reported.
    pub async fn run(self, calls: Calls) {
        let (door, calls) = (Arc::new(self), Arc::new(Mutex::new(calls)));
        loop {
            let (at_work, calls) = (door.clone(), calls.clone());
            // A task of its own: what panics in it ends it alone.
            let mut served = JoinSet::new();
            served.spawn(async move { at_work.serve(&mut *calls.lock().await).await });
            match served.join_next().await {
                Some(Err(error)) if error.is_panic() => door.robot.report_error(&format!(
                    "the centre's door panicked and goes on: {error}; RUST_BACKTRACE=1 shows where"
                )),
                _ => break,
            }
            // It may do so again at once.
            tokio::time::sleep(PERIOD).await;
        }
        door.clear().await;
    }

    async fn serve(&self, calls: &mut Calls) {
        let mut rounds = tokio::time::interval(PERIOD);
        rounds.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut waiting = Waiting::new(turn(self.config.robot.id), MAX_WAITING);
        loop {
            let due = waiting.due();
            let wait = async {
                match due {
                    Some(due) => tokio::time::sleep_until(due.into()).await,
                    None => std::future::pending().await,
                }
            };
            tokio::select! {
                Some(frame) = calls.knocks.recv() => self.knock(frame, &mut waiting),
                () = wait => if let Some(frame) = waiting.next(Instant::now()) {
                    self.open(frame).await;
                },
                _ = rounds.tick() => self.look_after().await,
                _ = calls.left.recv() => break,
            }
        }
    }

    /// All robots leave.
    async fn clear(&self) {
        for (robot, seat) in self.queue.seats() {
            drop(self.queue.dismiss(robot));
            seat.leave().await;
        }
    }

    /// A frame of a robot that is not served, or was not when it arrived.
    fn knock(&self, frame: FrameArrival, waiting: &mut Waiting<FrameArrival>) {
        let Put::Unknown(frame) = self.queue.put(frame.robot, frame) else { return };
        if !waiting.come(frame.robot, frame, Instant::now()) {
            self.robot.count("refused_frame_full");
        }
    }

    /// The turn of a robot that has waited.
    async fn open(&self, frame: FrameArrival) {
        let Put::Unknown(frame) = self.queue.put(frame.robot, frame) else { return };
        match self.admit(&frame).await {
            // It has its seat now: it waits there.
            Ok(()) => drop(self.queue.put(frame.robot, frame)),
            Err(refusal) => {
                self.robot.count(refusal.counter());
                self.robot.report_error(&refusal.to_string());
            }
        }
    }

    async fn admit(&self, frame: &FrameArrival) -> Result<(), Refusal> {
        let (id, served) = (frame.robot, self.queue.seats().len());
        if served >= self.config.center.max_robots {
            return Err(Refusal::TooMany(id, served));
        }
        if self.robot.status().alive.contains(&id) {
            return Err(Refusal::Elsewhere(id));
        }
        // Read now: it may have been enrolled, or given another key, while the centre runs. A camera without one knocks again and again.
        let identity = self.config.trust.identity(id).map_err(|cause| Refusal::Link(id, cause))?;
        let about = self.config.center.robots.get(&id).cloned().unwrap_or_default();
        let stated = CameraChoice::named(&frame.header.camera);
        let model = about.camera.or(stated).unwrap_or_else(|| self.config.camera.model.clone());
        let name = about.name.unwrap_or_else(|| format!("{}-{id}", model.properties().name));
        let camera = CameraSection { model, ..self.config.camera.clone() };
        let sight = block_in_place(|| Sight::steady(camera.sight(), self.model.features))
            .map_err(|cause| Refusal::Perception(id, cause))?;
        let robot = self.start(id, name, identity).await.map_err(|cause| Refusal::Link(id, cause))?;
        // Nobody reads them, so none need be kept.
        drop(robot.events());
        robot.learned(self.model.classifier.clone(), &self.model.name);
        let period = Duration::from_secs_f32(1.0 / frame.header.fps.max(0.1));
        let patience = self.config.center.frozen_after.max(3 * period);
        let seat = Seat::new(Arc::new(robot), sight, Paces::new(&self.config), patience);
        self.queue.admit(id, Arc::new(seat));
        Ok(())
    }

    /// `identity`: what a guest signs by; a robot of its own reads more than that.
    async fn start(
        &self,
        id: RobotId,
        name: String,
        identity: Option<Arc<Identity>>,
    ) -> Result<Robot, LinkError> {
        // Grows from one admission to the next, also when the centre was killed between them.
        let boot = block_in_place(|| self.config.trust.boot_at(self.config.robot.id, id, SystemTime::now()));
        match self.config.center.fuse {
            Fuse::Central => self.robot.guest(GuestConfig { id, name, boot, identity }).await,
            Fuse::Swarm => {
                let locators = self.robot.locators();
                let here = loopback(self.config.trust.keys.is_some()).trim_end_matches('0');
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
                    seal: self.config.trust.seal(id)?,
                })
                .await
            }
        }
    }

    /// Reports how each robot is served, and lets those go that have been silent for too long.
    async fn look_after(&self) {
        let now = Instant::now();
        let gone_after = self.config.center.gone_after;
        let seats = self.queue.seats();
        self.robot.set("robots_served", seats.len() as u64);
        for (robot, seat) in seats {
            let is_gone = seat.report(now, self.queue.count(robot), gone_after);
            // Who was expelled or has another key comes again as what it is by then.
            if is_gone || !seat.is_enrolled() {
                self.robot.count("robots_gone");
                drop(self.queue.dismiss(robot));
                seat.leave().await;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nobody_is_told_to_start_a_second_centre() {
        for refusal in [Refusal::TooMany(RobotId(7), 64), Refusal::Elsewhere(RobotId(7))] {
            let words = refusal.to_string();
            assert!(words.contains("robot 7 streams, but") && words.contains("swarm has one"), "{words}");
            assert!(!words.contains("start another"), "{words}");
        }
    }
}
