//! A video file as a camera.

use std::path::{Path, PathBuf};
use std::time::Duration;

use opencv::core::Mat;
use opencv::prelude::*;
use opencv::videoio::{self, VideoCapture};

use super::image_file::{MAX_MEGAPIXELS, check_file};
use super::{Frame, Scene, Source, SourceError};

/// Assumed where a video does not say how many frames per second it has.
const PERIOD: Duration = Duration::from_millis(33);

/// So many frames are passed over one by one; beyond that it is quicker to seek.
const GRABBED: u64 = 60;

/// The most that are passed over in a video that says nothing of its length.
const MOST_GRABBED: u64 = 30 * GRABBED;

/// The frames of a video file, decoded by FFmpeg. It runs on while nobody reads it, as what happens in front of a camera does.
pub struct Video {
    path: PathBuf,
    capture: VideoCapture,
    period: Duration,
    looping: bool,
    /// Whether this pass through the file has given a frame: one that gives none would loop for ever.
    gave_frame: bool,
    /// When its last frame was read.
    last: Option<Duration>,
}

impl Video {
    /// Opens a video; when `looping`, it starts again after its last frame.
    ///
    /// # Errors
    /// When the file cannot be read, is empty, is no video, or its frames are too large.
    pub fn open(path: &Path, looping: bool) -> Result<Self, SourceError> {
        check_file(path)?;
        let (capture, period) = open(path)?;
        Ok(Self { path: path.into(), capture, period, looping, gave_frame: false, last: None })
    }

    /// Passes over what has been shown since the last frame was read. A video that ends meanwhile says so at the next.
    fn run_on(&mut self, now: Duration) -> Result<(), SourceError> {
        let Some(last) = self.last.replace(now) else { return Ok(()) };
        // A frame that is read a little late is the next one all the same.
        let shown = (now.saturating_sub(last).as_secs_f64() / self.period.as_secs_f64() + 1e-6) as u64;
        let passed_over = shown.saturating_sub(1);
        if passed_over <= GRABBED || !self.seek(passed_over)? {
            for _ in 0..passed_over.min(MOST_GRABBED) {
                if self.capture.grab()? {
                    self.gave_frame = true;
                } else if self.looping && self.gave_frame {
                    self.capture = from_ffmpeg(&self.path)?;
                    self.gave_frame = self.capture.grab()?;
                } else {
                    break;
                }
            }
        }
        Ok(())
    }

    /// Goes on by so many frames at once; `false` where the video does not say how many it has, or cannot.
    fn seek(&mut self, by: u64) -> Result<bool, SourceError> {
        let count = self.capture.get(videoio::CAP_PROP_FRAME_COUNT)?;
        let next = self.capture.get(videoio::CAP_PROP_POS_FRAMES)?;
        if !(count >= 1.0 && next >= 0.0) {
            return Ok(false);
        }
        let to = next + by as f64;
        if self.looping {
            return Ok(self.capture.set(videoio::CAP_PROP_POS_FRAMES, to % count)?);
        }
        if to < count {
            return Ok(self.capture.set(videoio::CAP_PROP_POS_FRAMES, to)?);
        }
        // Its last frame is passed over with the others.
        let reached = self.capture.set(videoio::CAP_PROP_POS_FRAMES, count - 1.0)?;
        while reached && self.capture.grab()? {}
        Ok(reached)
    }
}

/// The time between two frames, of a video that says it has so many per second.
fn period(fps: f64) -> Duration {
    if (0.01..=1000.0).contains(&fps) { Duration::from_secs_f64(1.0 / fps) } else { PERIOD }
}

/// Named explicitly, since OpenCV would otherwise try every backend it was built with.
fn from_ffmpeg(path: &Path) -> Result<VideoCapture, SourceError> {
    let capture = VideoCapture::from_file(path, videoio::CAP_FFMPEG)?;
    if capture.is_opened()? { Ok(capture) } else { Err(SourceError::NotAVideo(path.into())) }
}

/// A video whose frames are not too large, and the time between two of them.
pub(super) fn open(path: &Path) -> Result<(VideoCapture, Duration), SourceError> {
    let capture = from_ffmpeg(path)?;
    let (width, height) =
        (capture.get(videoio::CAP_PROP_FRAME_WIDTH)?, capture.get(videoio::CAP_PROP_FRAME_HEIGHT)?);
    let fits = width * height <= MAX_MEGAPIXELS * 1e6;
    if !fits {
        return Err(SourceError::TooLarge {
            path: path.into(),
            size: format!("{width}×{height} pixels"),
            limit: format!("{MAX_MEGAPIXELS} megapixels"),
        });
    }
    let period = period(capture.get(videoio::CAP_PROP_FPS)?);
    Ok((capture, period))
}

impl Source for Video {
    fn describe(&self) -> String {
        format!("video {}", self.path.display())
    }

    fn period(&self) -> Duration {
        self.period
    }

