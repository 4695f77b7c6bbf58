//! A fusion centre: it looks through the cameras of robots that only stream, votes for each of them, and sends the
//! decisions back.
//!
//! ```text
//! robot/<id>/frame ─► door ─► queue: newest frame of each robot ─► workers: decode ─► sight ─► that robot ─► vote
//!                      │                      └─ due ► robot/<id>/taken                          ▲
//!                      └─ admits: a guest of the centre (central), or a robot of its own (swarm) ─┘
//! ```
//!
//! The centre itself is a robot without eyes: it relays, repairs, and decides. Fused centrally, the robots it serves are its
//! guests; as a swarm, each is a robot with a mind and a session of its own, linked to the centre within this process.

mod door;
mod frame_queue;
mod pace;
mod seat;
mod service;
mod waiting;
mod workers;

use std::sync::{Arc, Weak};

use gestalt_protocol::{FrameTaken, RobotId, Status};
use gestalt_strategies::Classify;
use serde_json::{Value, json};
use thiserror::Error;
use tokio::sync::mpsc;

use crate::body::alone;
use crate::config::{Config, Fuse};
use door::{Calls, Door};
use frame_queue::{FrameQueue, Put, Turn};
use gestalt_link::{FrameArrival, FrameGate, LinkConfig, LinkError, Robot, RobotConfig, fresh_nonce};
use gestalt_vision::model::RobotModel;
use gestalt_vision::sight::one_thread_per_frame;
use seat::Seat;
use workers::{Work, Workers, cores};

/// How many frames of robots not served yet wait at the door; and how many before it, to be taken in.
const MAX_WAITING: usize = 64;

/// How many frames of each worker wait or are on their way: their way takes longer than looking at them.
const AHEAD: usize = 12;

/// Why a centre cannot start.
#[derive(Debug, Error)]
pub enum CenterError {
    /// Its link.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// Its threads.
    #[error("cannot start a thread: {0}")]
    Thread(#[from] std::io::Error),
    /// OpenCV would not take one thread per frame.
    #[error("OpenCV: {0}")]
    OpenCv(#[from] opencv::Error),
    /// A centre looks through the cameras of others.
    #[error("a centre has no camera of its own: set camera.source to \"none\"")]
    Camera,
    /// Nobody would learn.
    #[error("a centre keeps to its model: set learning.enabled to false")]
    Learning,
}

type Frames = FrameQueue<Seat, FrameArrival>;

/// A running centre.
pub struct Center {
    robot: Arc<Robot>,
    queue: Arc<Frames>,
    workers: Workers<Seat, FrameArrival>,
    door: tokio::task::JoinHandle<()>,
    leave: mpsc::Sender<()>,
}

impl Center {
    /// Starts the centre that a configuration describes, with that model for all cameras. `boot` must grow with each start.
    ///
    /// # Errors
    /// See [`CenterError`].
    pub async fn start(config: &Config, model: RobotModel, boot: u32) -> Result<Self, CenterError> {
        if !matches!(config.camera.source, crate::config::SourceSection::None) {
            return Err(CenterError::Camera);
        }
        if config.learning.enabled {
            return Err(CenterError::Learning);
        }
        one_thread_per_frame()?;
        let robot = Arc::new(
            Robot::start(RobotConfig {
                id: config.robot.id,
                name: config.name(),
                boot,
                swarm: config.swarm.0.clone(),
                mind: config.mind(),
                fusion: None,
                link: link(config),
                vocabulary: Some(model.classifier.vocabulary().clone()),
                learning: None,
                nonce: fresh_nonce(),
                seal: config.trust.seal(config.robot.id)?,
            })
            .await?,
        );
        robot.blind(true);
        match Self::open(config, model, robot.clone()).await {
            Ok(center) => Ok(center),
            Err(error) => {
                // Nothing is left running.
                alone(robot).await.stop().await;
                Err(error)
            }
        }
    }

    /// Opens the door and puts the workers behind it.
    async fn open(config: &Config, model: RobotModel, robot: Arc<Robot>) -> Result<Self, CenterError> {
        let workers = config.center.workers.unwrap_or_else(cores);
        let queue = Arc::new(Frames::new(AHEAD * workers.max(2)));
        let (knock, knocks) = mpsc::channel(MAX_WAITING);
        let (of_gate, of_robot) = (queue.clone(), Arc::downgrade(&robot));
        let gate = robot
            .receive_frames(None, move |frame| {
                if let Put::Unknown(frame) = of_gate.put(frame.robot, frame)
                    && knock.try_send(frame).is_err()
                    && let Some(robot) = of_robot.upgrade()
                {
                    robot.count("refused_frame_full");
                }
            })
            .await?;
        let looking = Arc::new(Looking { gate, center: Arc::downgrade(&robot) });
        let workers = Workers::start(workers, &queue, &looking)?;
        let (leave, left) = mpsc::channel(1);
        let door = Door::new(config.clone(), model, robot.clone(), queue.clone());
        let door = tokio::spawn(door.run(Calls { knocks, left }));
        Ok(Self { robot, queue, workers, door, leave })
    }

    /// The centre itself.
    #[must_use]
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// The account of every robot it serves now, by robot.
    #[must_use]
    pub fn served(&self) -> Vec<Status> {
        self.queue.seats().into_iter().map(|(_, seat)| seat.status()).collect()
    }

    /// Lets all robots leave the swarm, then the centre, and waits until that is done.
    pub async fn stop(self) {
        tokio::task::block_in_place(|| drop(self.workers));
        drop(self.leave);
        if let Err(error) = self.door.await {
            tracing::error!("the centre's task ended badly: {error}");
        }
        alone(self.robot).await.stop().await;
    }
}

/// How the centre is linked; robots with sessions of their own reach it within this machine.
fn link(config: &Config) -> LinkConfig {
    let mut link = config.link();
    let sealed = config.trust.keys.is_some();
    if config.center.fuse == Fuse::Swarm {
        let auto = link.listening(sealed);
        let listen = link.zenoh.entry("listen").or_insert_with(|| json!({}));
        let configured = listen.get("endpoints").and_then(Value::as_array).cloned();
        let mut endpoints = configured.unwrap_or_else(|| auto.into_iter().map(Value::from).collect());
        endpoints.push(json!(door::loopback(sealed)));
        listen["endpoints"] = Value::Array(endpoints);
    }
    link
}

/// What the workers do, and where they say what goes wrong.
struct Looking {
    gate: FrameGate,
    center: Weak<Robot>,
}

impl Looking {
    fn report_error(&self, what: &str) {
        if let Some(center) = self.center.upgrade() {
            center.report_error(what);
        }
    }
}

impl Work<Seat, FrameArrival> for Looking {
    fn grant(&self, robot: RobotId, taken: &FrameTaken) {
        self.gate.taken(robot, taken);
    }

    fn look(&self, turn: &Turn<'_, Seat, FrameArrival>) {
        if let Err(broken) = turn.seat.look(&turn.frame) {
            self.report_error(&format!("robot {}: perception {broken}", turn.robot));
        }
    }

    fn panicked(&self, message: &str) {
        self.report_error(&format!(
            "a worker panicked ({message}) and goes on; it is a bug: RUST_BACKTRACE=1 shows where"
        ));
    }
}
