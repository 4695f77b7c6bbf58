//! One robot's sight: what is remembered from frame to frame of one camera, and what each frame says.
//!
//! The same wherever it runs: on board, beside the robot's own link, or in a fusion centre, for a robot that only streams.

mod mismatch;

use std::time::Duration;

use gestalt_protocol::{Motion, MotionState};
use gestalt_strategies::Observation;
use opencv::core::{Mat, MatTraitConst, Size};
use thiserror::Error;

use crate::camera_model::CameraModel;
use crate::config::{LayerConfig, MotionConfig};
use crate::motion::{Change, MotionDetector, MotionError};
use crate::perception::{FeatureSet, HandConfig, NoObservation, Perception, PerceptionError, check};
use crate::reduction::{Reduction, reduced};
use crate::source::Frame;
use crate::steady::Steady;
use mismatch::Mismatch;

/// For so long it is remembered where a hand was.
const REMEMBERED: Duration = Duration::from_secs(1);

/// What a robot sees with, and what is done to its frames.
#[derive(Clone, Debug)]
pub struct SightConfig {
    /// What the camera does to a picture, and how often it takes one.
    pub camera: CameraModel,
    /// Which stages make its frames like those of other cameras.
    pub layer: LayerConfig,
    /// How motion in front of it is watched.
    pub motion: MotionConfig,
}

