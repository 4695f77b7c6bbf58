//! A robot's eye: frames in, observations out, while a round is open.

use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::Duration;

use gestalt_protocol::{CameraState, ClassId, RobotId, RoundId};
use gestalt_strategies::Classify;
use opencv::core::Mat;
use thiserror::Error;
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::RecvError;

use crate::config::{CameraSection, SourceSection};
use crate::human::Human;
use crate::link::{Event, Robot};
use crate::model::RobotModel;
use crate::perception::PerceptionError;
use crate::sight::{Sight, Taken};
use crate::source::{Glove, ImageFolder, RenderedSource, Source, SourceError, Video};
use crate::stream::{Inlet, StreamSource};

/// Why an eye cannot open.
#[derive(Debug, Error)]
pub enum EyeError {
    /// Its source of frames.
    #[error("camera: {0}")]
    Source(#[from] SourceError),
    /// Its perception.
    #[error(transparent)]
    Perception(#[from] PerceptionError),
}

/// An open eye.
pub struct Eye {
    source: Box<dyn Source>,
    sight: Sight,
    human: Human,
    inlet: Option<Arc<Inlet>>,
}

/// A frame, and what perception made of it.
#[derive(Clone, Debug)]
pub struct Seen {
    /// In which round.
    pub round: RoundId,
    /// The frame, BGR.
    pub image: Mat,
    /// The raw features of the hand; `None` when no hand was found.
    pub features: Option<Vec<f32>>,
}

impl Seen {
    /// What a classifier thinks of it: the probability of each class; empty when no hand was found.
    #[must_use]
    pub fn probabilities(&self, classifier: &dyn Classify) -> Vec<f64> {
        let judged = self.features.as_ref().and_then(|features| classifier.probabilities(features).ok());
        judged.unwrap_or_default()
    }
}

/// The likeliest class and its probability; `None` of no classes.
#[must_use]
pub fn likeliest(probabilities: &[f64]) -> Option<(ClassId, f64)> {
    let by_class = (0..).map(ClassId).zip(probabilities.iter().copied());
    by_class.max_by(|(_, a), (_, b)| a.total_cmp(b))
}

/// Opens the source of frames at this robot that a configuration describes, and says who stands before a rendered one;
/// `None` for a robot without a camera, or with one that is somewhere else.
///
/// # Errors
/// See [`SourceError`].
pub fn open_source(
    camera: &CameraSection,
    robot: RobotId,
) -> Result<Option<(Box<dyn Source>, Human)>, SourceError> {
    let properties = camera.model.properties();
    let period = properties.period();
    let mut human = Human::new(0);
    let source: Box<dyn Source> = match &camera.source {
        SourceSection::None | SourceSection::Stream(_) => return Ok(None),
        SourceSection::Rendered(rendered) => {
            human = Human::new(rendered.seed);
            // Every robot has a noise of its own, of the same scene.
            let noise = rendered.seed.rotate_left(32) ^ u64::from(robot.0);
            Box::new(RenderedSource::new(properties, rendered.pose, Glove::default(), noise)?)
        }
        SourceSection::Images(files) => Box::new(ImageFolder::open(&files.path, period, files.repeat)?),
        SourceSection::Video(files) => Box::new(Video::open(&files.path, files.repeat)?),
    };
    Ok(Some((source, human)))
}

impl Eye {
    /// Opens the eye a configuration describes; `None` for a robot without one.
    ///
    /// # Errors
    /// See [`EyeError`].
    pub fn open(
        camera: &CameraSection,
        model: &RobotModel,
        robot: RobotId,
    ) -> Result<Option<Self>, EyeError> {
        let (source, human, inlet): (Box<dyn Source>, _, _) = match &camera.source {
            SourceSection::Stream(stream) => {
                let inlet = Inlet::new(stream.robot.unwrap_or(robot));
                let period = camera.model.properties().period();
                (Box::new(StreamSource::new(inlet.clone(), period)), Human::new(0), Some(inlet))
            }
            _ => match open_source(camera, robot)? {
                Some((source, human)) => (source, human, None),
                None => return Ok(None),
            },
        };
        let sight = Sight::new(camera, model.features)?;
        Ok(Some(Self { source, sight, human, inlet }))
    }

    /// Where its frames come in, if they come from another machine: to be opened at the robot's session.
    #[must_use]
    pub fn inlet(&self) -> Option<Arc<Inlet>> {
        self.inlet.clone()
    }

    /// What it looks through, in words.
    #[must_use]
    pub fn describe(&self) -> String {
        self.source.describe()
    }

    /// Takes one look. `seen` receives the frame.
    fn look(
        &mut self,
        now: Duration,
        round: RoundId,
        seen: &Mutex<Option<Seen>>,
    ) -> Result<Taken, SourceError> {
        let frame = self.source.next_frame(now, &self.human.shows(round))?;
        let taken = self.sight.take(&frame, true);
        let features = match &taken.observation {
            Some(Ok(observation)) => Some(observation.features.clone()),
            _ => None,
        };
        *seen.lock().unwrap_or_else(PoisonError::into_inner) =
            Some(Seen { round, image: frame.image, features });
        Ok(taken)
    }
}

/// Looks while rounds are open, until the robot is gone. Frames are taken beside the robot's task, so that a slow
/// camera never delays a vote.
pub(crate) async fn look(
    mut eye: Eye,
    robot: Weak<Robot>,
    mut events: Receiver<Event>,
    seen: Arc<Mutex<Option<Seen>>>,
) {
    let Some(started) = robot.upgrade().map(|robot| robot.started()) else { return };
    let period = eye.source.period();
    let mut round = None;
    let mut next = tokio::time::Instant::now();
    loop {
        tokio::select! {
            event = events.recv() => match event {
                Ok(Event::Opened(opened)) => {
                    round = Some(opened);
                    next = tokio::time::Instant::now();
                }
                Ok(Event::Closed(closed)) if round == Some(closed) => round = None,
                Ok(_) | Err(RecvError::Lagged(_)) => {}
                Err(RecvError::Closed) => return,
            },
            () = tokio::time::sleep_until(next), if round.is_some() => {
                // A camera that fell behind drops frames; it never hurries to make up for them.
                next = tokio::time::Instant::now().max(next + period);
                let Some(current) = round else { continue };
                let (now, shared) = (started.elapsed(), seen.clone());
                let looked = tokio::task::spawn_blocking(move || {
                    let glance = eye.look(now, current, &shared);
                    (eye, glance)
                });
                let Ok((returned, glance)) = looked.await else { return };
                eye = returned;
                let Some(robot) = robot.upgrade() else { return };
                match glance {
                    Ok(taken) => taken.tell(&robot, started),
                    Err(error) => {
                        robot.count("frames_failed");
                        robot.report_error(&error.to_string());
                        if matches!(error, SourceError::Ended(_)) {
                            robot.update_camera(|camera| {
                                camera.state = CameraState::Ended;
                                camera.trouble = error.to_string();
                            });
                            return;
                        }
                    }
                }
            }
        }
    }
}
