//! One robot's sight: what is remembered from frame to frame of one camera, and what each frame says.
//!
//! The same wherever it runs: on board, beside the robot's own link, or in a fusion centre, for a robot that only streams.

use std::time::{Duration, Instant};

use gestalt_strategies::Observation;

use crate::config::CameraSection;
use crate::link::Robot;
use crate::perception::{FeatureSet, HandConfig, NoObservation, Perception, PerceptionError};
use crate::source::Frame;

/// The sight of one camera.
pub struct Sight {
    perception: Perception,
}

/// What one frame said.
#[derive(Debug)]
pub struct Taken {
    /// When the frame was taken, in the time of [`Frame::at`].
    pub at: Duration,
    /// What has begun or ended with this frame.
    pub change: Option<Change>,
    /// What hand it showed, when it was to be judged.
    pub observation: Option<Result<Observation, NoObservation>>,
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
    /// See [`PerceptionError`].
    pub fn new(camera: &CameraSection, features: FeatureSet) -> Result<Self, PerceptionError> {
        let (hand, model) = (HandConfig::default(), camera.model.properties());
        Ok(Self { perception: Perception::for_camera(features, hand, camera.layer, &model)? })
    }

    /// Takes in the next frame; `judge`: also says what hand it shows. Frames between which no round is open are taken
    /// in as well, for they show what moves.
    pub fn take(&mut self, frame: &Frame, judge: bool) -> Taken {
        let observation = judge.then(|| self.perception.observe(&frame.image));
        Taken { at: frame.at, change: None, observation }
    }
}

impl Taken {
    /// Tells a robot what the frame said. `zero` is the moment from which [`Frame::at`] counts.
    pub fn tell(self, robot: &Robot, zero: Instant) {
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
