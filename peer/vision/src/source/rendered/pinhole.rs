//! What a pinhole camera makes of space.

use nalgebra::{Point3, Vector3};

use crate::camera_model::CameraModel;
use crate::pose::Pose;

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
}
