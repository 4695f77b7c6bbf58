//! From a perfect picture to what a camera makes of it.

use std::sync::LazyLock;

use opencv::core::{self, Mat, Point, Rect, Size, no_array};
use opencv::imgproc;
use opencv::prelude::*;
use rand::{Rng, RngExt};

use crate::camera_model::CameraModel;

use super::SourceError;

/// How far the noise pattern is larger than the image, so that a random window of it differs from frame to frame.
const NOISE_MARGIN_PX: i32 = 61;

/// The image sensor of a camera model: blur, vignetting, gain, colour cast and noise.
pub struct Sensor {
    blur_sigma_px: f64,
    /// Grey level in → grey level out, per channel.
    levels: Mat,
    /// A field of Gaussian noise, 16-bit signed; `None` for a noiseless sensor.
    noise: Option<Mat>,
    /// Transmission of the lens at each pixel, 255 for all of the light; `None` for an even lens.
    transmission: Option<Mat>,
    blurred: Mat,
    dimmed: Mat,
    levelled: Mat,
}

impl Sensor {
    /// The sensor of this camera. The generator draws its noise pattern.
    ///
    /// # Errors
    /// [`SourceError::Camera`] when the camera cannot be.
    pub fn new(camera: &CameraModel, rng: &mut impl Rng) -> Result<Self, SourceError> {
        camera.validate()?;
        let noise = if camera.noise_sigma > 0.0 {
            let (rows, columns) = (camera.height_px + NOISE_MARGIN_PX, camera.width_px + NOISE_MARGIN_PX);
            let mut field = Mat::new_rows_cols_with_default(rows, columns, core::CV_16SC3, 0.into())?;
            let values = gaussian_levels(camera.noise_sigma);
            for value in field.data_typed_mut::<core::Vec3s>()? {
                let draw: u32 = rng.random();
                for channel in 0..3 {
                    // Ten bits of the draw for each channel.
                    value[channel] = values[(draw >> (10 * channel)) as usize & 1023];
                }
            }
            Some(field)
        } else {
            None
        };
        Ok(Self {
            blur_sigma_px: camera.blur_sigma_px,
            levels: levels(camera)?,
            noise,
            transmission: if camera.vignetting > 0.0 { Some(transmission(camera)?) } else { None },
            blurred: Mat::default(),
            dimmed: Mat::default(),
            levelled: Mat::default(),
        })
    }

    /// The picture that this sensor takes of a perfect one of the camera's size (BGR, 8 bits).
    ///
    /// # Errors
    /// [`SourceError::OpenCv`] when the image is of another type or size.
    pub fn expose(&mut self, perfect: &Mat, rng: &mut impl Rng) -> Result<Mat, SourceError> {
        let sharp = self.blur_sigma_px < 0.1;
        if !sharp {
            let sigma = self.blur_sigma_px;
            // Three standard deviations to each side.
            let side = 2 * ((3.0 * sigma).ceil() as i32).max(1) + 1;
            let size = Size::new(side, side);
            imgproc::gaussian_blur(perfect, &mut self.blurred, size, sigma, sigma, core::BORDER_REFLECT_101)?;
        }
        let mut picture = if sharp { perfect } else { &self.blurred };
        if let Some(transmission) = &self.transmission {
            core::multiply(picture, transmission, &mut self.dimmed, 1.0 / 255.0, -1)?;
            picture = &self.dimmed;
        }
        core::lut(picture, &self.levels, &mut self.levelled)?;
        let Some(noise) = &self.noise else { return Ok(self.levelled.clone()) };
        let corner = Point::new(rng.random_range(0..NOISE_MARGIN_PX), rng.random_range(0..NOISE_MARGIN_PX));
        let window = Mat::roi(noise, Rect::from_point_size(corner, self.levelled.size()?))?;
        let mut image = Mat::default();
        core::add(&self.levelled, &window, &mut image, &no_array(), core::CV_8U)?;
        Ok(image)
    }
}

