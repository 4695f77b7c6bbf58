//! One robot's sight: what is remembered from frame to frame of one camera, and what each frame says.
//!
//! The same wherever it runs: on board, beside the robot's own link, or in a fusion centre, for a robot that only streams.

mod mismatch;

use std::time::{Duration, Instant};

use gestalt_protocol::{Motion, MotionState};
use gestalt_strategies::Observation;

use crate::config::CameraSection;
use crate::link::Robot;
use crate::motion::{MotionDetector, MotionError};
use crate::perception::{FeatureSet, HandConfig, NoObservation, Perception, PerceptionError};
use crate::source::Frame;
use mismatch::Mismatch;

/// The sight of one camera.
pub struct Sight {
    camera: CameraSection,
    features: FeatureSet,
    perception: Perception,
    /// `None` when motion is not watched.
    detector: Option<MotionDetector>,
    mismatch: Mismatch,
}

/// What one frame said.
#[derive(Debug)]
pub struct Taken {
    /// When the frame was taken, in the time of [`Frame::at`].
    pub at: Duration,
    /// What has begun or ended with this frame.
    pub change: Option<Change>,
    /// What hand it showed, when it was to be judged and nothing moved: a moving hand is no evidence.
    pub observation: Option<Result<Observation, NoObservation>>,
    /// What is wrong with the camera or its frames, and the mend; the same thing is said once.
    pub trouble: Option<String>,
}

/// What a motion detector notices, once each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// A hand moved from that time on, and now holds still.
    Shown {
        /// The time of the last frame before it moved.
        began: Duration,
    },
    /// The hand that held still is moving again, or gone.
    Left,
}

impl Sight {
    /// The sight of that camera, for a classifier of that feature set.
    ///
    /// # Errors
    /// See [`PerceptionError`]; [`PerceptionError::Motion`] for a motion detector that cannot be.
    pub fn new(camera: &CameraSection, features: FeatureSet) -> Result<Self, PerceptionError> {
        let model = camera.model.properties();
        let (hand, motion) = (HandConfig::default(), &camera.motion);
        Ok(Self {
            perception: Perception::for_camera(features, hand, camera.layer, &model)?,
            detector: motion.enabled.then(|| MotionDetector::new(motion.clone())).transpose()?,
            mismatch: Mismatch::new(model),
            camera: camera.clone(),
            features,
        })
    }

    /// Takes in the next frame; `judge`: also says what hand it shows. Frames between which no round is open are taken
    /// in as well, for they show what moves.
    pub fn take(&mut self, frame: &Frame, judge: bool) -> Taken {
        let mut trouble = self.adapt_to(frame);
        let change = self.detector.as_mut().map(|detector| detector.watch(&frame.image, frame.at));
        let change = change.unwrap_or(Ok(None)).unwrap_or_else(|error: MotionError| {
            trouble = Some(error.to_string());
            None
        });
        let moving = self.detector.as_ref().is_some_and(|d| d.state() == MotionState::Moving);
        let observation = (judge && !moving).then(|| {
            let background = self.detector.as_ref().and_then(MotionDetector::background);
            self.perception.observe_before(&frame.image, background)
        });
        Taken { at: frame.at, change, observation, trouble }
    }

    /// What moves, for the status; `None` when motion is not watched.
    #[must_use]
    pub fn motion(&self) -> Option<Motion> {
        let detector = self.detector.as_ref()?;
        let delay = detector.delay().unwrap_or_default();
        Some(Motion { state: detector.state(), delay_ms: delay.as_secs_f32() * 1000.0 })
    }

    /// Reads frames as what they are when they are not what the configuration says. Says so, once.
    fn adapt_to(&mut self, frame: &Frame) -> Option<String> {
        let said = self.mismatch.notice(frame)?;
        let model = self.mismatch.model();
        match Perception::for_camera(self.features, HandConfig::default(), self.camera.layer, model) {
            Ok(perception) => {
                self.perception = perception;
                Some(said)
            }
            Err(error) => Some(format!("{said}; it cannot be read so: {error}")),
        }
    }
}

impl Taken {
    /// Tells a robot what the frame said. `zero` is the moment from which [`Frame::at`] counts.
    pub fn tell(self, robot: &Robot, zero: Instant) {
        if let Some(trouble) = &self.trouble {
            robot.report_error(trouble);
        }
        match self.change {
            Some(Change::Shown { began }) => robot.shown(zero + began),
            Some(Change::Left) => robot.left(),
            None => {}
        }
        match self.observation {
            Some(Ok(observation)) => {
                robot.count("frames_with_a_hand");
                robot.observe(observation);
            }
            Some(Err(none)) => {
                robot.count("frames_without_a_hand");
                tracing::debug!("{none}");
            }
            None => {}
        }
    }
}
