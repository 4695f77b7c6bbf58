//! A whole robot: a link to the swarm, and an eye.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use gestalt_protocol::CameraState;
use gestalt_strategies::Classify;
use thiserror::Error;
use tokio::task::JoinHandle;

use crate::config::{Config, LearnFrom, LearningSection};
use crate::eye::{Eye, EyeError, Seen, look};
use crate::ros_view::RosView;
use gestalt_link::{LinkError, Robot, RobotConfig, RobotLearning, fresh_nonce};
use gestalt_ros::NameError;
use gestalt_vision::model::RobotModel;
use gestalt_vision::source::Opener;

/// Why a robot cannot start.
#[derive(Debug, Error)]
pub enum BodyError {
    /// Its eye.
    #[error(transparent)]
    Eye(#[from] EyeError),
    /// Its link.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// Its name in ROS.
    #[error("ros.namespace: {0}")]
    Ros(#[from] NameError),
    /// No thread for what ROS sees of it.
    #[error("no thread for the view that ROS is shown: {0}")]
    Thread(#[from] std::io::Error),
}

/// A running robot with its eye. It looks while a round is open, at the rate of its camera.
#[derive(Debug)]
pub struct Body {
    robot: Arc<Robot>,
    looking: Option<JoinHandle<()>>,
    /// What ROS sees of it.
    shown: Option<RosView>,
    seen: Arc<Mutex<Option<Seen>>>,
}

impl Body {
    /// Starts the robot that a configuration describes.
    ///
    /// `boot` must be higher at each start of this robot, see [`boot_number`](gestalt_link::boot_number).
    ///
    /// # Errors
    /// See [`BodyError`].
    pub async fn start(config: &Config, model: Option<RobotModel>, boot: u32) -> Result<Self, BodyError> {
        let eye = match &model {
            Some(model) => {
                let clock = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
                Eye::open(&config.camera, model, config.robot.id, clock)?
            }
            None => None,
        };
        Self::looking_through(eye, config, model, boot).await
    }

    /// The same with a source of frames of your own, whatever `camera.source` says. `open` is called now, and again whenever
    /// the source fails or panics.
    ///
    /// # Errors
    /// See [`BodyError`]: also what `open` says the first time.
    pub async fn start_with(
        config: &Config,
        model: RobotModel,
        boot: u32,
        open: Opener,
    ) -> Result<Self, BodyError> {
        let eye = Eye::with(&config.camera, &model, open)?;
        Self::looking_through(Some(eye), config, Some(model), boot).await
    }

    async fn looking_through(
        mut eye: Option<Eye>,
        config: &Config,
        model: Option<RobotModel>,
        boot: u32,
    ) -> Result<Self, BodyError> {
        let learning = model.as_ref().and_then(|model| learning(&config.learning, model));
        let robot = Arc::new(
            Robot::start(RobotConfig {
                id: config.robot.id,
                name: config.name(),
                boot,
                swarm: config.swarm.0.clone(),
                mind: config.mind(),
                fusion: None,
                link: config.link(),
                vocabulary: None,
                learning: learning.clone(),
                nonce: fresh_nonce(),
                seal: config.trust.seal(config.robot.id)?,
            })
            .await?,
        );
        // One that learns starts with what it has in mind.
        if let Some(model) = model.filter(|_| learning.is_none()) {
            robot.learned(model.classifier, &model.name);
        }
        robot.blind(eye.is_none());
        if let Some(inlet) = eye.as_ref().and_then(Eye::inlet) {
            inlet.open(&robot).await?;
        }
        let shown = match &mut eye {
            Some(eye) if config.ros.enabled => {
                let title = format!("{} · {}", config.name(), config.camera.model.name());
                let name = config.ros.node(config.robot.id)?;
                Some(RosView::show(
                    &config.ros,
                    name,
                    (config.robot.id, &robot),
                    title,
                    eye.window(config.ros.every()),
                )?)
            }
            _ => None,
        };
        let seen = Arc::new(Mutex::new(None));
        let looking = eye.map(|eye| {
            robot.update_camera(|camera| {
                camera.source = eye.describe();
                camera.state = CameraState::Opening;
            });
            tokio::spawn(look(eye, Arc::downgrade(&robot), robot.events(), seen.clone()))
        });
        Ok(Self { robot, looking, shown, seen })
    }

    /// The robot's side towards the swarm.
    #[must_use]
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// The last frame it looked at, and what it made of it.
    #[must_use]
    pub fn seen(&self) -> Option<Seen> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Closes its eye, leaves the swarm, and waits until that is done.
    pub async fn stop(self) {
        drop(self.shown);
        if let Some(looking) = self.looking {
            looking.abort();
            // Aborted is what it was meant to become.
            let _ = looking.await;
        }
        alone(self.robot).await.stop().await;
    }
}

/// What others may use for a moment longer, once they are done with it.
pub(crate) async fn alone<T>(mut shared: Arc<T>) -> T {
    loop {
        match Arc::try_unwrap(shared) {
            Ok(own) => return own,
            Err(again) => shared = again,
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

/// How a robot with that model learns; `None` for one that does not.
pub(crate) fn learning(section: &LearningSection, model: &RobotModel) -> Option<RobotLearning> {
    section.enabled.then(|| RobotLearning {
        config: section.samples.clone(),
        space: model.classifier.space().clone(),
        vocabulary: model.classifier.vocabulary().clone(),
        base: (section.from == LearnFrom::Model).then(|| model.classifier.clone()),
        memory: section.memory.clone(),
        seed: section.seed,
        rules: gestalt_strategies::OwnRules::default(),
    })
}
