//! A camera of this machine, by Video4Linux.

use std::fs;
use std::os::fd::{AsRawFd, RawFd};
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use opencv::core::Mat;
use opencv::prelude::*;
use opencv::videoio::{self, VideoCapture};

use super::{Frame, Scene, Source, SourceError};
use crate::camera_model::CameraModel;
use crate::config::DeviceSettings;

/// OpenCV waits for cameras by select(2), which writes beyond its memory for descriptors from 1,024 on; some are left for what else is
/// opened between the look and OpenCV's own.
const HIGHEST: RawFd = 768;

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
        Self::open_with(path, model, &DeviceSettings::default())
    }

    /// The same with settings of one's own.
    ///
    /// # Errors
    /// As [`Device::open`]; [`SourceError::Own`] for settings outside their ranges.
    pub fn open_with(
        path: &Path,
        model: &CameraModel,
        settings: &DeviceSettings,
    ) -> Result<Self, SourceError> {
        let wishes = wishes(model, settings)?;
        let about = fs::metadata(path).map_err(|cause| SourceError::io(path, cause))?;
        // A pipe would wait for whoever writes to it.
        if !about.file_type().is_char_device() {
            return Err(SourceError::NotADevice(path.into()));
        }
        let file = fs::File::open(path).map_err(|cause| SourceError::io(path, cause))?;
        if file.as_raw_fd() >= HIGHEST {
            return Err(SourceError::TooManyOpen(path.into()));
        }
        drop(file);
        let mut capture = VideoCapture::from_file(path, videoio::CAP_V4L2)?;
        if !capture.is_opened()? {
            return Err(SourceError::NotADevice(path.into()));
        }
        for Wish { property, name, value } in wishes {
            if !capture.set(property, value)? {
                tracing::info!("{}: refuses {name} = {value}", path.display());
            }
        }
        Ok(Self { path: path.into(), capture, period: model.period() })
    }
}

/// Something that a camera is asked for.
struct Wish {
    property: i32,
    name: &'static str,
    value: f64,
}

/// In V4L2's numbers: the exposure is what is set, and in units of 100 µs.
const MANUAL: f64 = 1.0;
const EXPOSURE_UNIT: f64 = 1e-4;

/// What a camera is asked for, in this order. It may refuse each of it.
fn wishes(model: &CameraModel, settings: &DeviceSettings) -> Result<Vec<Wish>, SourceError> {
    settings.validate().map_err(SourceError::Own)?;
    let fourcc = i32::from_le_bytes(settings.fourcc().unwrap_or(*b"MJPG"));
    let wish = |property, name, value| Wish { property, name, value };
    let mut wishes = vec![
        // The format comes first: sizes and rates depend on it.
        wish(videoio::CAP_PROP_FOURCC, "format", f64::from(fourcc)),
        wish(videoio::CAP_PROP_FRAME_WIDTH, "width", f64::from(model.width_px)),
        wish(videoio::CAP_PROP_FRAME_HEIGHT, "height", f64::from(model.height_px)),
        wish(videoio::CAP_PROP_FPS, "frames per second", model.fps),
        wish(videoio::CAP_PROP_BUFFERSIZE, "buffers", f64::from(settings.buffers)),
    ];
    if let Some(exposure) = settings.exposure {
        let units = (exposure.as_secs_f64() / EXPOSURE_UNIT).round();
        wishes.push(wish(videoio::CAP_PROP_AUTO_EXPOSURE, "manual exposure", MANUAL));
        wishes.push(wish(videoio::CAP_PROP_EXPOSURE, "exposure", units));
    }
    if let Some(gain) = settings.gain {
        wishes.push(wish(videoio::CAP_PROP_GAIN, "gain", f64::from(gain)));
    }
    Ok(wishes)
}

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

    fn asked(settings: &DeviceSettings) -> Vec<(i32, f64)> {
        let wishes = wishes(&CameraModel::laptop(), settings).unwrap();
        wishes.into_iter().map(|wish| (wish.property, wish.value)).collect()
    }

    #[test]
    fn a_camera_is_asked_for_compressed_frames_first_and_for_buffers_to_spare() {
        let wishes = asked(&DeviceSettings::default());
        let mjpg = i32::from_le_bytes(*b"MJPG");
        assert_eq!(wishes[0], (videoio::CAP_PROP_FOURCC, f64::from(mjpg)));
        let (_, buffers) = wishes.iter().find(|(wish, _)| *wish == videoio::CAP_PROP_BUFFERSIZE).unwrap();
        assert!((3.0..=4.0).contains(buffers), "{buffers}");
        assert!(
            !wishes.iter().any(|(wish, _)| *wish == videoio::CAP_PROP_AUTO_EXPOSURE),
            "left to the camera"
        );
    }

    #[test]
    fn an_exposure_of_ones_own_is_set_after_the_cameras_own_is_switched_off() {
        let (exposure, gain) = (Some(Duration::from_millis(10)), Some(32));
        let settings =
            DeviceSettings { format: "YUYV".to_owned(), exposure, gain, ..DeviceSettings::default() };
        let wishes = asked(&settings);
        assert_eq!(wishes[0].1, f64::from(i32::from_le_bytes(*b"YUYV")));
        let own = [
            (videoio::CAP_PROP_AUTO_EXPOSURE, 1.0),
            (videoio::CAP_PROP_EXPOSURE, 100.0),
            (videoio::CAP_PROP_GAIN, 32.0),
        ];
        assert_eq!(wishes[5..], own);
        let wrong = DeviceSettings { buffers: 0, ..settings };
        assert!(matches!(
            Device::open_with(Path::new("/dev/null"), &CameraModel::laptop(), &wrong),
            Err(SourceError::Own(_))
        ));
    }

    #[test]
    fn what_is_no_camera_is_refused_by_name() {
        let open = |path: &Path| Device::open(path, &CameraModel::laptop()).err().unwrap();
        assert!(matches!(open(Path::new("/dev/video-that-is-not")), SourceError::Missing(_)));
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("video0");
        fs::write(&file, "not a camera").unwrap();
        // Nobody writes to it.
        let pipe = folder.path().join("video1");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        for path in [folder.path(), &file, &pipe, Path::new("/dev/null")] {
            let error = open(path);
            assert!(matches!(error, SourceError::NotADevice(_)), "{error}");
            assert!(error.to_string().contains(&path.display().to_string()), "{error}");
        }
        // Nor is one opened whose number OpenCV could not wait for.
        let many: Vec<_> = (0..HIGHEST).map(|_| fs::File::open("/dev/null").unwrap()).collect();
        assert!(matches!(open(Path::new("/dev/null")), SourceError::TooManyOpen(_)));
        drop(many);
        assert!(matches!(open(Path::new("/dev/null")), SourceError::NotADevice(_)));
    }
}
