//! The rendered source: a drawn, gloved hand as a camera of any model sees it from any pose.
//!
//! It needs no data and no device. The hand is a skeleton in space (`hand`), seen through a pinhole (`pinhole`), drawn
//! with depth and light (`raster`) before a room (`backdrop`), and exposed by the camera's sensor. How hard a view
//! is to read follows from the pose alone: from the side the fingers hide each other, from afar they are few pixels.

mod backdrop;
mod hand;
mod pinhole;
mod raster;
mod scheduled;
mod training;

use std::sync::Arc;
use std::time::Duration;

use nalgebra::{Point3, Vector3};
use opencv::core::Mat;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub(super) use pinhole::Pinhole;
pub use scheduled::ScheduledSource;
pub use training::{LabelledFrame, TrainingFrames};

use hand::{Capsule, Hand};
use raster::{Light, Rasterizer};

use super::{Frame, Scene, Sensor, Source, SourceError};
use crate::camera_model::CameraModel;
pub use crate::config::Glove;
use crate::pose::Pose;
use crate::vocabulary::HandPose;

/// A robot's camera in a drawn world. The same seed, scenes and frame numbers give the same frames, byte for byte.
pub struct RenderedSource {
    camera: CameraModel,
    pose: Pose,
    glove: Glove,
    /// The ways in which the human holds their hand, where they do not count fingers.
    poses: Option<Arc<[HandPose]>>,
    seed: u64,
    /// What stands behind the human, as long as the robot stands still.
    room: Mat,
    sensor: Sensor,
    rasterizer: Rasterizer,
    stage: Option<Stage>,
    frame: u64,
    /// How far the human is from their place.
    away: Vector3<f32>,
}

/// What stays the same while a scene lasts.
struct Stage {
    scene: Scene,
    hand: Option<Hand>,
    backdrop: Mat,
    light: Light,
    /// Where the robot looks, beside the palm, in metres, and how it is tilted, in radians.
    aim: Point3<f32>,
    roll: f32,
}

impl RenderedSource {
    /// A camera at that pose; `seed` tells robots with equal cameras apart.
    ///
    /// # Errors
    /// [`SourceError::Camera`] or [`SourceError::Pose`] when a field of either is out of its range.
    pub fn new(camera: CameraModel, pose: Pose, glove: Glove, seed: u64) -> Result<Self, SourceError> {
        pose.validate()?;
        let rng = &mut stream(seed, 0);
        let sensor = Sensor::new(&camera, rng)?;
        let room = backdrop::paint(&camera, rng)?;
        Ok(Self {
            room,
            camera,
            pose,
            glove,
            poses: None,
            seed,
            sensor,
            rasterizer: Rasterizer::default(),
            stage: None,
            frame: 0,
            away: Vector3::zeros(),
        })
    }

    /// Before a human who shows the gestures of a vocabulary: a [`Scene`]'s gesture is the number of one of these poses.
    #[must_use]
    pub fn showing(self, poses: Arc<[HandPose]>) -> Self {
        Self { poses: Some(poses), stage: None, ..self }
    }

    /// Where the camera is.
    #[must_use]
    pub fn pose(&self) -> &Pose {
        &self.pose
    }

    /// Moves the camera.
    ///
    /// # Errors
    /// [`SourceError::Pose`] when a field is out of its range; the camera stays where it is.
    pub fn set_pose(&mut self, pose: Pose) -> Result<(), SourceError> {
        pose.validate()?;
        self.pose = pose;
        self.stage = None;
        Ok(())
    }

    /// Moves the human, who comes in from one side and below, to that distance from their place.
    pub fn move_hand(&mut self, away_m: f32) {
        let away = Vector3::new(0.6, -0.8, 0.0) * away_m;
        if away != self.away {
            self.away = away;
            self.stage = None;
        }
    }

    /// Where the human's parts are.
    fn moved(&self, mut parts: Vec<Capsule>) -> Vec<Capsule> {
        for part in &mut parts {
            part.from += self.away;
            part.to += self.away;
        }
        parts
    }

