//! Whether a camera delivers what its configuration says.

use std::collections::VecDeque;
use std::time::Duration;

use opencv::prelude::*;

use crate::camera_model::CameraModel;
use crate::source::Frame;

/// Over how many frames the rate is taken: their median interval, so that a pause or a hiccup makes none.
const FRAMES: usize = 24;

/// A rate that differs by no more than this factor is what was meant: cameras slow down in poor light.
const RATE: f64 = 1.5;

/// Compares frames with a camera's model, and makes the model what they are.
pub struct Mismatch {
    model: CameraModel,
    last: Option<Duration>,
    intervals: VecDeque<Duration>,
    rate_said: bool,
}

impl Mismatch {
    pub fn new(model: CameraModel) -> Self {
        Self { model, last: None, intervals: VecDeque::new(), rate_said: false }
    }

    /// What the camera is, as far as its frames show.
    pub fn model(&self) -> &CameraModel {
        &self.model
    }

    /// What is not as it should be; the model is changed to what is. The same thing is said once.
    pub fn notice(&mut self, frame: &Frame) -> Option<String> {
        let size = (frame.image.cols(), frame.image.rows());
        let meant = (self.model.width_px, self.model.height_px);
        if size != meant && size.0 > 0 && size.1 > 0 {
            let aspect = |(width, height): (i32, i32)| f64::from(width) / f64::from(height);
            let shape = match (aspect(size) / aspect(meant) - 1.0).abs() < 0.02 {
                true => "of the same aspect",
                false => "of another aspect",
            };
            (self.model.width_px, self.model.height_px) = size;
            return Some(format!(
                "the camera delivers frames of {}×{} pixels, {shape}, where camera.model says {}×{}: they are read as they are; correct camera.model if that is its format",
                size.0, size.1, meant.0, meant.1
            ));
        }
        self.notice_rate(frame.at)
    }

    fn notice_rate(&mut self, at: Duration) -> Option<String> {
        let last = self.last.replace(at)?;
        if self.rate_said {
            return None;
        }
        if self.intervals.len() == FRAMES {
            self.intervals.pop_front();
        }
        self.intervals.push_back(at.saturating_sub(last));
        if self.intervals.len() < FRAMES {
            return None;
        }
        let mut sorted: Vec<Duration> = self.intervals.iter().copied().collect();
        sorted.sort_unstable();
        let fps = 1.0 / sorted[FRAMES / 2].as_secs_f64().max(1e-3);
        let meant = self.model.fps;
        if (meant / RATE..=meant * RATE).contains(&fps) {
            return None;
        }
        self.rate_said = true;
        self.model.fps = fps.clamp(0.1, 240.0);
        Some(format!(
            "the camera delivers {fps:.1} frames per second where camera.model says {meant}: all counts in seconds, so it is used as it is; correct camera.model if that is its rate"
        ))
    }
}

#[cfg(test)]
mod tests {
    use opencv::core::{CV_8UC3, Scalar};

    use super::*;

    fn frame(width: i32, height: i32, at_ms: u64) -> Frame {
        let image = Mat::new_rows_cols_with_default(height, width, CV_8UC3, Scalar::all(9.0)).unwrap();
        Frame { image, at: Duration::from_millis(at_ms) }
    }

    #[test]
    fn what_the_configuration_says_is_no_news() {
        let mut mismatch = Mismatch::new(CameraModel::footbot());
        assert!((0..100).all(|at| mismatch.notice(&frame(384, 288, at * 500)).is_none()));
    }

    #[test]
    fn another_size_or_rate_is_said_once_and_taken_for_what_it_is() {
        let mut mismatch = Mismatch::new(CameraModel::parrot());
        let said: Vec<String> =
            (0..200).filter_map(|at| mismatch.notice(&frame(640, 480, at * 100))).collect();
        let [size, rate] = &said[..] else { panic!("{said:?}") };
        assert!(
            size.contains("640×480") && size.contains("another aspect") && size.contains("640×360"),
            "{size}"
        );
        assert!(rate.contains("10.0 frames") && rate.contains("says 30"), "{rate}");
        assert_eq!((mismatch.model().height_px, mismatch.model().fps.round()), (480, 10.0));
        assert!(mismatch.notice(&frame(320, 240, 30_000)).unwrap().contains("of the same aspect"));
    }
}
