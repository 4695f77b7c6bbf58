//! What a thin client sends: its camera's pictures, or files as they are.

use std::path::PathBuf;
use std::time::Duration;

use gestalt_protocol::{MAX_FRAME, RobotId, RoundId};
use opencv::core::Mat;

use crate::camera_source::{human_before, open_source};
use crate::config::{CameraSection, SourceSection};
use gestalt_vision::human::Human;
use gestalt_vision::source::{ImageFolder, Scene, Source, SourceError, read_image, read_jpeg};

/// A camera whose pictures are sent, not looked at.
pub enum Feed {
    /// JPEG files: a camera that encodes by itself.
    Files(ImageFolder),
    /// Any other source, and the human before a rendered one.
    Camera(Box<dyn Source>, Human),
}

/// One picture.
#[derive(Debug)]
pub enum Content {
    /// As the camera encoded it: JPEG.
    Encoded(Vec<u8>),
    /// To be encoded: blue, green, red, 8 bits each.
    Picture(Mat),
}

impl Feed {
    /// Opens the camera a configuration describes; `None` for a robot without one, or whose pictures come from elsewhere.
    /// `clock` is the time since 1970 now, for a human who goes by it.
    ///
    /// # Errors
    /// See [`SourceError`].
    pub fn open(
        camera: &CameraSection,
        robot: RobotId,
        clock: Duration,
    ) -> Result<Option<Self>, SourceError> {
        if let SourceSection::Images(files) = &camera.source {
            let period = camera.model.properties().period();
            return Ok(Some(Self::Files(ImageFolder::open(&files.path, period, files.repeat)?)));
        }
        if matches!(camera.source, SourceSection::None | SourceSection::Stream(_)) {
            return Ok(None);
        }
        Ok(Some(Self::Camera(open_source(camera, robot, clock)?, human_before(camera))))
    }

    /// What it is, in words.
    #[must_use]
    pub fn describe(&self) -> String {
        match self {
            Self::Files(folder) => folder.describe(),
            Self::Camera(source, _) => source.describe(),
        }
    }

    /// The time between two frames.
    #[must_use]
    pub fn period(&self) -> Duration {
        match self {
            Self::Files(folder) => folder.period(),
            Self::Camera(source, _) => source.period(),
        }
    }

    /// The next picture, taken at `now`; before a rendered camera somebody shows what belongs to the round.
    ///
    /// # Errors
    /// See [`SourceError`]. After an error about one picture, the next call goes on with the next.
    pub fn next(&mut self, now: Duration, round: Option<RoundId>) -> Result<Content, SourceError> {
        match self {
            Self::Files(folder) => {
                let path: PathBuf = folder.next_file()?.to_owned();
                match read_jpeg(&path, MAX_FRAME)? {
                    Some(jpeg) => Ok(Content::Encoded(jpeg)),
                    None => read_image(&path).map(Content::Picture),
                }
            }
            Self::Camera(source, human) => {
                let scene = round.map_or(Scene::default(), |round| human.shows(round));
                Ok(Content::Picture(source.next_frame(now, &scene)?.image))
            }
        }
    }
}
