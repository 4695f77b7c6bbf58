//! What a thin client sends: its camera's pictures, or files as they are.

use std::time::Duration;

use gestalt_protocol::{MAX_FRAME, RobotId};
use opencv::core::Mat;

use crate::camera_report::checksum;
use crate::camera_source::{describe, human_before, open_source};
use crate::config::{CameraSection, SourceSection};
use gestalt_vision::human::Human;
use gestalt_vision::source::{ImageFolder, Opener, Scene, Source, SourceError, read_image, read_jpeg};

/// A camera whose pictures are sent, not looked at. It is opened by whoever reads it: one that is missing may come later.
pub struct Feed {
    describe: String,
    /// Who stands in front of it, if it is a rendered one.
    pub(super) human: Human,
    pub(super) open: Opener<Shot>,
}

/// One picture, and when it was taken.
#[derive(Debug)]
pub struct Shot {
    /// The picture.
    pub content: Content,
    /// When it was taken, in the time of its reader.
    pub at: Duration,
    /// The time between two pictures.
    pub period: Duration,
    /// Of a camera that runs by itself, what tells a picture from the next: the same over and over is a fault. `None`: of files.
    pub checksum: Option<u32>,
}

/// What a picture is.
#[derive(Debug)]
pub enum Content {
    /// As the camera encoded it: JPEG.
    Encoded(Vec<u8>),
    /// To be encoded: blue, green, red, 8 bits each.
    Picture(Mat),
}

impl Feed {
    /// The camera a configuration describes; `None` for a robot without one, or whose pictures come from elsewhere. `clock` is
    /// the time since 1970 now, for a human who goes by it.
    #[must_use]
    pub fn new(camera: &CameraSection, robot: RobotId, clock: Duration) -> Option<Self> {
        let section = camera.clone();
        let open: Opener<Shot> = match &camera.source {
            SourceSection::None | SourceSection::Stream(_) => return None,
            SourceSection::Images(files) => {
                let (files, period) = (files.clone(), camera.model.properties().period());
                Box::new(move || Ok(Box::new(Files(ImageFolder::open(&files.path, period, files.repeat)?))))
            }
            _ => encodable(Box::new(move || open_source(&section, robot, clock))),
        };
        Some(Self { describe: describe(camera), human: human_before(camera), open })
    }

    /// A camera of your own, in words, and what opens it; again whenever it fails.
    #[must_use]
    pub fn with(describe: &str, open: Opener) -> Self {
        Self { describe: describe.to_owned(), human: Human::new(0), open: encodable(open) }
    }

    /// What it is, in words.
    #[must_use]
    pub fn describe(&self) -> String {
        self.describe.clone()
    }
}

fn encodable(mut open: Opener) -> Opener<Shot> {
    Box::new(move || Ok(Box::new(Camera(open()?))))
}

/// JPEG files: a camera that encodes by itself.
struct Files(ImageFolder);

impl Source<Shot> for Files {
    fn describe(&self) -> String {
        self.0.describe()
    }

    fn period(&self) -> Duration {
        self.0.period()
    }

    fn next_frame(&mut self, now: Duration, _: &Scene) -> Result<Shot, SourceError> {
        let content = self.0.read_next(|path| {
            Ok(match read_jpeg(path, MAX_FRAME)? {
                Some(jpeg) => Content::Encoded(jpeg),
                None => Content::Picture(read_image(path)?),
            })
        })?;
        Ok(Shot { content, at: now, period: self.period(), checksum: None })
    }
}

/// Any other source.
struct Camera(Box<dyn Source>);

impl Source<Shot> for Camera {
    fn describe(&self) -> String {
        self.0.describe()
    }

    fn period(&self) -> Duration {
        self.0.period()
    }

    fn is_live(&self) -> bool {
        self.0.is_live()
    }

    fn next_frame(&mut self, now: Duration, scene: &Scene) -> Result<Shot, SourceError> {
        let frame = self.0.next_frame(now, scene)?;
        let checksum = self.is_live().then(|| checksum(&frame.image));
        Ok(Shot { content: Content::Picture(frame.image), at: frame.at, period: self.period(), checksum })
    }
}
