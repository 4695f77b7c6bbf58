//! A video that another program writes into a named pipe: a camera that comes and goes with its writer.

use std::fs;
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::ffmpeg::Ffmpeg;
use super::{Frame, Scene, Source, SourceError};

/// The frames of a video that is read from a named pipe, as fast as they are written.
pub struct Pipe {
    path: PathBuf,
    video: Ffmpeg,
    period: Duration,
}

impl Pipe {
    /// Whether a named pipe is at `path`.
    #[must_use]
    pub fn is_at(path: &Path) -> bool {
        fs::metadata(path).is_ok_and(|about| about.file_type().is_fifo())
    }

    /// Opens the pipe, and waits until somebody writes a video to it.
    ///
    /// # Errors
    /// When what is written is no video, or its frames are too large.
    pub fn open(path: &Path) -> Result<Self, SourceError> {
        let (video, period) = Ffmpeg::open(path)?;
        Ok(Self { path: path.into(), video, period })
    }
}

impl Source for Pipe {
    fn describe(&self) -> String {
        format!("video pipe {}", self.path.display())
    }

    fn period(&self) -> Duration {
        self.period
    }

    fn is_live(&self) -> bool {
        true
    }

    fn next_frame(&mut self, now: Duration, _: &Scene) -> Result<Frame, SourceError> {
        let asked = Instant::now();
        let image = self.video.read()?.ok_or_else(|| SourceError::WriterGone(self.path.clone()))?;
        Ok(Frame { image, at: now + asked.elapsed() })
    }
}
