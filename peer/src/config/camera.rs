//! What a robot sees with, as its configuration file says it.

use std::path::PathBuf;
use std::time::Duration;

use gestalt_protocol::RobotId;
use gestalt_ros::NodeName;
use gestalt_vision::camera_model::CameraModel;
use gestalt_vision::config::{DeviceSettings, Glove, LayerConfig, MotionConfig, Schedule};
use gestalt_vision::pose::Pose;
use serde::{Deserialize, Serialize};

use super::ConfigError;

/// The camera, and what is in front of it.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CameraSection {
    /// What the camera does to a picture, and how often it takes one.
    pub model: CameraChoice,
    /// Which stages make its frames like those of other cameras.
    pub layer: LayerConfig,
    /// Where the frames come from.
    pub source: SourceSection,
    /// How motion in front of it is watched.
    pub motion: MotionConfig,
    /// τ of this camera: how long until its view may have changed enough to count as another look. `None`: as long as
    /// `rounds.decorrelation` says for the swarm.
    #[serde(with = "humantime_serde")]
    pub decorrelation: Option<Duration>,
}

/// A camera by name, or described.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CameraChoice {
    /// 384×288 at 2 frames per second.
    #[default]
    Footbot,
    /// 640×360 at 30 frames per second.
    Parrot,
    /// 640×480 at 15 frames per second.
    Laptop,
    /// Any other.
    Custom(CameraModel),
}

/// Where a robot's frames come from.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum SourceSection {
    /// Nowhere: a robot that relays and counts, but sees nothing.
    #[default]
    None,
    /// A synthetic hand.
    Rendered(RenderedSection),
    /// A camera of this machine.
    Device(DeviceSection),
    /// The image files of a folder, in the order of their names.
    Images(FilesSection),
    /// A video file.
    Video(FilesSection),
    /// What `gestalt stream` sends from another machine.
    Stream(StreamSection),
    /// A camera topic of a ROS 2 system.
    Ros(RosSection),
}

/// A synthetic hand in front of a robot that stands somewhere.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RenderedSection {
    /// Where the robot stands.
    pub pose: Pose,
    /// What the hand wears. The same at all robots that look at the same person.
    pub glove: Glove,
    /// What the person shows in each round, and this robot's noise, follow from it. The same at all robots that
    /// look at the same person.
    pub seed: u64,
    /// When the person shows gestures; none: in every round, from its opening to its end.
    pub schedule: Option<Schedule>,
}

/// A camera of this machine, by V4L2.
///
/// It is asked for the size and rate of `camera.model`. One that is not there, is unplugged, frozen, or delivers no pictures is
/// no reason to stop: the robot says so in its status, goes on without it, and tries again every few seconds.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeviceSection {
    /// Its file, `/dev/video0`.
    pub path: PathBuf,
    /// How it is set up.
    #[serde(default)]
    pub v4l2: DeviceSettings,
}

/// Frames from the disk.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FilesSection {
    /// The folder or the file.
    pub path: PathBuf,
    /// Whether to start again at the end.
    #[serde(default, rename = "loop")]
    pub repeat: bool,
}

/// Frames from another machine.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StreamSection {
    /// Whose frames; `null`: those sent in this robot's own name.
    pub robot: Option<RobotId>,
}

/// A camera that a ROS 2 driver owns. It is known to ROS as the node `gestalt_camera_<robot>`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RosSection {
    /// The topic, from its first slash: of `sensor_msgs/CompressedImage` when it ends in `/compressed`, as image_transport names them,
    /// otherwise of `sensor_msgs/Image`.
    pub topic: String,
    /// The Zenoh router of the ROS system; `null`: the one on this machine, `tcp/localhost:7447`.
    #[serde(default)]
    pub router: Option<String>,
    /// The ROS domain, `ROS_DOMAIN_ID`.
    #[serde(default)]
    pub domain: u32,
}

impl CameraSection {
    /// What its frames are seen with.
    #[cfg(feature = "opencv")]
    pub(crate) fn sight(&self) -> gestalt_vision::sight::SightConfig {
        let camera = self.model.properties();
        gestalt_vision::sight::SightConfig { camera, layer: self.layer, motion: self.motion.clone() }
    }

    /// Each value outside its range.
    pub(super) fn check(&self) -> Vec<ConfigError> {
        let motion = self.motion.validate().map_err(|error| ConfigError::value("camera.motion", error));
        let mut checks = vec![self.model.check("camera.model"), motion];
        if let SourceSection::Rendered(RenderedSection { pose, schedule, .. }) = &self.source {
            let key = "camera.source.rendered";
            checks.push(pose.validate().map_err(|error| ConfigError::value(key, error)));
            let schedule = schedule.map_or(Ok(()), |schedule| schedule.validate());
            checks.push(schedule.map_err(|cause| ConfigError::value(&format!("{key}.schedule"), cause)));
        }
        if let SourceSection::Ros(RosSection { topic, .. }) = &self.source {
            let named = NodeName::new("/", "gestalt").and_then(|node| node.topic(topic));
            checks
                .push(named.map(drop).map_err(|error| ConfigError::value("camera.source.ros.topic", error)));
        }
        if let SourceSection::Device(device) = &self.source {
            let set = device.v4l2.validate();
            checks.push(set.map_err(|cause| ConfigError::value("camera.source.device.v4l2", cause)));
        }
        checks.into_iter().filter_map(Result::err).collect()
    }
}

impl CameraChoice {
    /// The names of those that need no description.
    pub const NAMES: [&str; 3] = ["footbot", "parrot", "laptop"];

    /// The camera of that name; `None` for a name that is not one.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "footbot" => Some(Self::Footbot),
            "parrot" => Some(Self::Parrot),
            "laptop" => Some(Self::Laptop),
            _ => None,
        }
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> String {
        self.properties().name
    }

    pub(super) fn check(&self, key: &str) -> Result<(), ConfigError> {
        match self {
            Self::Custom(model) => {
                model.validate().map_err(|error| ConfigError::value(&format!("{key}.custom"), error))
            }
            Self::Footbot | Self::Parrot | Self::Laptop => Ok(()),
        }
    }

    /// The properties of the chosen camera.
    #[must_use]
    pub fn properties(&self) -> CameraModel {
        match self {
            Self::Footbot => CameraModel::footbot(),
            Self::Parrot => CameraModel::parrot(),
            Self::Laptop => CameraModel::laptop(),
            Self::Custom(model) => model.clone(),
        }
    }
}
