//! What a robot's status says of its camera, kept true.

use std::collections::VecDeque;
use std::time::Duration;

use gestalt_protocol::{Camera, CameraState, Motion};
use gestalt_strategies::Classify;
use opencv::core::Mat;
use opencv::prelude::*;

use crate::opinion::opinion;
use gestalt_vision::source::{Frame, SourceError};

/// The status is written this often at most.
pub const INTERVAL: Duration = Duration::from_millis(250);

/// Over which time the rate of the frames is taken.
const WINDOW: Duration = Duration::from_secs(3);

/// The fewest frames of which the rate is taken, and the most that are remembered.
const FRAMES: std::ops::RangeInclusive<usize> = 3..=256;

/// A camera that delivers nothing, or the same picture, for this long is frozen; a slow one has the time of three frames.
const PATIENCE: Duration = Duration::from_secs(2);

/// After this many errors in a row a camera fails.
const ERRORS: u32 = 3;

/// Follows one camera: its frames, its failures, and when neither comes. All times since the same moment.
#[derive(Debug, Default)]
pub struct CameraReport {
    live: bool,
    /// Since when frames are expected; `None` while nobody looks.
    expected: Option<Duration>,
    taken: VecDeque<Duration>,
    size: [u32; 2],
    delay: Option<Duration>,
    errors: u32,
    error: Option<String>,
    ended: bool,
    picture: u32,
    picture_since: Duration,
    /// The features of the last hand, and when it was seen.
    hand: Option<(Vec<f32>, Duration)>,
    written: Option<Duration>,
}

impl CameraReport {
    /// A camera that nobody looks through yet. `live`: it runs by itself, and the same picture over and over is a fault.
    #[must_use]
    pub fn new(live: bool) -> Self {
        Self { live, ..Self::default() }
    }

    /// Frames are expected from now on.
    pub fn expect(&mut self, now: Duration) {
        if self.expected.is_none() {
            self.expected = Some(now);
            self.taken.clear();
        }
    }

    /// Nobody looks any more.
    pub fn rest(&mut self) {
        self.expected = None;
    }

    /// The camera delivered a frame. Says whether it is worth looking at: a frozen picture is not.
    pub fn note_frame(&mut self, frame: &Frame) -> bool {
        self.errors = 0;
        self.error = None;
        let side = |length: i32| u32::try_from(length).unwrap_or_default();
        self.size = [side(frame.image.cols()), side(frame.image.rows())];
        self.taken.push_back(frame.at);
        while self.taken.len() > *FRAMES.end()
            || self.taken.len() > *FRAMES.start()
                && self.taken.front().is_some_and(|first| *first + WINDOW < frame.at)
        {
            self.taken.pop_front();
        }
        if !self.live {
            return true;
        }
        let picture = checksum(&frame.image);
        if picture != self.picture {
            (self.picture, self.picture_since) = (picture, frame.at);
        }
        !self.is_same_picture(frame.at)
    }

    /// A frame was judged at that time; these are the features of its hand.
    pub fn note_judged(&mut self, taken: Duration, now: Duration, features: Option<Vec<f32>>) {
        const WEIGHT: f64 = 0.2;
        let delay = now.saturating_sub(taken);
        let before = self.delay.unwrap_or(delay);
        self.delay = Some(before.mul_f64(1.0 - WEIGHT) + delay.mul_f64(WEIGHT));
        if let Some(features) = features {
            self.hand = Some((features, taken));
        }
    }

    /// The camera failed.
    pub fn note_error(&mut self, error: &SourceError) {
        self.errors = self.errors.saturating_add(1);
        self.error = Some(error.to_string());
        self.ended = matches!(error, SourceError::Ended(_));
    }

    /// How the camera goes, and what is wrong with it.
    #[must_use]
    pub fn state(&self, now: Duration) -> (CameraState, String) {
        let last = self.taken.back().copied();
        let trouble = self.error.clone().unwrap_or_default();
        if self.ended {
            return (CameraState::Ended, trouble);
        }
        if self.errors >= ERRORS || (self.live && self.errors > 0) {
            return (CameraState::Failing, trouble);
        }
        if let Some(expected) = self.expected {
            let silent = now.saturating_sub(last.map_or(expected, |last| last.max(expected)));
            if silent > self.patience() {
                let trouble = format!(
                    "no frame for {:.0} s: check the camera, its cable and its driver",
                    silent.as_secs_f64()
                );
                return (CameraState::Frozen, trouble);
            }
        }
        match last {
            Some(last) if self.is_same_picture(last) => {
                let seconds = last.saturating_sub(self.picture_since).as_secs_f64();
                let trouble = format!(
                    "the same picture for {seconds:.0} s, to the last bit: the camera hangs; unplug it and plug it in again"
                );
                (CameraState::Frozen, trouble)
            }
            None if self.size == [0, 0] => (CameraState::Opening, trouble),
            _ => (CameraState::Live, trouble),
        }
    }

    /// Frames per second, lately.
    #[must_use]
    pub fn fps(&self) -> Option<f32> {
        let (first, last) = (self.taken.front()?, self.taken.back()?);
        let seconds = last.saturating_sub(*first).as_secs_f32();
        (self.taken.len() >= *FRAMES.start() && seconds > 0.0)
            .then(|| (self.taken.len() - 1) as f32 / seconds)
    }

