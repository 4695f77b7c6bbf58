//! Whether a camera delivers what its configuration says.

use std::collections::VecDeque;
use std::time::Duration;

use opencv::core::Size;

use crate::camera_model::CameraModel;

/// Over how many frames the rate is taken: their median interval, so that a pause or a hiccup makes none.
const FRAMES: usize = 24;

/// A rate that differs by no more than this factor is what was meant: cameras slow down in poor light.
const RATE: f64 = 1.5;

/// No camera is slower or faster than these, frames per second.
const SLOWEST: f64 = 0.1;
const FASTEST: f64 = 240.0;

/// Compares frames with a camera's model.
pub struct Mismatch {
    /// As the configuration says.
    model: CameraModel,
    /// The rate it has instead, as it was said last.
    fps: Option<f64>,
    /// The rate its sender states.
    stated: Option<f64>,
    size_said: bool,
    last: Option<Duration>,
    /// Frames that were delivered since then.
    passed_over: u64,
    intervals: VecDeque<Duration>,
}

impl Mismatch {
    pub fn new(model: CameraModel) -> Self {
        Self {
            model,
            fps: None,
            stated: None,
            size_said: false,
            last: None,
            passed_over: 0,
            intervals: VecDeque::new(),
        }
    }

    /// The camera's model, at the rate that it has. Its size remains what the configuration says, for its blur is measured in
    /// those pixels.
    pub fn model(&self) -> CameraModel {
        CameraModel { fps: self.fps.unwrap_or(self.model.fps), ..self.model.clone() }
    }

    /// What its sender states.
    pub fn rate_is(&mut self, fps: f64) {
        self.stated = (fps > 0.0).then_some(fps);
    }

    /// So many frames came between the last one and the next.
    pub fn passed_over(&mut self, frames: u64) {
        self.passed_over = self.passed_over.saturating_add(frames);
    }

    /// Nobody took in frames for a while: the time until the next one is none between two frames.
    pub fn resume(&mut self) {
        self.last = None;
        self.passed_over = 0;
    }

    /// Another size than the configuration says; said once.
    pub fn notice_size(&mut self, frame: Size) -> Option<String> {
        let size = (frame.width, frame.height);
        let meant = (self.model.width_px, self.model.height_px);
        if self.size_said || size == meant || size.0 <= 0 || size.1 <= 0 {
            return None;
        }
        self.size_said = true;
        let aspect = |(width, height): (i32, i32)| f64::from(width) / f64::from(height);
        let shape = match (aspect(size) / aspect(meant) - 1.0).abs() < 0.02 {
            true => "of the same aspect",
            false => "of another aspect",
        };
        Some(format!(
            "the camera delivers frames of {}×{} pixels, {shape}, where camera.model says {}×{}: every frame is read as it is; correct camera.model if that is its format",
            size.0, size.1, meant.0, meant.1
        ))
    }

    /// Another rate than the configuration says, or than was said last: each said once.
    pub fn notice_rate(&mut self, at: Duration) -> Option<String> {
        let measured = self.measured(at);
        let fps = self.stated.or(measured)?.clamp(SLOWEST, FASTEST);
        let meant = self.model.fps;
        let is_near = |rate: f64| (rate / RATE..=rate * RATE).contains(&fps);
        if is_near(self.fps.unwrap_or(meant)) {
            return None;
        }
        if is_near(meant) {
            self.fps = None;
            return Some(format!(
                "the camera delivers {fps:.1} frames per second again, near the {meant} of camera.model"
            ));
        }
        self.fps = Some(fps);
        Some(format!(
            "the camera delivers {fps:.1} frames per second where camera.model says {meant}: all counts in seconds, so it is used as it is; correct camera.model if that is its rate"
        ))
    }

