//! A fusion centre: it looks through the cameras of robots that only stream, votes for each of them, and sends the
//! decisions back.
//!
//! ```text
//! robot/<id>/frame ─► door ─► desk: newest frame of each robot ─► workers: decode ─► sight ─► that robot ─► vote
//!                      │                     └──────► robot/<id>/taken                          ▲
//!                      └─ admits: a guest of the centre (central), or a robot of its own (swarm) ┘
//! ```
//!
//! The centre itself is a robot without eyes: it relays, repairs, and decides. Fused centrally, the robots it serves are its
//! guests; as a swarm, each is a robot with a mind and a session of its own, linked to the centre within this process.

mod desk;
mod door;
mod seat;
mod tally;

use std::num::NonZeroUsize;
use std::sync::Arc;
use std::thread::JoinHandle;

use gestalt_protocol::Status;
use gestalt_strategies::Classify;
use serde_json::{Value, json};
use thiserror::Error;
use tokio::sync::mpsc;

use crate::config::{Config, Fuse};
use desk::{Desk, Put};
use door::Door;
use gestalt_link::{FrameGate, LinkConfig, LinkError, Robot, RobotConfig, fresh_nonce};
use gestalt_vision::model::RobotModel;
use seat::Seat;

/// How many frames of robots not served yet wait at the door.
const MAX_WAITING: usize = 64;

/// Why a centre cannot start.
#[derive(Debug, Error)]
pub enum CenterError {
    /// Its link.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// Its threads.
    #[error("cannot start a thread: {0}")]
    Thread(#[from] std::io::Error),
    /// OpenCV would not take one thread a frame.
    #[error("OpenCV: {0}")]
    OpenCv(#[from] opencv::Error),
    /// A centre looks through the cameras of others.
    #[error("a centre has no camera of its own: set camera.source to \"none\"")]
    Camera,
    /// Nobody would learn.
    #[error("a centre keeps to its model: set learning.enabled to false")]
    Learning,
}

type Frames = Desk<Seat, gestalt_link::FrameArrival>;

/// A running centre.
pub struct Center {
    robot: Arc<Robot>,
    desk: Arc<Frames>,
    workers: Vec<JoinHandle<()>>,
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
        // Frames are shared out among the workers; OpenCV is not to share out each one as well.
        opencv::core::set_num_threads(1)?;
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
            })
            .await?,
        );
        robot.blind(true);
        let workers = config.center.workers.unwrap_or_else(cores);
        let desk = Arc::new(Frames::new(2 * workers.max(2)));
        let (knock, knocks) = mpsc::channel(MAX_WAITING);
        let (of_gate, of_robot) = (desk.clone(), Arc::downgrade(&robot));
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
        let gate = Arc::new(gate);
        let workers: Result<_, _> = (0..workers).map(|_| work(desk.clone(), gate.clone())).collect();
        let (leave, left) = mpsc::channel(1);
        let door = Door::new(config.clone(), model, robot.clone(), desk.clone());
        let door = tokio::spawn(door.run(knocks, left));
        Ok(Self { robot, desk, workers: workers?, door, leave })
    }

    /// The centre itself.
    #[must_use]
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// The account of every robot it serves now, by robot.
    #[must_use]
    pub fn served(&self) -> Vec<Status> {
        self.desk.seats().into_iter().map(|(_, seat)| seat.status()).collect()
    }

    /// Lets all robots leave the swarm, then the centre, and waits until that is done.
    pub async fn stop(self) {
        self.desk.close();
        for worker in self.workers {
            // It ends with the frame it has at hand.
            if tokio::task::block_in_place(|| worker.join()).is_err() {
                tracing::error!("a worker of the centre ended badly");
            }
        }
        drop(self.leave);
        if let Err(error) = self.door.await {
            tracing::error!("the centre's task ended badly: {error}");
        }
        if let Some(robot) = Arc::into_inner(self.robot) {
            robot.stop().await;
        }
    }
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, NonZeroUsize::get)
}

/// How the centre is linked; robots with sessions of their own reach it within this machine.
fn link(config: &Config) -> LinkConfig {
    let mut link = config.link();
    if config.center.fuse == Fuse::Swarm {
        let listen = link.zenoh.entry("listen").or_insert_with(|| json!({}));
        let configured = listen.get("endpoints").and_then(Value::as_array).cloned();
        let mut endpoints =
            configured.unwrap_or_else(|| link.listen.iter().map(|endpoint| json!(endpoint)).collect());
        endpoints.push(json!(door::LOOPBACK));
        listen["endpoints"] = Value::Array(endpoints);
    }
    link
}

/// A thread that looks at one frame after the other.
fn work(desk: Arc<Frames>, gate: Arc<FrameGate>) -> std::io::Result<JoinHandle<()>> {
    std::thread::Builder::new().name("centre".to_owned()).spawn(move || {
        while let Some((robot, seat, frame)) = desk.next(|robot, taken| gate.taken(robot, &taken)) {
            seat.look(&frame);
            desk.done(robot);
        }
    })
}
