//! Labelled frames without end, to train the embedded classifier.

use std::sync::Arc;
use std::time::Duration;

use opencv::core::Mat;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Glove, RenderedSource};
use crate::camera_model::CameraModel;
use crate::pose::Pose;
use crate::source::{Scene, Source, SourceError};
use crate::vocabulary::HandPose;

/// A frame whose gesture is known.
#[derive(Clone, Debug)]
pub struct LabelledFrame {
    /// The picture (BGR, 8 bits).
    pub image: Mat,
    /// How many fingers are raised, 0 to 5; or which pose is shown, where poses are.
    pub class: u8,
    /// The person: frames of one person belong to the same side of a train/test split.
    pub group: u32,
    /// Which camera took it.
    pub camera: String,
    /// From where.
    pub pose: Pose,
}

/// An endless iterator of labelled frames: each person shows 0 to 5 in turn, each from a pose of its own, to the
/// cameras in turn, each frame by another specimen of the camera. The same seed gives the same frames.
///
/// Poses cover what robots meet: bearing within ±`max_bearing_deg`, elevation −30° to 20°, 0.5 to 1.3 m.
pub struct TrainingFrames {
    cameras: Vec<CameraModel>,
    glove: Glove,
    max_bearing_deg: f64,
    /// What is shown, where it is not 0 to 5 fingers.
    poses: Option<Arc<[HandPose]>>,
    seed: u64,
    rng: ChaCha8Rng,
    next: u64,
}

impl TrainingFrames {
    /// Frames of these cameras (all presets when there are none) up to that bearing.
    #[must_use]
    pub fn new(cameras: Vec<CameraModel>, glove: Glove, max_bearing_deg: f64, seed: u64) -> Self {
        let cameras = if cameras.is_empty() { CameraModel::presets().to_vec() } else { cameras };
        Self {
            cameras,
            glove,
            max_bearing_deg: max_bearing_deg.clamp(1.0, 90.0),
            poses: None,
            seed,
            rng: ChaCha8Rng::seed_from_u64(seed),
            next: 0,
        }
    }

    /// Each person shows these in turn, not 0 to 5; without any there is nothing to be seen.
    #[must_use]
    pub fn showing(self, poses: Vec<HandPose>) -> Self {
        Self { poses: Some(poses.into()), ..self }
    }
}

impl Iterator for TrainingFrames {
    type Item = Result<LabelledFrame, SourceError>;

    fn next(&mut self) -> Option<Self::Item> {
        let gestures = self.poses.as_ref().map_or(6, |poses| poses.len() as u64);
        let person = self.next.checked_div(gestures)?;
        let class = (self.next % gestures) as u8;
        let model = &self.cameras[(person % self.cameras.len() as u64) as usize];
        self.next += 1;
        let rng = &mut self.rng;
        let camera = model.specimen(rng);
        let pose = Pose {
            bearing_deg: rng.random_range(-self.max_bearing_deg..self.max_bearing_deg),
            elevation_deg: rng.random_range(-30.0..20.0),
            distance_m: rng.random_range(0.5..1.3),
        };
        let scene = Scene { gesture: Some(class), seed: self.seed.rotate_left(24) ^ person };
        let taken = RenderedSource::new(camera, pose, self.glove, rng.random())
            .map(|source| match &self.poses {
                Some(poses) => source.showing(poses.clone()),
                None => source,
            })
            .and_then(|mut source| source.next_frame(Duration::ZERO, &scene));
        Some(taken.map(|frame| LabelledFrame {
            image: frame.image,
            class,
            group: person as u32,
            camera: model.name.clone(),
            pose,
        }))
    }
}

#[cfg(test)]
mod tests {
    use opencv::prelude::*;

    use super::*;

    fn frames(seed: u64) -> Vec<LabelledFrame> {
        let cameras = vec![CameraModel::footbot(), CameraModel::parrot()];
        TrainingFrames::new(cameras, Glove::Cyan, 60.0, seed).take(18).map(Result::unwrap).collect()
    }

    #[test]
    fn every_person_shows_every_count_to_one_camera_model() {
        let frames = frames(1);
        for (i, frame) in frames.iter().enumerate() {
            assert_eq!((frame.class, frame.group), ((i % 6) as u8, (i / 6) as u32));
            assert_eq!(frame.camera, ["footbot", "parrot"][i / 6 % 2]);
            assert!(frame.pose.bearing_deg.abs() <= 60.0);
        }
        assert_eq!((frames[0].image.cols(), frames[6].image.cols()), (384, 640));
    }

    #[test]
    fn people_show_the_poses_of_a_vocabulary_in_turn() {
        let training =
            |poses| TrainingFrames::new(vec![CameraModel::footbot()], Glove::Cyan, 60.0, 1).showing(poses);
        let shown: Vec<_> = training(vec![HandPose::default(); 7]).take(15).map(Result::unwrap).collect();
        let seen: Vec<_> = shown.iter().map(|frame| (u32::from(frame.class), frame.group)).collect();
        assert_eq!(seen, (0..15).map(|n| (n % 7, n / 7)).collect::<Vec<_>>());
        assert!(training(Vec::new()).next().is_none());
    }

    #[test]
    fn a_seed_fixes_every_frame() {
        let bytes = |seed| frames(seed).last().unwrap().image.data_bytes().unwrap().to_vec();
        assert_eq!(bytes(1), bytes(1));
        assert_ne!(bytes(1), bytes(2));
    }
}
