//! A whole robot: a link to the swarm, and an eye.

use std::sync::{Arc, Mutex, PoisonError};

use thiserror::Error;
use tokio::task::JoinHandle;

use crate::config::Config;
use crate::eye::{Eye, EyeError, Seen, look};
use crate::link::{LinkError, Robot, RobotConfig, fresh_nonce};
use crate::model::RobotModel;

/// Why a robot cannot start.
#[derive(Debug, Error)]
pub enum BodyError {
    /// Its eye.
    #[error(transparent)]
    Eye(#[from] EyeError),
    /// Its link.
    #[error(transparent)]
    Link(#[from] LinkError),
}

/// A running robot with its eye. It looks while a round is open, at the rate of its camera.
#[derive(Debug)]
pub struct Body {
    robot: Arc<Robot>,
    looking: Option<JoinHandle<()>>,
    seen: Arc<Mutex<Option<Seen>>>,
}

impl Body {
    /// Starts the robot that a configuration describes.
    ///
    /// `boot` must be higher at each start of this robot, see [`boot_number`].
    ///
    /// # Errors
    /// See [`BodyError`].
    pub async fn start(config: &Config, model: Option<RobotModel>, boot: u32) -> Result<Self, BodyError> {
        let eye = match &model {
            Some(model) => Eye::open(&config.camera, model, config.robot.id)?,
            None => None,
        };
        let robot = Arc::new(
            Robot::start(RobotConfig {
                id: config.robot.id,
                name: config.name(),
                boot,
                swarm: config.swarm.0.clone(),
                mind: config.rounds.clone(),
                link: config.link(),
                vocabulary: None,
                nonce: fresh_nonce(),
            })
            .await?,
        );
        if let Some(model) = model {
            robot.learned(model.classifier, &model.name);
        }
        let seen = Arc::new(Mutex::new(None));
        let looking = eye.map(|eye| {
            robot.set_camera(eye.describe());
            tokio::spawn(look(eye, Arc::downgrade(&robot), robot.events(), seen.clone()))
        });
        Ok(Self { robot, looking, seen })
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
        if let Some(looking) = self.looking {
            looking.abort();
            // Aborted is what it was meant to become.
            let _ = looking.await;
        }
        match Arc::try_unwrap(self.robot) {
            Ok(robot) => robot.stop().await,
            Err(_) => tracing::error!("the robot is still in use, and leaves the swarm when that ends"),
        }
    }
}

/// A boot number for a robot that keeps no count of its starts: tenths of a second since 2026, which grows from
/// start to start as long as the clock does, and lasts for thirteen years.
#[must_use]
pub fn boot_number(now: std::time::SystemTime) -> u32 {
    const YEAR_2026: u64 = 1_767_225_600;
    let since_1970 = now.duration_since(std::time::UNIX_EPOCH).unwrap_or_default();
    let tenths = since_1970.as_millis() / 100;
    tenths.saturating_sub(u128::from(YEAR_2026) * 10).try_into().unwrap_or(u32::MAX)
}