    fn hand(&self, gesture: u8, person: u64) -> Result<Hand, SourceError> {
        match &self.poses {
            Some(poses) => {
                let pose = poses
                    .get(usize::from(gesture))
                    .ok_or(SourceError::NotInVocabulary(gesture, poses.len()))?;
                Ok(Hand::posed(*pose, person, self.glove))
            }
            None if gesture > 5 => Err(SourceError::Gesture(gesture)),
            None => Ok(Hand::new(gesture, person, self.glove)),
        }
    }

    fn stage(&mut self, scene: &Scene) -> Result<Stage, SourceError> {
        let hand = scene.gesture.map(|gesture| self.hand(gesture, scene.seed)).transpose()?;
        // The light belongs to the scene, the aim to the robot in it.
        let light = light(&mut stream(scene.seed, 1));
        let rng = &mut stream(self.seed ^ scene.seed.rotate_left(32), 2);
        let off = 0.09 * self.pose.distance_m as f32;
        let aim = Point3::new(rng.random_range(-off..off), rng.random_range(-off..off) + 0.02, 0.0);
        let roll = rng.random_range(-4.0_f32..4.0).to_radians();
        let mut backdrop = self.room.clone();
        if let Some(hand) = &hand {
            let pinhole = Pinhole::new(&self.pose, &self.camera, aim, roll);
            let body = self.moved(hand.body());
            self.rasterizer.draw(&mut backdrop, &body, &pinhole, &light)?;
        }
        Ok(Stage { scene: *scene, hand, backdrop, light, aim, roll })
    }
}

impl Source for RenderedSource {
    fn describe(&self) -> String {
        "rendered".into()
    }

    fn period(&self) -> Duration {
        self.camera.period()
    }

    fn next_frame(&mut self, now: Duration, scene: &Scene) -> Result<Frame, SourceError> {
        let stage = match self.stage.take() {
            Some(stage) if stage.scene == *scene => stage,
            _ => self.stage(scene)?,
        };
        let frame = self.frame;
        self.frame += 1;
        let rng = &mut stream(self.seed ^ scene.seed.rotate_left(32), 3 + frame);
        let mut picture = stage.backdrop.clone();
        if let Some(hand) = &stage.hand {
            let seconds = frame as f32 * self.camera.period().as_secs_f32();
            let shake = 0.004 * self.pose.distance_m as f32;
            let aim = stage.aim + Vector3::from_fn(|_, _| rng.random_range(-shake..shake));
            let pinhole = Pinhole::new(&self.pose, &self.camera, aim, stage.roll);
            let parts = self.moved(hand.capsules(seconds));
            self.rasterizer.draw(&mut picture, &parts, &pinhole, &stage.light)?;
        }
        self.stage = Some(stage);
        Ok(Frame { image: self.sensor.expose(&picture, rng)?, at: now })
    }
}

/// An independent generator for each use of a seed.
fn stream(seed: u64, number: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(number);
    rng
}

/// A lamp above and before the hand, of ordinary colour.
fn light(rng: &mut impl Rng) -> Light {
    let towards =
        Vector3::new(rng.random_range(-0.7..0.7), rng.random_range(0.3..1.0), rng.random_range(0.5..1.2));
    let warmth: f32 = rng.random_range(-0.07..0.07);
    let brightness: f32 = rng.random_range(0.85..1.1);
    Light {
        towards: towards.normalize(),
        ambient: rng.random_range(0.4..0.6),
        tint: [brightness * (1.0 - warmth), brightness, brightness * (1.0 + warmth)],
    }
}

#[cfg(test)]
mod tests {
    use opencv::core::Vec3b;
    use opencv::prelude::*;

    use super::*;
    use crate::perception::{FeatureSet, HandConfig, NoObservation, Perception};

    fn frames(pose: Pose, scene: Scene, seed: u64, count: usize) -> Vec<Vec<u8>> {
        let mut source = RenderedSource::new(CameraModel::footbot(), pose, Glove::Cyan, seed).unwrap();
        let mut next =
            || source.next_frame(Duration::ZERO, &scene).unwrap().image.data_bytes().unwrap().to_vec();
        (0..count).map(|_| next()).collect()
    }

