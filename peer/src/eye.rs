//! A robot's eye: frames in, observations out, while a round is open; all the time where motion is watched.

mod look;
pub mod window;

use std::sync::Arc;
use std::time::{Duration, Instant};

use gestalt_protocol::{RobotId, RoundId};
use gestalt_strategies::Classify;
use gestalt_vision::human::Human;
use gestalt_vision::model::RobotModel;
use gestalt_vision::sight::{Sight, SightError, one_thread_per_frame};
use gestalt_vision::source::{Opener, Pipe, Source, SourceError};
use gestalt_vision::steady::Steady;
use opencv::core::Mat;
use thiserror::Error;

use crate::camera_source::{describe, human_before, open_source};
use crate::config::{CameraSection, SourceSection};
use crate::stream::{Inlet, StreamSource};

pub(crate) use look::look;
use window::Window;

/// Why an eye cannot open.
#[derive(Debug, Error)]
pub enum EyeError {
    /// Its source of frames.
    #[error("camera: {0}")]
    Source(#[from] SourceError),
    /// What it sees with.
    #[error(transparent)]
    Sight(#[from] SightError),
    /// OpenCV would not take one thread per frame.
    #[error("OpenCV: {0}")]
    OpenCv(#[from] opencv::Error),
}

/// An open eye.
pub struct Eye {
    /// `None`: one that is opened by whoever reads it, as it may not be there yet.
    source: Option<Box<dyn Source>>,
    open: Opener,
    describe: String,
    /// Whether it looks also while no round is open.
    watches: bool,
    live: bool,
    period: Duration,
    sight: Steady<Sight>,
    human: Human,
    /// Where its frames come in, if they come from another machine.
    inlet: Option<Arc<Inlet>>,
    /// The zero of its time.
    zero: Instant,
    /// Where it leaves what it sees for whoever looks over its shoulder.
    window: Option<Arc<Window>>,
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

impl Eye {
    /// Opens the eye a configuration describes; `None` for a robot without one. A device that is not there, or a pipe that
    /// nobody writes to, is no error: it is tried again and again. `clock` is the time since 1970 now, for a human who goes by it.
    ///
    /// # Errors
    /// See [`EyeError`].
    pub fn open(
        camera: &CameraSection,
        model: &RobotModel,
        robot: RobotId,
        clock: Duration,
    ) -> Result<Option<Self>, EyeError> {
        let (section, period) = (camera.clone(), camera.model.properties().period());
        // A driver may hang, a router may be late, a pipe opens when somebody writes to it: it is opened where it keeps nobody.
        let keeps = match &camera.source {
            SourceSection::Device(_) | SourceSection::Ros(_) => true,
            SourceSection::Video(files) => Pipe::is_at(&files.path),
            _ => false,
        };
        Ok(match &camera.source {
            SourceSection::None => None,
            SourceSection::Stream(stream) => {
                let inlet = Inlet::new(stream.robot.unwrap_or(robot));
                let frames_from = inlet.clone();
                let open: Opener =
                    Box::new(move || Ok(Box::new(StreamSource::new(frames_from.clone(), period))));
                Some(Self { inlet: Some(inlet), ..Self::with(camera, model, open)? })
            }
            _ if keeps => {
                let open = Box::new(move || open_source(&section, robot, clock));
                Some(Self::new(camera, model, None, open)?)
            }
            _ => Some(Self::with(camera, model, Box::new(move || open_source(&section, robot, clock)))?),
        })
    }

    /// Opens an eye that looks through a source of your own, whatever `camera.source` says; the rest of `camera` counts. `open`
    /// is called now, and again whenever the source fails or panics.
    ///
    /// # Errors
    /// See [`EyeError`]: also what `open` says the first time.
    pub fn with(camera: &CameraSection, model: &RobotModel, mut open: Opener) -> Result<Self, EyeError> {
        let source = open()?;
        Self::new(camera, model, Some(source), open)
    }

    fn new(
        camera: &CameraSection,
        model: &RobotModel,
        source: Option<Box<dyn Source>>,
        open: Opener,
    ) -> Result<Self, EyeError> {
        one_thread_per_frame()?;
        let (mut period, mut live) = (camera.model.properties().period(), true);
        let mut describe = describe(camera);
        if let Some(source) = &source {
            (period, live, describe) = (source.period(), source.is_live(), source.describe());
        }
        let sight = Sight::steady(camera.sight(), model.features)?;
        let (watches, human) = (camera.motion.enabled, human_before(camera));
        let zero = Instant::now();
        Ok(Self {
            source,
            open,
            describe,
            watches,
            live,
            period,
            sight,
            human,
            inlet: None,
            zero,
            window: None,
        })
    }

    /// Where its frames come in, if they come from another machine: to be opened at the robot's session.
    #[must_use]
    pub fn inlet(&self) -> Option<Arc<Inlet>> {
        self.inlet.clone()
    }

    /// From now on it also leaves what it sees in a window, at most once in `every`, while somebody wants it.
    pub fn window(&mut self, every: Duration) -> Arc<Window> {
        let window = Arc::new(Window::new(self.zero, every));
        self.window = Some(window.clone());
        window
    }

    /// What it looks through, in words.
    #[must_use]
    pub fn describe(&self) -> String {
        self.describe.clone()
    }
}
