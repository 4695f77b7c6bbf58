//! Comparable blur and noise, whatever the camera: what its optics and sensor left sharp or noisy is smoothed to one
//! measure in the pixels of the close view, where all hands are of one size.

use std::f32::consts::PI;

use opencv::core::{BORDER_REPLICATE, Mat, MatTraitConst, MatTraitConstManual, Rect, Size};
use opencv::imgproc::gaussian_blur;

use super::frame::View;
use crate::camera_model::CameraModel;

/// The blur that all close views are brought to, as the standard deviation of a Gaussian in pixels of the view.
const BLUR: f32 = 1.2;
/// The noise that may be left, in grey levels.
const NOISE: f32 = 2.0;
/// No noise is worth more smoothing than this: fingers are 12 to 20 pixels wide.
const MOST: f32 = 4.0;
/// Less smoothing than this changes nothing.
const LEAST: f32 = 0.4;
/// A pixel averages the light over its square: the standard deviation of a uniform distribution, in pixels.
const PIXEL: f32 = 0.29;
/// Rows of the frame in which noise is measured.
const ROWS: i32 = 48;

/// What a camera blurs and adds to the light, in its own pixels.
pub struct Resolution {
    enabled: bool,
    /// The image's width and blur as the camera's model has them.
    optics: Option<(f32, f32)>,
    /// Noise to be expected, grey levels; what is measured may be more.
    noise: f32,
    smoothed: Mat,
}

impl Resolution {
    /// Of a known camera, or of any.
    pub fn new(enabled: bool, camera: Option<&CameraModel>) -> Self {
        let optics = camera.map(|camera| (camera.width_px as f32, camera.blur_sigma_px as f32));
        let noise = camera.map_or(0.0, |camera| camera.noise_sigma as f32);
        Self { enabled, optics, noise, smoothed: Mat::default() }
    }

    /// Smooths a view of the frame as much as it needs; `scale`: pixels of the frame per pixel of the camera.
    pub fn even_out(&mut self, frame: &Mat, view: &mut View, scale: f32) -> Result<(), opencv::Error> {
        if !self.enabled {
            return Ok(());
        }
        let of_frame = view.scale();
        let of_camera = of_frame * scale;
        let noise = (noise(frame, view.region)? * of_frame).max(self.noise * of_camera);
        let sigma = self.smoothing(view.frame.width as f32 / scale, noise, of_camera);
        if sigma < LEAST {
            return Ok(());
        }
        let side = 2 * (2.5 * sigma).ceil() as i32 + 1;
        let (size, sigma) = (Size::new(side, side), f64::from(sigma));
        gaussian_blur(&view.image, &mut self.smoothed, size, sigma, sigma, BORDER_REPLICATE)?;
        std::mem::swap(&mut view.image, &mut self.smoothed);
        Ok(())
    }

    /// The standard deviation of the Gaussian that is still missing, in pixels of the view; `width`: of the camera's image; `noise`: grey levels,
    /// times the pixels of the view per pixel that they were measured in; `scale`: pixels of the view per pixel of the camera.
    fn smoothing(&self, width: f32, noise: f32, scale: f32) -> f32 {
        // Of the same optics before another sensor, the blur is a share of the image's width.
        let blur = self.optics.map_or(0.0, |(of_model, blur)| blur * width / of_model);
        let own = blur.hypot(PIXEL) * scale;
        let to_the_measure = (BLUR * BLUR - own * own).max(0.0).sqrt();
        // White noise of pixels, enlarged, behind a Gaussian: σ scale / (2 √π σ_Gauss).
        let against_noise = noise / (2.0 * PI.sqrt() * NOISE);
        to_the_measure.max(against_noise).min(MOST)
    }
}