    /// The median rate of what the camera delivered, also of frames that nobody had time for; `None` of too few.
    fn measured(&mut self, at: Duration) -> Option<f64> {
        let between = u32::try_from(std::mem::take(&mut self.passed_over)).unwrap_or(u32::MAX);
        let last = self.last.replace(at)?;
        if self.intervals.len() == FRAMES {
            self.intervals.pop_front();
        }
        self.intervals.push_back(at.saturating_sub(last) / between.saturating_add(1));
        if self.intervals.len() < FRAMES {
            return None;
        }
        let mut sorted: Vec<Duration> = self.intervals.iter().copied().collect();
        sorted.sort_unstable();
        Some(1.0 / sorted[FRAMES / 2].as_secs_f64().max(1e-3))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A frame's size, and when it was taken.
    fn frame(width: i32, height: i32, at_ms: u64) -> (Size, Duration) {
        (Size::new(width, height), Duration::from_millis(at_ms))
    }

    fn notice(mismatch: &mut Mismatch, (size, at): (Size, Duration)) -> Vec<String> {
        [mismatch.notice_rate(at), mismatch.notice_size(size)].into_iter().flatten().collect()
    }

    #[test]
    fn what_the_configuration_says_is_no_news() {
        let mut mismatch = Mismatch::new(CameraModel::footbot());
        assert!((0..100).all(|at| notice(&mut mismatch, frame(384, 288, at * 500)).is_empty()));
        assert_eq!(mismatch.model(), CameraModel::footbot());
    }

    #[test]
    fn another_size_or_rate_is_said_once_and_against_what_the_configuration_says() {
        let mut mismatch = Mismatch::new(CameraModel::parrot());
        // A folder of mixed sizes.
        let sizes = [(640, 480), (320, 240), (640, 360)];
        let said: Vec<String> = (0..200)
            .flat_map(|at| {
                let (width, height) = sizes[at as usize % 3];
                notice(&mut mismatch, frame(width, height, at * 100))
            })
            .collect();
        let [size, rate] = &said[..] else { panic!("{said:?}") };
        assert!(size.contains("640×480") && size.contains("another aspect"), "{size}");
        assert!(size.contains("camera.model says 640×360"), "{size}");
        assert!(rate.contains("10.0 frames") && rate.contains("says 30"), "{rate}");
        // The blur is a share of the width that it was measured at.
        let expected = CameraModel { fps: mismatch.model().fps, ..CameraModel::parrot() };
        assert_eq!((mismatch.model(), expected.fps.round()), (expected, 10.0));
    }

    #[test]
    fn what_a_busy_machine_passes_over_was_delivered_all_the_same() {
        let mut mismatch = Mismatch::new(CameraModel::parrot());
        for at in 0..100 {
            mismatch.passed_over(2);
            assert_eq!(notice(&mut mismatch, frame(640, 360, at * 100)), Vec::<String>::new());
        }
    }

    #[test]
    fn the_time_in_which_nobody_looks_is_none_between_two_frames() {
        let mut mismatch = Mismatch::new(CameraModel::footbot());
        for round in 0..60 {
            mismatch.passed_over(3);
            mismatch.resume();
            for at in [0, 500] {
                let at = frame(384, 288, 5000 * round + at);
                assert_eq!(notice(&mut mismatch, at), Vec::<String>::new());
            }
        }
    }

    #[test]
    fn the_rate_that_a_sender_states_counts_whatever_arrives() {
        let mut mismatch = Mismatch::new(CameraModel::parrot());
        mismatch.rate_is(30.0);
        assert!((0..100).all(|at| notice(&mut mismatch, frame(640, 360, at * 500)).is_empty()));
        mismatch.rate_is(5.0);
        let said = notice(&mut mismatch, frame(640, 360, 60_000));
        assert!(said[0].contains("5.0 frames per second where camera.model says 30"), "{said:?}");
    }

    #[test]
    fn a_rate_that_changes_later_is_followed_and_each_is_said_once() {
        let mut mismatch = Mismatch::new(CameraModel::parrot());
        let (mut at_ms, mut said) = (0, Vec::new());
        let mut rates = Vec::new();
        for period in [33, 100, 200, 33, 11_000, 20_000] {
            for _ in 0..60 {
                at_ms += period;
                said.extend(notice(&mut mismatch, frame(640, 360, at_ms)));
            }
            rates.push(mismatch.model().fps);
        }
        assert_eq!(rates, [30.0, 10.0, 5.0, 30.0, 0.1, 0.1]);
        let [ten, five, thirty, slow] = &said[..] else { panic!("{said:?}") };
        assert!(ten.contains("10.0 frames") && five.contains("5.0 frames") && slow.contains("0.1 frames"));
        assert!(thirty.contains("30.3 frames per second again"), "{thirty}");
    }
}
