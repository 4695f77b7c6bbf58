//! A robot's eye: frames in, observations out, while a round is open.

use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::{Duration, Instant};

use gestalt_protocol::{ClassId, RobotId, RoundId};
use gestalt_strategies::{Classify, Observation};
use opencv::core::Mat;
use thiserror::Error;
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::RecvError;

use crate::config::{CameraSection, SourceSection};
use crate::human::Human;
use crate::link::{Event, Robot};
use crate::model::RobotModel;
use crate::perception::{HandConfig, NoObservation, Perception, PerceptionError};
use crate::source::{Glove, ImageFolder, RenderedSource, Source, SourceError, Video};

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
    perception: Perception,
    human: Human,
}

/// What one look gave.
pub enum Glance {
    /// A hand.
    Hand(Observation),
    /// A frame without a hand, or one that cannot be judged.
    NoHand(NoObservation),
    /// No frame.
    NoFrame(SourceError),
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
        let properties = camera.model.properties();
        let period = properties.period();
        let mut human = Human::new(0);
        let source: Box<dyn Source> = match &camera.source {
            SourceSection::None => return Ok(None),
            SourceSection::Rendered(rendered) => {
                human = Human::new(rendered.seed);
                // Every robot has a noise of its own, of the same scene.
                let noise = rendered.seed.rotate_left(32) ^ u64::from(robot.0);
                Box::new(RenderedSource::new(properties, rendered.pose, Glove::default(), noise)?)
            }
            SourceSection::Images(files) => Box::new(ImageFolder::open(&files.path, period, files.repeat)?),
            SourceSection::Video(files) => Box::new(Video::open(&files.path, files.repeat)?),
        };
        let perception = Perception::new(model.features, HandConfig::default())?;
        Ok(Some(Self { source, perception, human }))
    }

    /// What it looks through, in words.
    #[must_use]
    pub fn describe(&self) -> String {
        self.source.describe()
    }

    /// Takes one look. `seen` receives the frame.
    fn look(&mut self, now: Duration, round: RoundId, seen: &Mutex<Option<Seen>>) -> Glance {
        let frame = match self.source.next_frame(now, &self.human.shows(round)) {
            Ok(frame) => frame,
            Err(error) => return Glance::NoFrame(error),
        };
        let observation = self.perception.observe(&frame.image);
        let features = observation.as_ref().ok().map(|observation| observation.features.clone());
        *seen.lock().unwrap_or_else(PoisonError::into_inner) =
            Some(Seen { round, image: frame.image, features });
        match observation {
            Ok(observation) => Glance::Hand(observation),
            Err(none) => Glance::NoHand(none),
        }
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
    let started = Instant::now();
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
                    Glance::Hand(observation) => {
                        robot.count("frames_with_a_hand");
                        robot.observe(observation);
                    }
                    Glance::NoHand(none) => {
                        robot.count("frames_without_a_hand");
                        tracing::debug!("{none}");
                    },
                    Glance::NoFrame(error) => {
                        robot.count("frames_failed");
                        robot.report_error(&error.to_string());
                        if matches!(error, SourceError::Ended(_)) {
                            robot.set_camera(error.to_string());
                            return;
                        }
                    }
                }
            }
        }
    }
}