    fn next_frame(&mut self, now: Duration, _: &Scene) -> Result<Frame, SourceError> {
        self.run_on(now)?;
        let mut image = Mat::default();
        while !self.capture.read(&mut image)? || image.empty() {
            if !self.gave_frame {
                return Err(SourceError::NotAVideo(self.path.clone()));
            }
            if !self.looping {
                return Err(SourceError::Ended(self.describe()));
            }
            self.capture = from_ffmpeg(&self.path)?;
            self.gave_frame = false;
        }
        self.gave_frame = true;
        Ok(Frame { image, at: now })
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use opencv::core::{self, Scalar, Size};

    use super::*;

    fn next(video: &mut Video) -> Result<Frame, SourceError> {
        video.next_frame(Duration::ZERO, &Scene::default())
    }

    /// Each frame is so much brighter than the one before, in grey levels.
    const STEP: f64 = 20.0;

    /// A video of `frames` grey frames at 10 per second.
    fn record(path: &Path, frames: u8) {
        let codec = videoio::VideoWriter::fourcc('M', 'J', 'P', 'G').unwrap();
        let size = Size::new(64, 48);
        let mut writer =
            videoio::VideoWriter::new_with_backend(path, videoio::CAP_FFMPEG, codec, 10.0, size, true)
                .unwrap();
        for frame in 0..frames {
            let grey = Scalar::all(f64::from(frame) * STEP);
            writer.write(&Mat::new_size_with_default(size, core::CV_8UC3, grey).unwrap()).unwrap();
        }
        writer.release().unwrap();
    }

    #[test]
    fn a_video_gives_its_frames_and_ends() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("five.avi");
        record(&path, 5);
        let mut video = Video::open(&path, false).unwrap();
        assert_eq!(video.period(), Duration::from_millis(100));
        for _ in 0..5 {
            assert_eq!(next(&mut video).unwrap().image.size().unwrap(), Size::new(64, 48));
        }
        assert!(matches!(next(&mut video), Err(SourceError::Ended(_))));
    }

    #[test]
    fn a_looping_video_starts_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("three.avi");
        record(&path, 3);
        let mut video = Video::open(&path, true).unwrap();
        let levels: Vec<u8> =
            (0..7).map(|_| next(&mut video).unwrap().image.data_bytes().unwrap()[0]).collect();
        assert_eq!(levels[0], levels[3]);
        assert_eq!(levels[1], levels[4]);
        assert!(levels[0] < levels[1] && levels[1] < levels[2], "{levels:?}");
    }

    /// Which of its frames a video of [`record`] shows at that time, in tenths of a second.
    fn shown(video: &mut Video, tenths: u32) -> Result<u32, SourceError> {
        let frame = video.next_frame(Duration::from_millis(100) * tenths, &Scene::default())?;
        Ok((f64::from(frame.image.data_bytes()?[0]) / STEP).round() as u32)
    }

    #[test]
    fn a_video_runs_on_while_nobody_looks() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ten.avi");
        record(&path, 12);
        let mut video = Video::open(&path, true).unwrap();
        for at in [0, 1, 2, 7, 8] {
            assert_eq!(shown(&mut video, at).unwrap(), at);
        }
        // Once around, by one frame after the other, and eight times, by a jump.
        assert_eq!(shown(&mut video, 8 + 12).unwrap(), 8);
        assert_eq!(shown(&mut video, 8 + 12 + 8 * 12 + 2).unwrap(), 10);
        for pause in [20, 200] {
            let mut video = Video::open(&path, false).unwrap();
            assert_eq!(shown(&mut video, 0).unwrap(), 0);
            assert!(matches!(shown(&mut video, pause), Err(SourceError::Ended(_))), "{pause}");
        }
    }

    #[test]
    fn a_video_that_does_not_say_its_rate_is_a_video_all_the_same() {
        assert_eq!(period(10.0), Duration::from_millis(100));
        for unknown in [0.0, -1.0, f64::NAN, f64::INFINITY, 90_000.0] {
            assert_eq!(period(unknown), PERIOD, "{unknown}");
        }
    }

    #[test]
    fn what_is_no_video_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let open = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            fs::write(&path, bytes).unwrap();
            let error = Video::open(&path, true).err().unwrap();
            assert!(error.to_string().contains(name), "{error}");
            error
        };
        assert!(matches!(open("empty.mp4", b""), SourceError::Empty(_)));
        assert!(matches!(open("text.mp4", b"a screenplay"), SourceError::NotAVideo(_)));
        let missing = Video::open(&folder.path().join("missing.mp4"), true).err().unwrap();
        assert!(matches!(missing, SourceError::Missing(_)));
    }

    #[test]
    fn a_video_cut_short_never_panics_and_comes_to_an_end() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cut.avi");
        record(&path, 5);
        let whole = fs::read(&path).unwrap();
        for share in [1, 4, 9] {
            fs::write(&path, &whole[..whole.len() * share / 10]).unwrap();
            if let Ok(mut video) = Video::open(&path, false) {
                assert!((0..6).any(|_| next(&mut video).is_err()), "{share} tenths");
            }
        }
    }
}