/// The standard deviation of the noise in a part of the frame's green channel, in grey levels: the median magnitude of
/// a difference of two Laplacians, which edges hardly move (J. Immerkær, 1996, who takes the mean).
fn noise(frame: &Mat, part: Rect) -> Result<f32, opencv::Error> {
    let (first, end) = (part.y + 1, part.y + part.height - 1);
    let step = ((end - first) / ROWS).max(1);
    let mut histogram = [0_u32; 1024];
    let mut count = 0;
    for y in (first..end).step_by(step as usize) {
        let row = |y: i32| -> Result<&[u8], opencv::Error> {
            let whole = frame.data_bytes()?;
            let start = 3 * (y * frame.cols() + part.x) as usize;
            Ok(&whole[start..start + 3 * part.width as usize])
        };
        let (above, here, below) = (row(y - 1)?, row(y)?, row(y + 1)?);
        for x in (4..above.len().saturating_sub(3)).step_by(3) {
            let v = |row: &[u8], x: usize| i32::from(row[x]);
            let corners = v(above, x - 3) + v(above, x + 3) + v(below, x - 3) + v(below, x + 3);
            let sides = v(above, x) + v(below, x) + v(here, x - 3) + v(here, x + 3);
            let response = corners - 2 * sides + 4 * v(here, x);
            histogram[response.unsigned_abs().min(1023) as usize] += 1;
            count += 1;
        }
    }
    let mut below = 0;
    let middle = histogram.iter().position(|n| {
        below += n;
        2 * below > count
    });
    // The response of unit noise has a standard deviation of 6; of a normal distribution, half lies within 0.6745.
    Ok(middle.unwrap_or(0) as f32 / (6.0 * 0.6745))
}

#[cfg(test)]
mod tests {
    use opencv::core::{CV_8UC3, CV_16SC3, Scalar, add, no_array, randn, set_rng_seed};
    use opencv::imgproc::{FILLED, LINE_8, circle};

    use super::*;

    fn noisy(sigma: f64) -> Mat {
        let mut scene = Mat::new_rows_cols_with_default(200, 300, CV_8UC3, Scalar::all(120.0)).unwrap();
        // Edges, which are no noise.
        for x in (0..300).step_by(30) {
            let centre = opencv::core::Point::new(x, 100);
            circle(&mut scene, centre, 12, Scalar::all(200.0), FILLED, LINE_8, 0).unwrap();
        }
        set_rng_seed(3).unwrap();
        let mut noise = Mat::new_rows_cols_with_default(200, 300, CV_16SC3, Scalar::all(0.0)).unwrap();
        randn(&mut noise, &Scalar::all(0.0), &Scalar::all(sigma)).unwrap();
        let mut picture = Mat::default();
        add(&scene, &noise, &mut picture, &no_array(), opencv::core::CV_8U).unwrap();
        picture
    }

    #[test]
    fn noise_is_measured_and_edges_are_not() {
        for sigma in [0.0, 3.0, 8.0, 15.0] {
            let measured = noise(&noisy(sigma), Rect::new(10, 10, 250, 180)).unwrap();
            assert!((f64::from(measured) - sigma).abs() < 0.1 * sigma + 0.6, "{sigma}: {measured}");
        }
    }

    #[test]
    fn a_frame_that_was_reduced_before_is_smoothed_as_one_that_is_reduced_by_the_view() {
        let camera = CameraModel { blur_sigma_px: 3.0, noise_sigma: 0.0, ..CameraModel::laptop() };
        let (frame, half) = (noisy(0.0), Size::new(150, 100));
        let mut canvas = Mat::default();
        opencv::imgproc::resize(&frame, &mut canvas, half, 0.0, 0.0, opencv::imgproc::INTER_AREA).unwrap();
        let evened = |frame: &Mat, limit: Option<Size>, scale: f32| {
            let mut view = View::new(limit);
            view.look(frame, None, Rect::new(0, 0, frame.cols(), frame.rows())).unwrap();
            Resolution::new(true, Some(&camera)).even_out(frame, &mut view, scale).unwrap();
            view.image
        };
        let (once, before) = (evened(&frame, Some(half), 1.0), evened(&canvas, None, 0.5));
        assert_eq!(opencv::core::norm2_def(&once, &before).unwrap(), 0.0);
        assert!(opencv::core::norm2_def(&once, &canvas).unwrap() > 0.0, "there was something to smooth");
    }

    #[test]
    fn the_sharper_the_camera_the_more_it_is_smoothed_and_noise_asks_for_more() {
        let smoothing = |camera: Option<&CameraModel>, noise, scale| {
            Resolution::new(true, camera).smoothing(640.0, noise * scale, scale)
        };
        let parrot = CameraModel::parrot();
        assert!(smoothing(None, 0.0, 1.0) > smoothing(Some(&parrot), 0.0, 1.0));
        assert!(smoothing(None, 0.0, 0.3) > smoothing(None, 0.0, 3.0));
        assert!(smoothing(None, 8.0, 2.0) > smoothing(None, 2.0, 2.0));
        assert_eq!(smoothing(None, 200.0, 2.0), MOST);
    }
}
