//! What the cameras of a heterogeneous swarm do to a picture.

use std::time::Duration;

use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// The least and the most of [`CameraModel::noise_sigma`], of [`CameraModel::blur_sigma_px`], and of gain and casts.
const NOISE: (f64, f64) = (0.0, 64.0);
const BLUR: (f64, f64) = (0.0, 16.0);
const FACTOR: (f64, f64) = (0.1, 4.0);

/// A camera that cannot be.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("camera '{camera}': {field} is {value}, set it within {low}..={high}")]
pub struct CameraModelError {
    /// Its name.
    pub camera: String,
    /// The field that is out of its range.
    pub field: &'static str,
    /// What it is.
    pub value: f64,
    /// The least it may be.
    pub low: f64,
    /// The most it may be.
    pub high: f64,
}

/// A camera: its geometry and its faults.
///
/// The presets are typical values, not measurements of one device; a configuration may change any of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraModel {
    /// Its name for people.
    pub name: String,
    /// Width of the image, in pixels. Range 16..=4096.
    pub width_px: i32,
    /// Height of the image, in pixels. Range 16..=4096.
    pub height_px: i32,
    /// Frames per second. Range 0.1..=240.
    pub fps: f64,
    /// Horizontal field of view, in degrees. Range 10..=150.
    pub horizontal_fov_deg: f64,
    /// Standard deviation of the sensor's noise, in grey levels of 255. Range 0..=64.
    pub noise_sigma: f64,
    /// Standard deviation of the optics' Gaussian blur, in pixels; below 0.1 the image is sharp. Range 0..=16.
    pub blur_sigma_px: f64,
    /// Factor on all channels: under 1 is under-exposed. Range 0.1..=4.
    pub gain: f64,
    /// Factors on the blue, green and red channel: what white balance left undone. Range 0.1..=4 each.
    pub cast_bgr: [f64; 3],
    /// How much darker the corners are than the centre. Range 0..=1.
    pub vignetting: f64,
}

impl CameraModel {
    /// The Foot-bot's camera: 384×288, 4:3, 2 frames per second, dim, with a blue cast.
    #[must_use]
    pub fn footbot() -> Self {
        Self {
            name: "footbot".into(),
            width_px: 384,
            height_px: 288,
            fps: 2.0,
            horizontal_fov_deg: 56.0,
            noise_sigma: 5.0,
            blur_sigma_px: 0.9,
            gain: 0.82,
            cast_bgr: [1.18, 1.0, 0.78],
            vignetting: 0.35,
        }
    }

    /// The Parrot's front camera: 640×360, 16:9, 30 frames per second, wide.
    #[must_use]
    pub fn parrot() -> Self {
        Self {
            name: "parrot".into(),
            width_px: 640,
            height_px: 360,
            fps: 30.0,
            horizontal_fov_deg: 76.0,
            noise_sigma: 3.0,
            blur_sigma_px: 0.8,
            gain: 1.08,
            cast_bgr: [0.95, 1.02, 1.04],
            vignetting: 0.2,
        }
    }

    /// A laptop's webcam: 640×480, 15 frames per second, a little warm.
    #[must_use]
    pub fn laptop() -> Self {
        Self {
            name: "laptop".into(),
            width_px: 640,
            height_px: 480,
            fps: 15.0,
            horizontal_fov_deg: 62.0,
            noise_sigma: 2.5,
            blur_sigma_px: 0.6,
            gain: 1.0,
            cast_bgr: [0.94, 1.0, 1.05],
            vignetting: 0.15,
        }
    }

    /// All presets.
    #[must_use]
    pub fn presets() -> [Self; 3] {
        [Self::footbot(), Self::parrot(), Self::laptop()]
    }