    /// Whether it is time to write to the status again.
    #[must_use]
    pub fn is_due(&self, now: Duration) -> bool {
        self.written.is_none_or(|written| now.saturating_sub(written) >= INTERVAL)
    }

    /// What the status is to say. The opinion is that of `classifier`, of the last hand seen.
    pub fn write(
        &mut self,
        now: Duration,
        source: &str,
        motion: Option<Motion>,
        classifier: Option<&dyn Classify>,
    ) -> Camera {
        self.written = Some(now);
        let (state, trouble) = self.state(now);
        let seen = classifier.zip(self.hand.as_ref());
        let opinion = seen.and_then(|(classifier, (features, at))| opinion(classifier, features, *at));
        Camera {
            source: source.to_owned(),
            state,
            trouble,
            size: self.size,
            fps: self.fps().unwrap_or_default(),
            delay_ms: self.delay.unwrap_or_default().as_secs_f32() * 1000.0,
            motion,
            opinion,
        }
    }

    /// How long a frame may fail to appear.
    fn patience(&self) -> Duration {
        let period = self.fps().map_or(Duration::ZERO, |fps| Duration::from_secs_f32(1.0 / fps));
        PATIENCE.max(3 * period)
    }

    fn is_same_picture(&self, at: Duration) -> bool {
        self.live && at.saturating_sub(self.picture_since) > self.patience()
    }
}

/// Of every sixteenth row: two pictures of a real sensor never agree in them.
fn checksum(image: &Mat) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    for row in (0..image.rows()).step_by(16) {
        // A row that cannot be read does not tell pictures apart.
        if let Ok(row) = image.row(row)
            && let Ok(bytes) = row.data_bytes()
        {
            hasher.update(bytes);
        }
    }
    hasher.finalize()
}

#[cfg(test)]
mod tests {
    use opencv::core::{CV_8UC3, Scalar};

    use super::*;

    fn frame(level: f64, at_ms: u64) -> Frame {
        let image = Mat::new_rows_cols_with_default(48, 64, CV_8UC3, Scalar::all(level)).unwrap();
        Frame { image, at: Duration::from_millis(at_ms) }
    }

    fn state(report: &CameraReport, at_ms: u64) -> CameraState {
        report.state(Duration::from_millis(at_ms)).0
    }

    #[test]
    fn a_camera_that_falls_silent_is_frozen_until_it_delivers_again() {
        let mut report = CameraReport::new(true);
        assert_eq!(state(&report, 0), CameraState::Opening);
        report.expect(Duration::ZERO);
        for at in 0..30 {
            assert!(report.note_frame(&frame(at as f64, at * 100)));
        }
        assert_eq!(state(&report, 3000), CameraState::Live);
        assert!((report.fps().unwrap() - 10.0).abs() < 0.5);
        assert_eq!(state(&report, 6000), CameraState::Frozen);
        assert!(report.state(Duration::from_secs(6)).1.contains("no frame for 3 s"));
        report.note_frame(&frame(90.0, 6100));
        assert_eq!(state(&report, 6200), CameraState::Live);
    }

    #[test]
    fn the_same_picture_over_and_over_is_frozen_and_not_worth_looking_at() {
        let mut report = CameraReport::new(true);
        report.expect(Duration::ZERO);
        let worth: Vec<bool> = (0..40).map(|at| report.note_frame(&frame(9.0, at * 100))).collect();
        assert!(worth[..20].iter().all(|worth| *worth) && !worth[39]);
        assert_eq!(state(&report, 3900), CameraState::Frozen);
        assert!(report.note_frame(&frame(10.0, 4000)));
        assert_eq!(state(&report, 4000), CameraState::Live);
        // A file may show the same picture for as long as it likes.
        let mut report = CameraReport::new(false);
        assert!((0..40).all(|at| report.note_frame(&frame(9.0, at * 100))));
    }

    #[test]
    fn a_camera_that_nobody_looks_through_is_not_frozen() {
        let mut report = CameraReport::new(false);
        report.expect(Duration::ZERO);
        report.note_frame(&frame(1.0, 0));
        report.rest();
        assert_eq!(state(&report, 60_000), CameraState::Live);
        report.expect(Duration::from_secs(60));
        assert_eq!(state(&report, 61_000), CameraState::Live);
        assert_eq!(state(&report, 64_000), CameraState::Frozen);
    }

    #[test]
    fn errors_in_a_row_are_a_failing_camera_and_the_end_is_the_end() {
        let mut report = CameraReport::new(false);
        let error = SourceError::NoFrame("/dev/video9".into());
        report.note_error(&error);
        assert_eq!(state(&report, 0), CameraState::Opening);
        report.note_error(&error);
        report.note_error(&error);
        assert_eq!(state(&report, 0), CameraState::Failing);
        assert!(report.state(Duration::ZERO).1.contains("/dev/video9"));
        report.note_frame(&frame(1.0, 100));
        assert_eq!(state(&report, 100), CameraState::Live);
        report.note_error(&SourceError::Ended("video".to_owned()));
        assert_eq!(state(&report, 200), CameraState::Ended);
    }
}
