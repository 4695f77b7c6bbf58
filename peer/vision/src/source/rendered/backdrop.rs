//! What stands behind the hand: a wall in uneven light with clutter of little colour, and the person's body.

use opencv::core::{self, Mat, Point, Rect, Scalar, Size, Vec3b};
use opencv::imgproc;
use opencv::prelude::*;
use rand::{Rng, RngExt};

use crate::camera_model::CameraModel;

/// A background of the camera's size, out of focus as things behind the subject are.
///
/// # Errors
/// When OpenCV fails.
pub(super) fn paint(camera: &CameraModel, rng: &mut impl Rng) -> opencv::Result<Mat> {
    let (width, height) = (camera.width_px, camera.height_px);
    let wall: f32 = rng.random_range(105.0..185.0);
    let mut image =
        Mat::new_rows_cols_with_default(height, width, core::CV_8UC3, greyish(f64::from(wall), rng))?;
    for _ in 0..rng.random_range(4..9) {
        clutter(&mut image, rng)?;
    }
    let blur = (f64::from(width) / 200.0).max(0.8);
    let mut soft = Mat::default();
    imgproc::gaussian_blur(&image, &mut soft, Size::new(0, 0), blur, blur, core::BORDER_REFLECT_101)?;
    light_unevenly(&mut soft, rng)?;
    Ok(soft)
}

/// A colour of that lightness with little saturation.
fn greyish(lightness: f64, rng: &mut impl Rng) -> Scalar {
    let mut channel = || (lightness * rng.random_range(0.97..1.03)).clamp(0.0, 255.0);
    Scalar::new(channel(), channel(), channel(), 0.0)
}

/// One thing in the room: a box, a disc, or a pole.
fn clutter(image: &mut Mat, rng: &mut impl Rng) -> opencv::Result<()> {
    let (width, height) = (image.cols(), image.rows());
    let lightness: f64 = rng.random_range(50.0..210.0);
    let colour = greyish(lightness, rng);
    let at = Point::new(rng.random_range(0..width), rng.random_range(0..height));
    match rng.random_range(0..3) {
        0 => {
            let size =
                Size::new(rng.random_range(width / 16..width / 3), rng.random_range(height / 16..height / 2));
            let centred = Rect::from_point_size(at - Point::new(size.width / 2, size.height / 2), size);
            imgproc::rectangle(image, centred, colour, imgproc::FILLED, imgproc::LINE_AA, 0)
        }
        1 => {
            let radius = rng.random_range(height / 24..height / 7);
            imgproc::circle(image, at, radius, colour, imgproc::FILLED, imgproc::LINE_AA, 0)
        }
        _ => {
            let lean = rng.random_range(-width / 8..=width / 8);
            let thickness = rng.random_range(2..(width / 24).max(3));
            let (top, bottom) = (Point::new(at.x + lean, 0), Point::new(at.x, height));
            imgproc::line(image, top, bottom, colour, thickness, imgproc::LINE_AA, 0)
        }
    }
}

/// A gradient of light across the room, and a grain of the wall.
fn light_unevenly(image: &mut Mat, rng: &mut impl Rng) -> opencv::Result<()> {
    let (width, height) = (image.cols() as f32, image.rows() as f32);
    let (slope_x, slope_y): (f32, f32) = (rng.random_range(-0.2..0.2), rng.random_range(-0.2..0.1));
    let across: Vec<f32> = (0..image.cols()).map(|x| 1.0 + slope_x * (x as f32 / width - 0.5)).collect();
    for (y, row) in image.data_typed_mut::<Vec3b>()?.chunks_exact_mut(across.len()).enumerate() {
        let down = slope_y * (y as f32 / height - 0.5);
        for (pixel, across) in row.iter_mut().zip(&across) {
            let light = across + down;
            let grain: f32 = rng.random_range(-3.0..3.0);
            for value in &mut pixel.0 {
                *value = (f32::from(*value) * light + grain) as u8;
            }
        }
    }
    Ok(())
}
