//! A video file as a camera.

use std::path::{Path, PathBuf};
use std::time::Duration;

use opencv::core::Mat;
use opencv::prelude::*;
use opencv::videoio::{self, VideoCapture};

use super::image_file::{MAX_MEGAPIXELS, check_file};
use super::{Frame, Scene, Source, SourceError};

/// The frames of a video file, decoded by FFmpeg.
pub struct Video {
    path: PathBuf,
    capture: VideoCapture,
    period: Duration,
    looping: bool,
    /// Whether this pass through the file has given a frame: one that gives none would loop for ever.
    gave_frame: bool,
}

impl Video {
    /// Opens a video; when `looping`, it starts again after its last frame.
    ///
    /// # Errors
    /// When the file cannot be read, is empty, is no video, or its frames are too large.
    pub fn open(path: &Path, looping: bool) -> Result<Self, SourceError> {
        check_file(path)?;
        let capture = from_ffmpeg(path)?;
        check_size(&capture, path)?;
        let fps = capture.get(videoio::CAP_PROP_FPS)?;
        if !(0.01..=1000.0).contains(&fps) {
            return Err(SourceError::NotAVideo(path.into()));
        }
        let period = Duration::from_secs_f64(1.0 / fps);
        Ok(Self { path: path.into(), capture, period, looping, gave_frame: false })
    }
}

/// Named explicitly, since OpenCV would otherwise try every backend it was built with.
pub(super) fn from_ffmpeg(path: &Path) -> Result<VideoCapture, SourceError> {
    let capture = VideoCapture::from_file(path, videoio::CAP_FFMPEG)?;
    if capture.is_opened()? { Ok(capture) } else { Err(SourceError::NotAVideo(path.into())) }
}

pub(super) fn check_size(capture: &VideoCapture, path: &Path) -> Result<(), SourceError> {
    let (width, height) =
        (capture.get(videoio::CAP_PROP_FRAME_WIDTH)?, capture.get(videoio::CAP_PROP_FRAME_HEIGHT)?);
    if width * height <= MAX_MEGAPIXELS * 1e6 {
        return Ok(());
    }
    Err(SourceError::TooLarge {
        path: path.into(),
        size: format!("{width}×{height} pixels"),
        limit: format!("{MAX_MEGAPIXELS} megapixels"),
    })
}

impl Source for Video {
    fn describe(&self) -> String {
        format!("video {}", self.path.display())
    }

    fn period(&self) -> Duration {
        self.period
    }

    fn next_frame(&mut self, now: Duration, _: &Scene) -> Result<Frame, SourceError> {
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

    /// A video of `frames` grey frames at 10 per second.
    fn record(path: &Path, frames: u8) {
        let codec = videoio::VideoWriter::fourcc('M', 'J', 'P', 'G').unwrap();
        let size = Size::new(64, 48);
        let mut writer =
            videoio::VideoWriter::new_with_backend(path, videoio::CAP_FFMPEG, codec, 10.0, size, true)
                .unwrap();
        for frame in 0..frames {
            let grey = Scalar::all(f64::from(frame) * 20.0);
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