/// The table of gain and colour cast.
fn levels(camera: &CameraModel) -> Result<Mat, SourceError> {
    let mut table = Mat::new_rows_cols_with_default(1, 256, core::CV_8UC3, 0.into())?;
    for (level, out) in table.data_typed_mut::<core::Vec3b>()?.iter_mut().enumerate() {
        for channel in 0..3 {
            // A float saturates as it becomes an integer: the sensor is full at 255.
            out[channel] = (level as f64 * camera.gain * camera.cast_bgr[channel]).round() as u8;
        }
    }
    Ok(table)
}

/// Vignetting: falls with the square of the distance from the centre, to 1 − vignetting in the corners.
fn transmission(camera: &CameraModel) -> Result<Mat, SourceError> {
    let (rows, columns) = (camera.height_px, camera.width_px);
    let mut lens = Mat::new_rows_cols_with_default(rows, columns, core::CV_8UC3, 0.into())?;
    let squared = |at: i32, of: i32| (f64::from(at) / f64::from(of) - 0.5).powi(2);
    let along: Vec<f64> = (0..columns).map(|x| squared(x, columns)).collect();
    for (y, row) in (0..).zip(lens.data_typed_mut::<core::Vec3b>()?.chunks_exact_mut(along.len())) {
        let down = squared(y, rows);
        for (out, across) in row.iter_mut().zip(&along) {
            let share = 1.0 - camera.vignetting * 2.0 * (across + down);
            // Rounded: it is a share of the light.
            *out = core::Vec3b::all((255.0 * share + 0.5) as u8);
        }
    }
    Ok(lens)
}

/// The 1024 quantiles of a Gaussian of that standard deviation, rounded to grey levels.
///
/// A sum of twelve uniform variables would need twelve draws a sample; a table needs ten bits.
fn gaussian_levels(sigma: f64) -> Vec<i16> {
    static QUANTILES: LazyLock<Vec<f64>> = LazyLock::new(|| {
        (0..1024).map(|i| standard_normal_quantile((f64::from(i) + 0.5) / 1024.0)).collect()
    });
    QUANTILES.iter().map(|quantile| (sigma * quantile).round() as i16).collect()
}

/// Φ⁻¹(p) to three decimals (Abramowitz and Stegun, 26.2.23).
fn standard_normal_quantile(p: f64) -> f64 {
    let tail = p.min(1.0 - p);
    let t = (-2.0 * tail.ln()).sqrt();
    let z = t
        - (2.515_517 + t * (0.802_853 + t * 0.010_328))
            / (1.0 + t * (1.432_788 + t * (0.189_269 + t * 0.001_308)));
    if p < 0.5 { -z } else { z }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn grey(camera: &CameraModel) -> Mat {
        Mat::new_rows_cols_with_default(
            camera.height_px,
            camera.width_px,
            core::CV_8UC3,
            core::Scalar::all(100.0),
        )
        .unwrap()
    }

    #[test]
    fn grey_takes_on_the_gain_the_cast_and_the_noise_of_the_camera() {
        let camera = CameraModel { vignetting: 0.0, ..CameraModel::footbot() };
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let image = Sensor::new(&camera, &mut rng).unwrap().expose(&grey(&camera), &mut rng).unwrap();
        let (mut mean, mut deviation) = (core::Scalar::default(), core::Scalar::default());
        core::mean_std_dev(&image, &mut mean, &mut deviation, &no_array()).unwrap();
        for channel in 0..3 {
            let expected = 100.0 * camera.gain * camera.cast_bgr[channel];
            assert!((mean[channel] - expected).abs() < 1.0, "{mean:?}");
            assert!((deviation[channel] - camera.noise_sigma).abs() < 0.3, "{deviation:?}");
        }
    }

    #[test]
    fn an_impossible_camera_is_refused() {
        let camera = CameraModel { width_px: 0, ..CameraModel::footbot() };
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        assert!(matches!(Sensor::new(&camera, &mut rng), Err(SourceError::Camera(_))));
    }
}
