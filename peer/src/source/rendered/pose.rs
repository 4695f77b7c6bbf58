//! Where robots stand around the human, and what a pinhole camera there makes of space.

use nalgebra::{Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::camera_model::CameraModel;

/// Where a camera is, seen from the hand; it looks at the hand.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pose {
    /// Around the vertical, in degrees: 0 faces the palm, ±90 sees the hand edge on.
    pub bearing_deg: f64,
    /// Above the hand's height, in degrees: negative looks up from the floor.
    pub elevation_deg: f64,
    /// From the palm, in metres.
    pub distance_m: f64,
}

impl Pose {
    /// Before the palm, at its height, a good arm's length away.
    pub const FRONTAL: Self = Self { bearing_deg: 0.0, elevation_deg: 0.0, distance_m: 0.8 };

    /// The position, in metres, with the palm at the origin, x to the right of who faces the palm, y up, z towards them.
    pub(super) fn position(&self) -> Point3<f32> {
        let (bearing, elevation) = (self.bearing_deg.to_radians(), self.elevation_deg.to_radians());
        let at =
            Vector3::new(bearing.sin() * elevation.cos(), elevation.sin(), bearing.cos() * elevation.cos())
                * self.distance_m.max(0.3);
        Point3::from(at.cast())
    }
}

/// Where the robots of a swarm may stand: an arc before the human.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Arc {
    /// The robots spread over plus and minus this bearing, in degrees. Range 0..=90.
    pub half_deg: f64,
    /// Least and greatest elevation, in degrees. Range −60..=60.
    pub elevation_deg: [f64; 2],
    /// Least and greatest distance, in metres. Range 0.4..=3.
    pub distance_m: [f64; 2],
}

impl Default for Arc {
    /// ±75°, most of them looking up from the floor, at 0.6 to 1.15 m: near enough for a Foot-bot to see fingers.
    fn default() -> Self {
        Self { half_deg: 75.0, elevation_deg: [-25.0, 12.0], distance_m: [0.6, 1.15] }
    }
}

impl Arc {
    /// Places robots evenly over the arc, from the left to the right, each a little off its place. The same seed
    /// gives the same places.
    #[must_use]
    pub fn place(&self, robots: usize, seed: u64) -> Vec<Pose> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let sector = 2.0 * self.half_deg / robots.max(1) as f64;
        let mut between = |[low, high]: [f64; 2]| low + (high - low) * rng.random::<f64>();
        (0..robots)
            .map(|i| Pose {
                bearing_deg: sector * (i as f64 + 0.5 + between([-0.4, 0.4])) - self.half_deg,
                elevation_deg: between(self.elevation_deg),
                distance_m: between(self.distance_m),
            })
            .collect()
    }
}

/// Places robots on the default [`Arc`].
#[must_use]
pub fn place(robots: usize, seed: u64) -> Vec<Pose> {
    Arc::default().place(robots, seed)
}

/// A pinhole camera in the hand's space.
pub(in crate::source) struct Pinhole {
    position: Point3<f32>,
    right: Vector3<f32>,
    up: Vector3<f32>,
    forward: Vector3<f32>,
    focal_px: f32,
    centre_px: (f32, f32),
}

/// A point of space as the camera has it: place in the image and depth along the optical axis.
#[derive(Clone, Copy, Debug)]
pub(in crate::source) struct Projected {
    /// Pixels from the left.
    pub x: f32,
    /// Pixels from the top.
    pub y: f32,
    /// Metres from the camera.
    pub depth: f32,
}

impl Pinhole {
    /// The camera at this pose, its optical axis through `target`, turned by `roll` radians about that axis.
    pub fn new(pose: &Pose, camera: &CameraModel, target: Point3<f32>, roll: f32) -> Self {
        let position = pose.position();
        let forward = (target - position).normalize();
        // Straight above or below the hand "up" has no direction across the image; any other axis will do.
        let vertical = if forward.y.abs() > 0.999 { Vector3::z() } else { Vector3::y() };
        let level = forward.cross(&vertical).normalize();
        let upright = level.cross(&forward);
        Self {
            position,
            right: level * roll.cos() + upright * roll.sin(),
            up: upright * roll.cos() - level * roll.sin(),
            forward,
            focal_px: camera.focal_px() as f32,
            centre_px: (camera.width_px as f32 / 2.0, camera.height_px as f32 / 2.0),
        }
    }

    /// Where a point appears.
    pub fn project(&self, point: &Point3<f32>) -> Projected {
        let from_camera = point - self.position;
        // Nothing of a scene is nearer than 5 cm; the bound keeps the division sane.
        let depth = from_camera.dot(&self.forward).max(0.05);
        Projected {
            x: self.centre_px.0 + self.focal_px * from_camera.dot(&self.right) / depth,
            y: self.centre_px.1 - self.focal_px * from_camera.dot(&self.up) / depth,
            depth,
        }
    }

    /// How many pixels a length across the line of sight covers at that depth.
    pub fn scale_px_per_m(&self, depth: f32) -> f32 {
        self.focal_px / depth
    }

    /// A direction of space in the camera's axes: right, down, towards the camera.
    pub fn direction(&self, direction: &Vector3<f32>) -> Vector3<f32> {
        Vector3::new(direction.dot(&self.right), -direction.dot(&self.up), -direction.dot(&self.forward))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_target_appears_in_the_centre_and_its_right_on_the_right() {
        let camera = CameraModel::footbot();
        let pinhole = Pinhole::new(&Pose::FRONTAL, &camera, Point3::origin(), 0.0);
        let centre = pinhole.project(&Point3::origin());
        assert!((centre.x - 192.0).abs() < 1e-3 && (centre.y - 144.0).abs() < 1e-3);
        assert!((centre.depth - 0.8).abs() < 1e-6);
        let beside = pinhole.project(&Point3::new(0.1, 0.05, 0.0));
        assert!(beside.x > centre.x && beside.y < centre.y);
        let expected = camera.focal_px() as f32 * 0.1 / 0.8;
        assert!((beside.x - centre.x - expected).abs() < 1e-3);
    }

    #[test]
    fn robots_stand_on_the_arc_in_order_and_apart() {
        let poses = place(10, 3);
        assert_eq!(poses.len(), 10);
        assert!(poses.windows(2).all(|pair| pair[0].bearing_deg < pair[1].bearing_deg));
        assert!(poses.iter().all(|pose| pose.bearing_deg.abs() <= 75.0));
        assert_eq!(poses, place(10, 3));
        assert_ne!(poses, place(10, 4));
        let far = Arc { distance_m: [2.0, 2.5], ..Arc::default() }.place(5, 3);
        assert!(far.iter().all(|pose| (2.0..=2.5).contains(&pose.distance_m)));
    }
}
