//! Where frames come from, as a command line says it.

use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use gestalt_vision::config::DeviceSettings;
use gestalt_vision::dataset::has_image_name;
use gestalt_vision::pose::Pose;
use gestalt_vision::source::Glove;
use thiserror::Error;

use crate::config::{DeviceSection, FilesSection, ModelSection, RenderedSection, RosSection, SourceSection};

/// `/dev/video0`, `hand.mp4`, `DIR`, `image.png`, `ros:/camera/image_raw`, `rendered`, or `rendered:3,glove=skin,distance=1.2,seed=7`.
#[derive(Clone, Debug, PartialEq)]
pub enum SourceArg {
    /// A synthetic hand.
    Rendered(Rendered),
    /// A camera topic of a ROS 2 system.
    Ros(String),
    /// A file, a folder, or a device: by what is there.
    Path(PathBuf),
}

/// A synthetic hand, as far as the command line describes it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rendered {
    /// How many fingers it shows.
    pub fingers: Option<u8>,
    /// From where it is seen.
    pub pose: Option<Pose>,
    /// What it wears.
    pub glove: Option<Glove>,
    /// Of what its person, its light and the camera's noise follow.
    pub seed: Option<u64>,
}

/// What is at a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A camera of this machine.
    Device,
    /// A folder of images.
    Folder,
    /// One image.
    Image,
    /// Anything else: FFmpeg finds out.
    Video,
}

/// A source that cannot be.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum SourceArgError {
    /// An item that says nothing about a synthetic hand.
    #[error(
        "'{0}' does not describe a synthetic hand: write, for example, rendered:3 or rendered:glove=skin,bearing=-30,elevation=5,distance=1.2,seed=7"
    )]
    Item(String),
    /// A place where no camera can be.
    #[error("{0}")]
    Pose(String),
    /// A robot's rendered camera shows what its swarm is shown.
    #[error(
        "the gesture in front of a robot's rendered camera changes with every round: leave out the number of fingers"
    )]
    Fingers,
    /// One image is not a camera.
    #[error("{} is a single image: give its folder, or a video", .0.display())]
    Image(PathBuf),
}

impl FromStr for SourceArg {
    type Err = SourceArgError;

    fn from_str(text: &str) -> Result<Self, SourceArgError> {
        if let Some(topic) = text.strip_prefix("ros:") {
            return Ok(Self::Ros(topic.to_owned()));
        }
        match text.strip_prefix("rendered") {
            Some("") => Ok(Self::Rendered(Rendered::default())),
            Some(rest) if rest.starts_with(':') => Rendered::read(&rest[1..]).map(Self::Rendered),
            _ => Ok(Self::Path(text.into())),
        }
    }
}

impl Rendered {
    fn read(text: &str) -> Result<Self, SourceArgError> {
        let mut read = Self::default();
        for item in text.split(',') {
            let wrong = || SourceArgError::Item(item.to_owned());
            let Some((name, value)) = item.split_once('=') else {
                read.fingers = Some(item.parse().ok().filter(|fingers| *fingers <= 5).ok_or_else(wrong)?);
                continue;
            };
            if name == "seed" {
                read.seed = Some(value.parse().map_err(|_| wrong())?);
                continue;
            }
            if name == "glove" {
                // As a configuration file says it.
                read.glove = Some(serde_json::from_value(value.into()).map_err(|_| wrong())?);
                continue;
            }
            let value = value.parse().map_err(|_| wrong())?;
            let pose = read.pose.get_or_insert_default();
            match name {
                "bearing" => pose.bearing_deg = value,
                "elevation" => pose.elevation_deg = value,
                "distance" => pose.distance_m = value,
                _ => return Err(wrong()),
            }
        }
        let checked = read.pose.unwrap_or_default().validate();
        checked.map_err(|error| SourceArgError::Pose(error.to_string()))?;
        Ok(read)
    }
}

impl SourceArg {
    /// The model for whoever names none: rendered hands wear a glove that no person wears, unless they are bare.
    #[must_use]
    pub fn usual_model(&self) -> ModelSection {
        match self {
            Self::Rendered(Rendered { glove: Some(Glove::Skin), .. }) => ModelSection::Hands,
            Self::Rendered(_) => ModelSection::Rendered,
            Self::Ros(_) | Self::Path(_) => ModelSection::Hands,
        }
    }

