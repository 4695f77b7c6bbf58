//! A dataset's picture as a robot would have seen it: perspective, distance, and the camera's faults.

use nalgebra::{Point3, Vector3};
use opencv::core::{self, Mat, Point2f, Scalar, Size, Vector};
use opencv::imgproc;
use opencv::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::rendered::Pinhole;
use super::{Sensor, SourceError};
use crate::camera_model::CameraModel;
use crate::pose::Pose;

/// Turns pictures of a hand, taken from the front, into views of one camera from one pose.
///
/// The picture stands upright at the hand's place, as a flat thing: perspective, foreshortening and scale are those
/// of the pose, but fingers do not hide each other as those of a hand in space would.
pub struct EmulatedView {
    camera: CameraModel,
    pose: Pose,
    picture_height_m: f64,
    sensor: Sensor,
    rng: ChaCha8Rng,
}

impl EmulatedView {
    /// A camera at that pose before pictures that show `picture_height_m` metres from bottom to top (about 0.25 for a
    /// hand that fills them). The seed draws noise and the small differences of aim from picture to picture.
    ///
    /// # Errors
    /// [`SourceError::Camera`] or [`SourceError::Pose`] when a field of either is out of its range.
    pub fn new(
        camera: CameraModel,
        pose: Pose,
        picture_height_m: f64,
        seed: u64,
    ) -> Result<Self, SourceError> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        pose.validate()?;
        let sensor = Sensor::new(&camera, &mut rng)?;
        Ok(Self { camera, pose, picture_height_m: picture_height_m.clamp(0.05, 10.0), sensor, rng })
    }

    /// The view of this picture (BGR, 8 bits). Around it, its edge goes on.
    ///
    /// # Errors
    /// [`SourceError::OpenCv`] when the picture is empty or of another type.
    pub fn view(&mut self, picture: &Mat) -> Result<Mat, SourceError> {
        let off = 0.05 * self.pose.distance_m as f32;
        let aim = Point3::origin() + Vector3::from_fn(|_, _| self.rng.random_range(-off..off));
        let roll = self.rng.random_range(-3.0_f32..3.0).to_radians();
        let pinhole = Pinhole::new(&self.pose, &self.camera, aim, roll);

        let picture = self.near_target_scale(picture)?;
        let (width, height) = (picture.cols() as f32, picture.rows() as f32);
        let half_height = self.picture_height_m as f32 / 2.0;
        let half_width = half_height * width / height;
        let corners = [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)];
        let from: Vector<Point2f> = corners
            .iter()
            .map(|(x, y)| Point2f::new((x + 1.0) / 2.0 * width, (1.0 - y) / 2.0 * height))
            .collect();
        let to: Vector<Point2f> = corners
            .iter()
            .map(|(x, y)| {
                let corner = pinhole.project(&Point3::new(x * half_width, y * half_height, 0.0));
                Point2f::new(corner.x, corner.y)
            })
            .collect();
        let homography = imgproc::get_perspective_transform(&from, &to, core::DECOMP_LU)?;
        let mut view = Mat::default();
        let size = Size::new(self.camera.width_px, self.camera.height_px);
        let border = core::BORDER_REPLICATE;
        imgproc::warp_perspective(
            &picture,
            &mut view,
            &homography,
            size,
            imgproc::INTER_LINEAR,
            border,
            Scalar::default(),
        )?;
        self.sensor.expose(&view, &mut self.rng)
    }

    /// The picture, reduced to at most twice the size at which the camera sees it: the warp interpolates between
    /// neighbours and would skip pixels of a larger one.
    fn near_target_scale(&self, picture: &Mat) -> Result<Mat, SourceError> {
        let seen_px = self.camera.focal_px() * self.picture_height_m / self.pose.distance_m;
        let scale = 2.0 * seen_px / f64::from(picture.rows().max(1));
        if scale >= 1.0 {
            return Ok(picture.clone());
        }
        let mut reduced = Mat::default();
        let size = Size::new(
            (f64::from(picture.cols()) * scale).round().max(2.0) as i32,
            (f64::from(picture.rows()) * scale).round().max(2.0) as i32,
        );
        imgproc::resize(picture, &mut reduced, size, 0.0, 0.0, imgproc::INTER_AREA)?;
        Ok(reduced)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A white disc on black.
    fn disc() -> Mat {
        let mut picture = Mat::new_rows_cols_with_default(400, 400, core::CV_8UC3, Scalar::all(0.0)).unwrap();
        let centre = core::Point::new(200, 200);
        imgproc::circle(&mut picture, centre, 100, Scalar::all(255.0), imgproc::FILLED, imgproc::LINE_8, 0)
            .unwrap();
        picture
    }

    /// Width and height of what is bright in the view from that pose.
    fn seen(pose: Pose) -> (f64, f64) {
        let mut view = EmulatedView::new(CameraModel::laptop(), pose, 0.4, 3).unwrap().view(&disc()).unwrap();
        let mut grey = Mat::default();
        imgproc::cvt_color_def(&view, &mut grey, imgproc::COLOR_BGR2GRAY).unwrap();
        imgproc::threshold(&grey, &mut view, 90.0, 255.0, imgproc::THRESH_BINARY).unwrap();
        let bounds = imgproc::bounding_rect(&view).unwrap();
        (f64::from(bounds.width), f64::from(bounds.height))
    }

    #[test]
    fn twice_as_far_is_half_as_large() {
        let (near, _) = seen(Pose::FRONTAL);
        let (far, _) = seen(Pose { distance_m: 1.6, ..Pose::FRONTAL });
        // A disc of 20 cm at 0.8 m.
        let expected = CameraModel::laptop().focal_px() * 0.2 / 0.8;
        assert!((near - expected).abs() < 4.0, "{near} {expected}");
        assert!((near / far - 2.0).abs() < 0.1, "{near} {far}");
    }

    #[test]
    fn the_bearing_foreshortens_by_its_cosine() {
        let (width, height) = seen(Pose { bearing_deg: 60.0, distance_m: 1.5, ..Pose::FRONTAL });
        assert!((width / height - 0.5).abs() < 0.06, "{width} {height}");
    }

    #[test]
    fn an_empty_picture_is_an_error() {
        let mut view = EmulatedView::new(CameraModel::footbot(), Pose::FRONTAL, 0.3, 1).unwrap();
        assert!(view.view(&Mat::default()).is_err());
    }
}