    /// Pixels whose blue and green stand well above their red: the glove.
    fn glove_pixels(pose: Pose, gesture: Option<u8>) -> usize {
        let camera = CameraModel { cast_bgr: [1.0; 3], ..CameraModel::laptop() };
        let mut source = RenderedSource::new(camera, pose, Glove::Cyan, 5).unwrap();
        let frame = source.next_frame(Duration::ZERO, &Scene { gesture, seed: 9 }).unwrap();
        let gloved = |pixel: &&Vec3b| i32::from(pixel[0].min(pixel[1])) - i32::from(pixel[2]) > 40;
        frame.image.data_typed::<Vec3b>().unwrap().iter().filter(gloved).count()
    }

    #[test]
    fn the_same_seed_gives_the_same_bytes_and_another_seed_others() {
        let scene = Scene { gesture: Some(3), seed: 11 };
        assert_eq!(frames(Pose::FRONTAL, scene, 1, 3), frames(Pose::FRONTAL, scene, 1, 3));
        assert_ne!(frames(Pose::FRONTAL, scene, 1, 1), frames(Pose::FRONTAL, scene, 2, 1));
    }

    #[test]
    fn frames_of_one_scene_are_alike_but_not_equal() {
        let scene = Scene { gesture: Some(2), seed: 4 };
        let [a, b] = frames(Pose::FRONTAL, scene, 1, 2).try_into().unwrap();
        assert_ne!(a, b);
        let difference: u64 = a.iter().zip(&b).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
        assert!(difference / (a.len() as u64) < 10);
        // Nothing moves in an empty room, but the noise.
        let [a, b] = frames(Pose::FRONTAL, Scene { gesture: None, ..scene }, 1, 2).try_into().unwrap();
        assert_ne!(a, b);
    }

    #[test]
    fn a_hand_is_in_view_exactly_when_the_scene_has_one() {
        assert_eq!(glove_pixels(Pose::FRONTAL, None), 0);
        let near = glove_pixels(Pose::FRONTAL, Some(5));
        let far = glove_pixels(Pose { distance_m: 1.6, ..Pose::FRONTAL }, Some(5));
        assert!(far > 500, "{far}");
        // Twice as far is a quarter of the area.
        assert!((3.0..5.0).contains(&(near as f64 / far as f64)), "{near} {far}");
    }

    #[test]
    fn perception_finds_the_hand_in_every_frontal_view_and_none_in_an_empty_room() {
        let mut perception = Perception::new(FeatureSet::Shape, HandConfig::default()).unwrap();
        for (camera, glove) in CameraModel::presets()
            .into_iter()
            .flat_map(|camera| [Glove::Cyan, Glove::Orange].map(|glove| (camera.clone(), glove)))
        {
            for seed in 0..3 {
                let mut source = RenderedSource::new(camera.clone(), Pose::FRONTAL, glove, seed).unwrap();
                for count in 0..=5 {
                    let scene = Scene { gesture: Some(count), seed };
                    let frame = source.next_frame(Duration::ZERO, &scene).unwrap();
                    let seen = perception.observe(&frame.image);
                    assert!(seen.is_ok(), "{} {glove:?} {scene:?}: {seen:?}", camera.name);
                }
                let empty = source.next_frame(Duration::ZERO, &Scene { gesture: None, seed }).unwrap();
                let seen = perception.observe(&empty.image);
                assert!(matches!(seen, Err(NoObservation::NoHand(_))), "{} {seen:?}", camera.name);
            }
        }
    }

    #[test]
    fn from_the_side_less_of_the_hand_is_seen() {
        let side = Pose { bearing_deg: 80.0, ..Pose::FRONTAL };
        assert!(glove_pixels(side, Some(5)) < glove_pixels(Pose::FRONTAL, Some(5)) * 2 / 3);
    }

    #[test]
    fn six_fingers_are_refused() {
        let mut source = RenderedSource::new(CameraModel::footbot(), Pose::FRONTAL, Glove::Cyan, 1).unwrap();
        let scene = Scene { gesture: Some(6), seed: 1 };
        assert!(matches!(source.next_frame(Duration::ZERO, &scene), Err(SourceError::Gesture(6))));
        let mut source = source.showing(vec![HandPose::default(); 7].into());
        assert!(source.next_frame(Duration::ZERO, &scene).is_ok());
        let scene = Scene { gesture: Some(7), seed: 1 };
        let refused = source.next_frame(Duration::ZERO, &scene);
        assert!(matches!(refused, Err(SourceError::NotInVocabulary(7, 7))));
    }
}