/// A camera that nobody can see with.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SightError {
    /// No perception for this camera and these features.
    #[error(transparent)]
    Perception(#[from] PerceptionError),
    /// No motion detector.
    #[error(transparent)]
    Motion(#[from] MotionError),
}

/// Keeps OpenCV from sharing out each frame among threads, in the whole process: the frames of several cameras are shared out
/// already, and a frame is too small to be worth it. To be called where a program starts its eyes.
///
/// # Errors
/// OpenCV's.
pub fn one_thread_per_frame() -> Result<(), opencv::Error> {
    opencv::core::set_num_threads(1)
}

/// The sight of one camera.
pub struct Sight {
    layer: LayerConfig,
    features: FeatureSet,
    perception: Perception,
    /// `None` when motion is not watched.
    detector: Option<MotionDetector>,
    /// The frame at hand, for both.
    reduction: Reduction,
    mismatch: Mismatch,
    /// What motion could not be watched for, as it was said last.
    unwatched: Option<String>,
    /// When a hand was looked for last; `None` since a frame that was not to be judged.
    looked: Option<Duration>,
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

impl Sight {
    /// The sight of that camera, for a classifier of that feature set.
    ///
    /// # Errors
    /// See [`SightError`].
    pub fn new(config: SightConfig, features: FeatureSet) -> Result<Self, SightError> {
        let SightConfig { camera, layer, motion } = config;
        Ok(Self {
            perception: Perception::for_camera(features, HandConfig::default(), layer, &camera)?,
            detector: motion.enabled.then(|| MotionDetector::new(motion)).transpose()?,
            reduction: Reduction::default(),
            mismatch: Mismatch::new(camera),
            unwatched: None,
            looked: None,
            layer,
            features,
        })
    }

    /// The same, made anew when it panics.
    ///
    /// # Errors
    /// See [`SightError`].
    pub fn steady(config: SightConfig, features: FeatureSet) -> Result<Steady<Self>, SightError> {
        let sight = Self::new(config.clone(), features)?;
        Ok(Steady::new(sight, move || Self::new(config.clone(), features).map_err(|error| error.to_string())))
    }

    /// Takes in the next frame; `judge`: also says what hand it shows. Frames between which no round is open are taken
    /// in as well, for they show what moves.
    pub fn take(&mut self, frame: &Frame, judge: bool) -> Taken {
        let whole = frame.image.size().unwrap_or_default();
        self.take_reduced(frame, whole, judge)
    }

    /// Whether the next frame is to be taken in as it is, because the hand in it is to be found.
    #[must_use]
    pub fn looks_closely(&self, judge: bool) -> bool {
        judge && !self.is_moving()
    }

    /// How large a frame of that size must be left when it need not be taken in as it is.
    #[must_use]
    pub fn enough(&self, whole: Size) -> Size {
        if self.detector.is_some() { reduced(whole) } else { Size::new(1, 1) }
    }

    /// Takes in a frame that is of size `whole`, or was before it was reduced to what is enough; then it shows what moves, and no hand.
    pub fn take_reduced(&mut self, frame: &Frame, whole: Size, judge: bool) -> Taken {
        let adapted = self.adapt_to(frame.at, whole);
        // Learned eyes look at the frame itself.
        let is_read = self.detector.is_some() || judge && self.features != FeatureSet::Embedding;
        let reduced = is_read && self.reduce(&frame.image, whole);
        let change = self.detector.as_mut().map(|detector| match reduced {
            true => detector.watch_reduced(&self.reduction.image, whole, frame.at),
            false => detector.watch(&frame.image, frame.at),
        });
        let (change, unwatched) = match change.unwrap_or(Ok(None)) {
            Ok(change) => (change, None),
            Err(error) => (None, Some(error.to_string())),
        };
        let told = std::mem::replace(&mut self.unwatched, unwatched.clone());
        let trouble: Vec<String> =
            adapted.into_iter().chain(unwatched.filter(|new| told.as_ref() != Some(new))).collect();
        let is_whole = frame.image.size().is_ok_and(|size| size == whole);
        let looks = is_whole && self.looks_closely(judge);
        self.forget_what_is_over(frame.at, judge, looks);
        let observation = looks.then(|| {
            let background = self.detector.as_ref().and_then(MotionDetector::background);
            match reduced {
                true => self.perception.observe_reduced((&frame.image, &self.reduction.image), background),
                false => self.perception.observe_before(&frame.image, background),
            }
        });
        let trouble = (!trouble.is_empty()).then(|| trouble.join("; "));
        Taken { at: frame.at, change, observation, trouble }
    }

    /// Where the hand was is forgotten when a round opens and when nothing was looked at for a while: whoever is shown then may
    /// stand elsewhere, and what was taken for a hand may be none.
    fn forget_what_is_over(&mut self, at: Duration, judge: bool, looks: bool) {
        if !judge {
            self.looked = None;
        }
        if looks {
            if self.looked.is_none_or(|last| at.saturating_sub(last) > REMEMBERED) {
                self.perception.forget();
            }
            self.looked = Some(at);
        }
    }

    /// Reduces a frame for whoever looks at it; what is no frame is left to them to refuse.
    fn reduce(&mut self, image: &Mat, whole: Size) -> bool {
        check(image).is_ok() && self.reduction.take(image, whole).is_ok()
    }

    fn is_moving(&self) -> bool {
        self.detector.as_ref().is_some_and(|detector| detector.state() == MotionState::Moving)
    }

    /// With what it looked last: where in the frame, and at which pixels, it found the hand of the last observation.
    #[must_use]
    pub fn perception(&self) -> &Perception {
        &self.perception
    }

    /// What moves, for the status; `None` when motion is not watched.
    #[must_use]
    pub fn motion(&self) -> Option<Motion> {
        let detector = self.detector.as_ref()?;
        let delay = detector.delay().unwrap_or_default();
        Some(Motion { state: detector.state(), delay_ms: delay.as_secs_f32() * 1000.0 })
    }

    /// The camera takes so many frames per second, as its sender states. From now on its rate is not taken from the frames
    /// that come here, which are as many as there is time for.
    pub fn rate_is(&mut self, fps: f64) {
        self.mismatch.rate_is(fps);
    }

    /// The camera delivered so many frames between the last one taken and the next.
    pub fn passed_over(&mut self, frames: u64) {
        self.mismatch.passed_over(frames);
    }

    /// Frames are taken in again after a time in which none were, as between rounds where motion is not watched.
    pub fn resume(&mut self) {
        self.mismatch.resume();
    }

    /// Reads frames as what they are when they are not what the configuration says. Says so, once.
    fn adapt_to(&mut self, at: Duration, whole: Size) -> Option<String> {
        let rate = self.mismatch.notice_rate(at);
        // Every frame says its own size; only what counts in seconds has to be made anew.
        let Some(said) = rate else { return self.mismatch.notice_size(whole) };
        let model = self.mismatch.model();
        match Perception::for_camera(self.features, HandConfig::default(), self.layer, &model) {
            Ok(perception) => {
                self.perception = perception;
                Some(said)
            }
            Err(error) => Some(format!("{said}; it cannot be read so: {error}")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eyes::tests::hands;

    #[test]
    fn what_is_wrong_with_the_frames_is_said_once_and_hides_nothing_else() {
        let motion = MotionConfig { enabled: true, ..MotionConfig::default() };
        let config = SightConfig { camera: CameraModel::laptop(), layer: LayerConfig::ALL, motion };
        let mut sight = Sight::new(config, FeatureSet::Shape).unwrap();
        let mut trouble = |side: i32, at: u64| {
            let white = opencv::core::Scalar::all(255.0);
            let image = Mat::new_rows_cols_with_default(side, side, opencv::core::CV_8UC3, white).unwrap();
            sight.take(&Frame { image, at: Duration::from_millis(at) }, false).trouble
        };
        let said = trouble(8, 0).unwrap();
        assert!(said.contains("frames of 8×8 pixels") && said.contains("cannot be watched"), "{said}");
        assert_eq!(trouble(8, 33), None);
        assert_eq!(trouble(64, 66), None);
        assert!(trouble(8, 99).unwrap().contains("cannot be watched"));
    }

    #[test]
    fn a_hand_is_not_followed_into_another_round_nor_over_a_pause() {
        let motion = MotionConfig { enabled: false, ..MotionConfig::default() };
        let config = SightConfig { camera: CameraModel::laptop(), layer: LayerConfig::ALL, motion };
        let mut sight = Sight::new(config, FeatureSet::Embedding).unwrap();
        let mut side = |image: &Mat, ms: u64, judge: bool| {
            let taken = sight.take(&Frame { image: image.clone(), at: Duration::from_millis(ms) }, judge);
            taken.observation.map(|seen| {
                seen.unwrap();
                sight.perception().region().x > image.cols() / 4
            })
        };
        let both = hands(&[true, true]);
        let first = side(&both, 0, true).unwrap();
        // The other hand alone, and then both.
        let other = hands(&[first, !first]);
        let mut next = |at: u64, later: u64, pause: bool| {
            assert_eq!(side(&other, at, true), Some(!first));
            if pause {
                assert_eq!(side(&both, at + 1, false), None);
            }
            side(&both, at + later, true).unwrap()
        };
        assert_eq!(next(2000, 33, false), !first, "it is followed");
        assert_eq!(next(3000, 900, false), !first, "over a short pause too");
        assert_eq!(next(4000, 1001, false), first, "not over a long one");
        assert_eq!(next(6000, 33, true), first, "nor into a round that opens");
    }
}