    /// The same as the source of a robot, which starts files again at their end.
    ///
    /// # Errors
    /// [`SourceArgError`] for what a robot cannot look at.
    pub fn section(&self) -> Result<SourceSection, SourceArgError> {
        let path = match self {
            Self::Rendered(Rendered { fingers: Some(_), .. }) => return Err(SourceArgError::Fingers),
            Self::Rendered(Rendered { pose, glove, seed, .. }) => {
                return Ok(SourceSection::Rendered(RenderedSection {
                    pose: pose.unwrap_or_default(),
                    glove: glove.unwrap_or_default(),
                    seed: seed.unwrap_or_default(),
                    schedule: None,
                }));
            }
            Self::Ros(topic) => {
                return Ok(SourceSection::Ros(RosSection { topic: topic.clone(), router: None, domain: 0 }));
            }
            Self::Path(path) => path.clone(),
        };
        Ok(match kind(&path) {
            Kind::Device => SourceSection::Device(DeviceSection { path, v4l2: DeviceSettings::default() }),
            Kind::Folder => SourceSection::Images(FilesSection { path, repeat: true }),
            Kind::Video => SourceSection::Video(FilesSection { path, repeat: true }),
            Kind::Image => return Err(SourceArgError::Image(path)),
        })
    }
}

/// What is at a path. Of what is not there, the name tells what it would be.
#[must_use]
pub fn kind(path: &Path) -> Kind {
    match std::fs::metadata(path) {
        Ok(about) if about.is_dir() => Kind::Folder,
        Ok(about) if about.file_type().is_fifo() => Kind::Video,
        Ok(about) if !about.is_file() => Kind::Device,
        Err(_) if path.starts_with("/dev") => Kind::Device,
        _ if has_image_name(path) => Kind::Image,
        _ => Kind::Video,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_source_is_told_by_what_is_there() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(kind(folder.path()), Kind::Folder);
        let named = |name: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, "x").unwrap();
            kind(&path)
        };
        assert_eq!((named("a.PNG"), named("a.mp4"), named("a")), (Kind::Image, Kind::Video, Kind::Video));
        assert_eq!(kind(Path::new("/dev/null")), Kind::Device);
        assert_eq!(kind(Path::new("/dev/video-that-is-not")), Kind::Device);
        assert_eq!(kind(Path::new("missing.mp4")), Kind::Video);
    }

    #[test]
    fn a_synthetic_hand_is_described_item_by_item() {
        let read = |text: &str| text.parse::<SourceArg>();
        assert_eq!(read("rendered"), Ok(SourceArg::Rendered(Rendered::default())));
        let pose = Pose { bearing_deg: -30.0, distance_m: 1.2, ..Pose::FRONTAL };
        let all = Rendered { fingers: Some(3), pose: Some(pose), glove: Some(Glove::Skin), seed: Some(7) };
        assert_eq!(
            read("rendered:3,glove=skin,bearing=-30,distance=1.2,seed=7"),
            Ok(SourceArg::Rendered(all))
        );
        assert_eq!(read("rendered.mp4"), Ok(SourceArg::Path("rendered.mp4".into())));
        for (wrong, cause) in [
            ("rendered:6", "'6'"),
            ("rendered:", "rendered:3"),
            ("rendered:tilt=3", "tilt=3"),
            ("rendered:glove=wool", "glove=wool"),
            ("rendered:distance=0", "0.3"),
        ] {
            let error = read(wrong).unwrap_err().to_string();
            assert!(error.contains(cause), "{wrong}: {error}");
        }
    }

    #[test]
    fn what_is_no_camera_is_refused_for_a_robot() {
        let section = |text: &str| text.parse::<SourceArg>().unwrap().section();
        assert!(matches!(section("/dev/video0"), Ok(SourceSection::Device(_))));
        assert!(matches!(section("hand.mp4"), Ok(SourceSection::Video(FilesSection { repeat: true, .. }))));
        assert!(matches!(
            section("rendered:seed=3"),
            Ok(SourceSection::Rendered(RenderedSection { seed: 3, .. }))
        ));
        assert!(matches!(section("rendered:3"), Err(SourceArgError::Fingers)));
        assert!(matches!(section("hand.png"), Err(SourceArgError::Image(_))));
    }
}
