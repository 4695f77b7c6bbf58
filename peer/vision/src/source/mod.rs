//! Where frames come from: a camera, drawn, read from a folder, or played from a video.

mod container;
mod device;
mod emulated_view;
mod ffmpeg;
mod folder;
mod image_file;
mod picture;
mod pipe;
mod reader;
pub mod rendered;
pub(crate) mod scene;
mod sensor;
mod video;

use std::io;
use std::path::PathBuf;
use std::time::Duration;

use gestalt_protocol::RobotId;
use opencv::core::{CV_8UC3, Mat, Scalar};
use opencv::prelude::*;
use thiserror::Error;

use crate::camera_model::CameraModelError;
use crate::pose::PoseError;
use crate::steady::Broken;

pub use container::PictureError;
pub use device::Device;
pub use emulated_view::EmulatedView;
pub use folder::ImageFolder;
pub use image_file::{MAX_IMAGE_BYTES, MAX_MEGAPIXELS, read_image, read_jpeg};
pub use picture::{decode, decode_reduced, encode_jpeg, through_jpeg};
pub use pipe::Pipe;
pub use reader::{Opener, Reader};
pub use rendered::{Glove, RenderedSource, ScheduledSource};
pub use scene::Scene;
pub use sensor::Sensor;
pub use video::Video;

/// One picture of a camera.
#[derive(Clone, Debug)]
pub struct Frame {
    /// The picture: blue, green, red, 8 bits each.
    pub image: Mat,
    /// When it was taken, since the host's start.
    pub at: Duration,
}

impl Frame {
    /// A picture from the bytes of its pixels: blue, green, red, row by row from the top, without gaps.
    ///
    /// # Errors
    /// [`SourceError::Own`] when there are not `3 * width * height` bytes, or none.
    pub fn from_bgr(width: u32, height: u32, bytes: &[u8], at: Duration) -> Result<Self, SourceError> {
        let expected = 3 * u128::from(width) * u128::from(height);
        let sides = (i32::try_from(width), i32::try_from(height));
        let (Ok(columns), Ok(rows)) = sides else { return Err(not_a_picture(width, height, bytes)) };
        if expected == 0 || bytes.len() as u128 != expected {
            return Err(not_a_picture(width, height, bytes));
        }
        let mut image = Mat::new_rows_cols_with_default(rows, columns, CV_8UC3, Scalar::all(0.0))?;
        image.data_bytes_mut()?.copy_from_slice(bytes);
        Ok(Self { image, at })
    }
}

fn not_a_picture(width: u32, height: u32, bytes: &[u8]) -> SourceError {
    let found = bytes.len();
    SourceError::Own(format!("{found} bytes are no picture of {width}×{height} pixels with 3 bytes each"))
}

/// A stream of frames, or, for a camera whose pictures are not looked at here, of whatever it delivers.
///
/// Implement it for a camera of your own. It is read by a thread of its own ([`Reader`]), so that a read may take its time;
/// one that panics is dropped and opened anew.
pub trait Source<F = Frame>: Send {
    /// What it is, in words: `rendered`, `video hand.mp4`, `images DIR`.
    fn describe(&self) -> String;

    /// The time between two frames.
    fn period(&self) -> Duration;

    /// Whether it runs by itself, as a camera does: its next frame comes when it comes, and one that is not read in time is
    /// lost. Others are read when it is time for their next frame.
    fn is_live(&self) -> bool {
        false
    }

    /// The next frame, taken at `now`. Only the rendered source looks at the scene.
    ///
    /// # Errors
    /// See [`SourceError`]. After an error about one image, the next call goes on with the next image.
    fn next_frame(&mut self, now: Duration, scene: &Scene) -> Result<F, SourceError>;
}