    /// The preset of that name: `footbot`, `parrot` or `laptop`.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::presets().into_iter().find(|model| model.name == name)
    }

    /// Another specimen of this model, with faults of its own: no two cameras focus, expose and balance alike, and
    /// some are far worse than the model promises.
    #[must_use]
    pub fn specimen(&self, rng: &mut impl Rng) -> Self {
        // Most specimens are near the model, few far from it.
        let wear = rng.random::<f64>().powi(2);
        // Blur in proportion to the image, as the optics make it.
        let blur_px = 2.5 * wear * f64::from(self.width_px) / 384.0;
        let within = |value: f64, (least, most): (f64, f64)| value.clamp(least, most);
        Self {
            noise_sigma: within(self.noise_sigma + 12.0 * wear * rng.random::<f64>(), NOISE),
            blur_sigma_px: within(self.blur_sigma_px + blur_px * rng.random::<f64>(), BLUR),
            gain: within(self.gain * rng.random_range(1.0 - 0.4 * wear..1.15), FACTOR),
            cast_bgr: self.cast_bgr.map(|factor| within(factor * rng.random_range(0.93..1.07), FACTOR)),
            ..self.clone()
        }
    }

    /// Checks every field against its range.
    ///
    /// # Errors
    /// [`CameraModelError`] for the first field outside its range, or that is no number.
    pub fn validate(&self) -> Result<(), CameraModelError> {
        let [blue, green, red] = self.cast_bgr;
        let fields = [
            ("width_px", f64::from(self.width_px), 16.0, 4096.0),
            ("height_px", f64::from(self.height_px), 16.0, 4096.0),
            ("fps", self.fps, 0.1, 240.0),
            ("horizontal_fov_deg", self.horizontal_fov_deg, 10.0, 150.0),
            ("noise_sigma", self.noise_sigma, NOISE.0, NOISE.1),
            ("blur_sigma_px", self.blur_sigma_px, BLUR.0, BLUR.1),
            ("gain", self.gain, FACTOR.0, FACTOR.1),
            ("cast_bgr (blue)", blue, FACTOR.0, FACTOR.1),
            ("cast_bgr (green)", green, FACTOR.0, FACTOR.1),
            ("cast_bgr (red)", red, FACTOR.0, FACTOR.1),
            ("vignetting", self.vignetting, 0.0, 1.0),
        ];
        for (field, value, low, high) in fields {
            if !(low..=high).contains(&value) {
                return Err(CameraModelError { camera: self.name.clone(), field, value, low, high });
            }
        }
        Ok(())
    }

    /// The time between two frames; for ever when there are none.
    #[must_use]
    pub fn period(&self) -> Duration {
        Duration::try_from_secs_f64(1.0 / self.fps).unwrap_or(Duration::MAX)
    }

    /// The focal length of the pinhole, in pixels: w / (2 tan(fov / 2)).
    #[must_use]
    pub fn focal_px(&self) -> f64 {
        f64::from(self.width_px) / (2.0 * (self.horizontal_fov_deg.to_radians() / 2.0).tan())
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn the_field_of_view_spans_the_width() {
        for camera in CameraModel::presets() {
            let half_width_at_1_m = (camera.horizontal_fov_deg.to_radians() / 2.0).tan();
            let edge_px = camera.focal_px() * half_width_at_1_m;
            assert!((edge_px - f64::from(camera.width_px) / 2.0).abs() < 1e-9, "{}", camera.name);
        }
    }

    #[test]
    fn a_specimen_is_no_better_than_its_model_and_differs_from_the_next() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let model = CameraModel::footbot();
        let specimens: Vec<CameraModel> = (0..50).map(|_| model.specimen(&mut rng)).collect();
        for specimen in &specimens {
            assert!(
                specimen.noise_sigma >= model.noise_sigma && specimen.blur_sigma_px >= model.blur_sigma_px
            );
            assert_eq!(specimen.focal_px(), model.focal_px());
        }
        assert!(specimens.windows(2).all(|pair| pair[0] != pair[1]));
    }

    #[test]
    fn a_specimen_of_a_camera_that_can_be_can_be() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(2);
        let wide = CameraModel { width_px: 4096, noise_sigma: 60.0, gain: 4.0, ..CameraModel::laptop() };
        let bright = CameraModel { cast_bgr: [4.0, 0.1, 4.0], ..wide };
        assert!((0..200).all(|_| bright.specimen(&mut rng).validate().is_ok()));
    }

    #[test]
    fn a_field_out_of_range_is_named() {
        let field = |camera: CameraModel| camera.validate().err().map(|error| error.field);
        let good = CameraModel::footbot();
        assert_eq!(field(good.clone()), None);
        assert_eq!(field(CameraModel { width_px: 0, ..good.clone() }), Some("width_px"));
        assert_eq!(field(CameraModel { fps: f64::NAN, ..good.clone() }), Some("fps"));
        assert_eq!(field(CameraModel { cast_bgr: [1.0, 1.0, 9.0], ..good }), Some("cast_bgr (red)"));
        for camera in CameraModel::presets() {
            assert_eq!(field(camera), None);
        }
    }

    #[test]
    fn a_preset_is_found_by_its_name() {
        for camera in CameraModel::presets() {
            assert_eq!(CameraModel::named(&camera.name), Some(camera));
        }
        assert_eq!(CameraModel::named("hubble"), None);
    }
}
