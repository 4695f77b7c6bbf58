//! A camera of this machine, by Video4Linux.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use opencv::core::Mat;
use opencv::prelude::*;
use opencv::videoio::{self, VideoCapture};

use super::{Frame, Scene, Source, SourceError};
use crate::camera_model::CameraModel;

/// A V4L2 device, `/dev/videoN`. Reading waits for the camera's next frame, for ever if need be: read it in a thread of
/// its own ([`Reader`](super::Reader)).
pub struct Device {
    path: PathBuf,
    capture: VideoCapture,
    period: Duration,
}

impl Device {
    /// Opens a camera and asks it for the size and rate of that model. It may deliver others: frames say their size.
    ///
    /// # Errors
    /// When there is no such file, it may not be read, or is no camera that V4L2 can open.
    pub fn open(path: &Path, model: &CameraModel) -> Result<Self, SourceError> {
        let about = fs::metadata(path).map_err(|cause| SourceError::io(path, cause))?;
        if about.is_file() || about.is_dir() {
            return Err(SourceError::NotADevice(path.into()));
        }
        fs::File::open(path).map_err(|cause| SourceError::io(path, cause))?;
        let mut capture = VideoCapture::from_file(path, videoio::CAP_V4L2)?;
        if !capture.is_opened()? {
            return Err(SourceError::NotADevice(path.into()));
        }
        for (property, value) in wishes(model)? {
            if !capture.set(property, value)? {
                tracing::debug!("{}: refuses property {property} = {value}", path.display());
            }
        }
        Ok(Self { path: path.into(), capture, period: model.period() })
    }
}

/// What a camera is asked for, in this order. It may refuse each of it.
fn wishes(model: &CameraModel) -> Result<[(i32, f64); 5], SourceError> {
    Ok([
        // Uncompressed, most USB cameras have no room for more than 5 to 10 large frames a second. The format comes first:
        // sizes and rates depend on it.
        (videoio::CAP_PROP_FOURCC, f64::from(videoio::VideoWriter::fourcc('M', 'J', 'P', 'G')?)),
        (videoio::CAP_PROP_FRAME_WIDTH, f64::from(model.width_px)),
        (videoio::CAP_PROP_FRAME_HEIGHT, f64::from(model.height_px)),
        (videoio::CAP_PROP_FPS, model.fps),
        // With one buffer the driver has none to fill while the last frame is converted, and every other frame is lost. None
        // grows old in the others: they are emptied all the time.
        (videoio::CAP_PROP_BUFFERSIZE, BUFFERS),
    ])
}

/// Buffers of the driver: one being filled, one waiting, one being converted, and one to spare.
const BUFFERS: f64 = 4.0;

impl Source for Device {
    fn describe(&self) -> String {
        format!("device {}", self.path.display())
    }

    fn period(&self) -> Duration {
        self.period
    }

    fn is_live(&self) -> bool {
        true
    }

    fn next_frame(&mut self, now: Duration, _: &Scene) -> Result<Frame, SourceError> {
        let asked = std::time::Instant::now();
        let mut image = Mat::default();
        if !self.capture.read(&mut image)? || image.empty() {
            return Err(SourceError::NoFrame(self.path.clone()));
        }
        Ok(Frame { image, at: now + asked.elapsed() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_is_asked_for_compressed_frames_first_and_for_buffers_to_spare() {
        let wishes = wishes(&CameraModel::laptop()).unwrap();
        let mjpg = i32::from_le_bytes(*b"MJPG");
        assert_eq!(wishes[0], (videoio::CAP_PROP_FOURCC, f64::from(mjpg)));
        let (_, buffers) = wishes.iter().find(|(wish, _)| *wish == videoio::CAP_PROP_BUFFERSIZE).unwrap();
        assert!((3.0..=4.0).contains(buffers), "{buffers}");
    }

    #[test]
    fn what_is_no_camera_is_refused_by_name() {
        let open = |path: &Path| Device::open(path, &CameraModel::laptop()).err().unwrap();
        assert!(matches!(open(Path::new("/dev/video-that-is-not")), SourceError::Missing(_)));
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("video0");
        fs::write(&file, "not a camera").unwrap();
        for path in [folder.path(), &file, Path::new("/dev/null")] {
            let error = open(path);
            assert!(matches!(error, SourceError::NotADevice(_)), "{error}");
            assert!(error.to_string().contains(&path.display().to_string()), "{error}");
        }
    }
}