/// Why there is no frame.
#[derive(Debug, Error)]
pub enum SourceError {
    /// The last frame was given; the source does not start again.
    #[error("{0} has ended: a robot begins it again with `loop: true` in camera.source")]
    Ended(String),
    /// A video came to its end before it should have by its own word, which is a guess where frames come at no fixed rate.
    #[error(
        "{video} has ended after {frames} of the {of} frames that it says it has: it may be damaged or cut short; copy or record it again if so"
    )]
    CutShort {
        /// Which, in words.
        video: String,
        /// How many frames came.
        frames: u64,
        /// How many there should be.
        of: u64,
    },
    /// One picture of a video that is none.
    #[error("a picture of {} is passed over: {cause}", path.display())]
    PassedOver {
        /// The video.
        path: PathBuf,
        /// What is wrong with the picture.
        cause: String,
    },
    /// One file of a folder, or one picture of a camera, that cannot be read; others may.
    #[error("{0}")]
    OneFile(Box<Self>),
    /// The file or folder is not there.
    #[error("{} does not exist: check the path", .0.display())]
    Missing(PathBuf),
    /// The file or folder may not be read.
    #[error("no permission to read {}: grant it with chmod or choose another file", .0.display())]
    Permission(PathBuf),
    /// The operating system cannot read it.
    #[error("cannot read {}: {cause}", path.display())]
    Unreadable {
        /// Which file or folder.
        path: PathBuf,
        /// What the operating system says.
        cause: io::Error,
    },
    /// Zero bytes.
    #[error("{} is empty (0 bytes): record or copy it again", .0.display())]
    Empty(PathBuf),
    /// The end of the image is missing. (A decoder would fill the rest with grey and say nothing.)
    #[error("{} is cut short: its end is missing; copy it again", .0.display())]
    Truncated(PathBuf),
    /// Not a JPEG or PNG image, or a damaged one.
    #[error("{} is no image that can be decoded: give a JPEG or PNG file", .0.display())]
    NotAnImage(PathBuf),
    /// Not a video that FFmpeg can decode, or one without a single whole frame.
    #[error("{} is no video that FFmpeg can decode: give an mp4, mkv or avi file", .0.display())]
    NotAVideo(PathBuf),
    /// The writer of a pipe has closed it.
    #[error("nobody writes to the pipe {} any more: it is taken up again when somebody does", .0.display())]
    WriterGone(PathBuf),
    /// Not a camera that V4L2 can open, or one that is in use.
    #[error("{} is no camera that V4L2 can open: check with v4l2-ctl --list-devices that it is one and that no other program uses it", .0.display())]
    NotADevice(PathBuf),
    /// OpenCV cannot wait for a file whose number is too high, and there are so many open that it would be.
    #[error("this process has too many files and connections open to open {}: look who connects to it; the camera is opened again", .0.display())]
    TooManyOpen(PathBuf),
    /// A camera that is there and gives no frame.
    #[error("{} delivers no frame: check its cable; it is opened again", .0.display())]
    NoFrame(PathBuf),
    /// More pixels or bytes than a frame may have.
    #[error("{} is too large ({size}): the limit is {limit}; scale it down", path.display())]
    TooLarge {
        /// Which file.
        path: PathBuf,
        /// How large it is.
        size: String,
        /// How large it may be.
        limit: String,
    },
    /// A stream that has run dry.
    #[error("no frames of robot {0} arrive: start `gestalt stream` on it, and check its way here")]
    NoFrames(RobotId),
    /// A frame of a stream that is no picture.
    #[error("robot {robot} streams {cause}")]
    Garbled {
        /// Whose stream.
        robot: RobotId,
        /// What it is.
        cause: PictureError,
    },
    /// A folder with nothing to show.
    #[error("the folder {} holds no images (*.jpg, *.jpeg, *.png)", .0.display())]
    NoImages(PathBuf),
    /// More fingers than a hand has.
    #[error("a hand cannot raise {0} fingers: 0 to 5")]
    Gesture(u8),
    /// A gesture that is in no vocabulary.
    #[error("there is no gesture {0} in a vocabulary of {1}: they count from 0")]
    NotInVocabulary(u8, usize),
    /// A camera that cannot be.
    #[error(transparent)]
    Camera(#[from] CameraModelError),
    /// A place where no camera can be.
    #[error(transparent)]
    Pose(#[from] PoseError),
    /// What a source of your own says is wrong.
    #[error("{0}")]
    Own(String),
    /// The source panicked.
    #[error("the camera's source {0}")]
    Panicked(#[from] Broken),
    /// OpenCV failed where it should not.
    #[error("OpenCV: {0}")]
    OpenCv(#[from] opencv::Error),
}

impl SourceError {
    /// Whether one picture is bad and the next may be good: nothing that opening the source anew would change.
    #[must_use]
    pub fn is_of_one_picture(&self) -> bool {
        matches!(
            self,
            Self::Permission(_)
                | Self::Empty(_)
                | Self::Truncated(_)
                | Self::NotAnImage(_)
                | Self::TooLarge { .. }
                | Self::Garbled { .. }
                | Self::PassedOver { .. }
                | Self::OneFile(_)
        )
    }

    /// Whether the source has come to its end, and does not begin again.
    #[must_use]
    pub fn is_the_end(&self) -> bool {
        matches!(self, Self::Ended(_) | Self::CutShort { .. })
    }

    /// The same of one file, or one picture, among others.
    #[must_use]
    pub fn of_one_file(self) -> Self {
        if self.is_of_one_picture() { self } else { Self::OneFile(Box::new(self)) }
    }

    /// The error of the operating system, told apart by its mend.
    pub(crate) fn io(path: impl Into<PathBuf>, cause: io::Error) -> Self {
        let path = path.into();
        match cause.kind() {
            io::ErrorKind::NotFound => Self::Missing(path),
            io::ErrorKind::PermissionDenied => Self::Permission(path),
            _ => Self::Unreadable { path, cause },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_is_made_of_as_many_bytes_as_it_has_pixels() {
        let bytes: Vec<u8> = (0..18).collect();
        let frame = Frame::from_bgr(3, 2, &bytes, Duration::ZERO).unwrap();
        assert_eq!((frame.image.cols(), frame.image.rows()), (3, 2));
        assert_eq!(frame.image.at_2d::<opencv::core::Vec3b>(1, 0).unwrap().0, [9, 10, 11]);
        for (width, height) in [(3, 3), (0, 0), (u32::MAX, u32::MAX)] {
            let error = Frame::from_bgr(width, height, &bytes, Duration::ZERO).unwrap_err();
            assert!(error.to_string().contains("18 bytes are no picture"), "{error}");
        }
    }

    #[test]
    fn an_error_of_the_system_names_the_path_and_the_mend() {
        let message = |kind: io::ErrorKind| SourceError::io("/robot/video.mp4", kind.into()).to_string();
        assert_eq!(
            message(io::ErrorKind::PermissionDenied),
            "no permission to read /robot/video.mp4: grant it with chmod or choose another file"
        );
        assert_eq!(message(io::ErrorKind::NotFound), "/robot/video.mp4 does not exist: check the path");
        assert!(message(io::ErrorKind::Other).contains("/robot/video.mp4"));
    }
}
