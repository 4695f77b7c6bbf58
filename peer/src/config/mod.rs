//! What a robot is told before it starts: one commented JSON5 file.

mod center;
mod document;
mod learning;

use std::path::{Path, PathBuf};
use std::time::Duration;

use gestalt_protocol::{Keys, RobotId};
use gestalt_strategies::MindConfig;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use thiserror::Error;

use gestalt_link::{LinkConfig, LinkError, Scouting};
use gestalt_vision::camera_model::CameraModel;
use gestalt_vision::pose::Pose;

pub use center::{CenterSection, Fuse, StreamingSection};
pub use document::{Document, Override};
pub use gestalt_vision::config::{LayerConfig, MotionConfig, MotionConfigError, Schedule};
pub use learning::{LearnFrom, LearningSection};

/// A configuration that cannot be used. Each variant names the key and the mend.
#[derive(Debug, Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read the configuration {path}: {cause}")]
    Unreadable {
        /// Which file.
        path: PathBuf,
        /// Why.
        cause: std::io::Error,
    },
    /// The text is not JSON5.
    #[error("{origin} is not JSON5: {cause}")]
    Syntax {
        /// The file, or the flag.
        origin: String,
        /// Where and why.
        cause: String,
    },
    /// A `--cfg` that is not of the form `KEY:VALUE`, or whose key leads through something that is no object.
    #[error("--cfg '{given}': {mend}")]
    Override {
        /// What was given.
        given: String,
        /// What is expected.
        mend: String,
    },
    /// A key that does not exist, or a value of the wrong kind or unit.
    #[error("{key}: {cause}")]
    Value {
        /// The path of the key, `rounds.deadline`.
        key: String,
        /// What is wrong, and what is expected.
        cause: String,
    },
}

impl ConfigError {
    fn value(key: &str, cause: impl Into<String>) -> Self {
        Self::Value { key: key.to_owned(), cause: cause.into() }
    }
}

/// One robot: who it is, what it sees with, how it decides, whom it talks to.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Who this is.
    pub robot: RobotSection,
    /// The swarm's name.
    pub swarm: SwarmName,
    /// The eye, and what is before it.
    pub camera: CameraSection,
    /// The classifier.
    pub model: ModelSection,
    /// How the robot learns from what a human says.
    pub learning: LearningSection,
    /// How the swarm decides; the same for all its robots.
    pub rounds: MindConfig,
    /// For a fusion centre: how it serves robots that only stream.
    pub center: CenterSection,
    /// How the robot finds others, and how many it links to.
    pub links: LinksSection,
    /// Zenoh's own configuration, verbatim; it wins over what Gestalt sets, key by key.
    pub zenoh: Map<String, Value>,
}

/// Who a robot is.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RobotSection {
    /// Its number, unique in the swarm.
    pub id: RobotId,
    /// Its name for people; `robot-<id>` when empty.
    pub name: String,
}

impl Default for RobotSection {
    fn default() -> Self {
        Self { id: RobotId(1), name: String::new() }
    }
}

/// The swarm's name: 1 to 64 of the characters `A-Z a-z 0-9 _ -`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(transparent)]
pub struct SwarmName(pub String);

impl Default for SwarmName {
    fn default() -> Self {
        Self("gestalt".to_owned())
    }
}

/// The eye, and what is before it.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CameraSection {
    /// What the camera does to a picture, and how often it takes one.
    pub model: CameraChoice,
    /// Which stages make its frames like those of other cameras.
    pub layer: LayerConfig,
    /// Where the frames come from.
    pub source: SourceSection,
    /// How motion before it is watched.
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
    /// A drawn, gloved hand.
    Rendered(RenderedSection),
    /// A camera of this machine.
    Device(DeviceSection),
    /// The image files of a folder, in the order of their names.
    Images(FilesSection),
    /// A video file.
    Video(FilesSection),
    /// What `gestalt stream` sends from another machine.
    Stream(StreamSection),
}

/// Frames from another machine.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StreamSection {
    /// Whose frames; `null`: those sent in this robot's own name.
    pub robot: Option<RobotId>,
}

/// A drawn hand before a robot that stands somewhere.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RenderedSection {
    /// Where the robot stands.
    pub pose: Pose,
    /// What the human shows in each round, and this robot's noise, follow from it. The same at all robots that
    /// look at the same human.
    pub seed: u64,
    /// When the human shows gestures; none: in every round, from its opening to its end.
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

/// Which classifier a robot starts with.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ModelSection {
    /// None: the robot relays and counts the votes of others.
    #[default]
    None,
    /// One trained at the start on drawn hands, gestures `0` to `5`; takes some seconds.
    Rendered,
    /// One that `gestalt train` wrote.
    File(PathBuf),
}

/// How a robot finds others, and how many it links to. Endpoints stand in the `zenoh` block.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LinksSection {
    /// Looking for robots by UDP multicast.
    pub scouting: ScoutingSection,
    /// The most links that scouting builds up to. Range `2..=16`.
    pub max_links: usize,
}

impl Default for LinksSection {
    fn default() -> Self {
        Self { scouting: ScoutingSection::default(), max_links: LinkConfig::default().max_links }
    }
}

/// Looking for robots by UDP multicast.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ScoutingSection {
    /// Off: the endpoints of the `zenoh` block alone.
    pub enabled: bool,
    /// The multicast group and port.
    pub address: String,
    /// The network interface, or `auto`.
    pub interface: String,
}

impl Default for ScoutingSection {
    fn default() -> Self {
        let Scouting { address, interface } = Scouting::default();
        Self { enabled: true, address, interface }
    }
}

impl Config {
    /// The names of the sections: what a `--cfg` path can begin with, besides Zenoh's own keys.
    pub const SECTIONS: &[&str] =
        &["robot", "swarm", "camera", "model", "learning", "rounds", "center", "links", "zenoh"];

    /// Reads and checks a configuration file.
    ///
    /// # Errors
    /// See [`ConfigError`].
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        Self::from_document(Document::read(path)?)
    }

    /// Gives a tree of values its meaning, and checks what no single value shows.
    ///
    /// # Errors
    /// [`ConfigError::Value`].
    pub fn from_document(document: Document) -> Result<Self, ConfigError> {
        let config: Self = document.meaning()?;
        config.validate()?;
        Ok(config)
    }

    /// The robot's name for people.
    #[must_use]
    pub fn name(&self) -> String {
        match self.robot.name.as_str() {
            "" => format!("robot-{}", self.robot.id),
            name => name.to_owned(),
        }
    }

    /// How this robot decides: as its swarm does, with the evidence of its own camera weighed as the layer says.
    #[must_use]
    pub fn mind(&self) -> MindConfig {
        let mut mind = self.rounds.clone();
        mind.decorrelation = self.camera.decorrelation.unwrap_or(mind.decorrelation);
        self.camera.layer.weigh(&mut mind);
        mind
    }

    /// How this robot is linked.
    #[must_use]
    pub fn link(&self) -> LinkConfig {
        let ScoutingSection { enabled, address, interface } = self.links.scouting.clone();
        LinkConfig {
            scouting: enabled.then_some(Scouting { address, interface }),
            max_links: self.links.max_links,
            zenoh: self.zenoh.clone(),
            ..LinkConfig::default()
        }
    }

    /// Checks what no single value shows: ranges, and what does not go together.
    ///
    /// # Errors
    /// [`ConfigError::Value`].
    pub fn validate(&self) -> Result<(), ConfigError> {
        Keys::new(&self.swarm.0).map_err(|error| ConfigError::value("swarm", error.to_string()))?;
        self.rounds.validate().map_err(|error| ConfigError::value("rounds", error.to_string()))?;
        self.learning
            .samples
            .validate()
            .map_err(|error| ConfigError::value("learning.samples", error.to_string()))?;
        if self.learning.enabled && matches!(self.model, ModelSection::None) {
            return Err(ConfigError::value(
                "learning.enabled",
                "a robot that learns needs a feature space and a list of gestures, which a model brings: set model to \"rendered\" or {file: \"FILE\"}; with learning.from: \"nothing\" its classifier is not used",
            ));
        }
        self.center.validate()?;
        if !(2..=16).contains(&self.links.max_links) {
            return Err(ConfigError::value(
                "links.max_links",
                format!(
                    "{} is outside 2..=16: two connect a swarm, four give it spare ways",
                    self.links.max_links
                ),
            ));
        }
        self.camera.model.validate("camera.model")?;
        self.mind()
            .validate()
            .map_err(|error| ConfigError::value("camera.decorrelation", error.to_string()))?;
        self.camera
            .motion
            .validate()
            .map_err(|error| ConfigError::value("camera.motion", error.to_string()))?;
        if let SourceSection::Rendered(RenderedSection { schedule: Some(schedule), .. }) = &self.camera.source
        {
            schedule
                .validate()
                .map_err(|cause| ConfigError::value("camera.source.rendered.schedule", cause))?;
        }
        let sees = !matches!(self.camera.source, SourceSection::None);
        if sees && matches!(self.model, ModelSection::None) {
            return Err(ConfigError::value(
                "model",
                "a robot with a camera source needs a classifier: \"rendered\" or {file: \"FILE\"}, or set camera.source to \"none\"",
            ));
        }
        self.link().check(self.robot.id).map_err(|error| match error {
            LinkError::Config { key, cause } => ConfigError::Value { key, cause },
            other => ConfigError::value("zenoh", other.to_string()),
        })
    }
}

impl CameraSection {
    /// What its frames are seen with.
    #[cfg(feature = "opencv")]
    pub(crate) fn sight(&self) -> gestalt_vision::sight::SightConfig {
        let camera = self.model.properties();
        gestalt_vision::sight::SightConfig { camera, layer: self.layer, motion: self.motion.clone() }
    }
}

impl CameraChoice {
    /// The camera of that name; `None` for a name that is none.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "footbot" => Some(Self::Footbot),
            "parrot" => Some(Self::Parrot),
            "laptop" => Some(Self::Laptop),
            _ => None,
        }
    }

    fn validate(&self, key: &str) -> Result<(), ConfigError> {
        match self {
            Self::Custom(model) => model
                .validate()
                .map_err(|error| ConfigError::value(&format!("{key}.custom"), error.to_string())),
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

#[cfg(test)]
mod tests {
    use super::*;

    fn config(text: &str) -> Result<Config, ConfigError> {
        Config::from_document(Document::parse(text, "test")?)
    }

    #[test]
    fn every_shipped_robot_configuration_is_valid() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs");
        let mut read = 0;
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|extension| extension == "json5") {
                Config::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
                read += 1;
            }
        }
        assert!(read >= 3, "{read} configurations");
    }

    #[test]
    fn the_shipped_cameras_are_the_presets_with_the_whole_layer_on() {
        for preset in CameraModel::presets() {
            let file = format!("{}/../configs/{}.json5", env!("CARGO_MANIFEST_DIR"), preset.name);
            let camera = Config::read(Path::new(&file)).unwrap().camera;
            assert!(matches!(camera.model, CameraChoice::Custom(_)), "{file} names every property");
            assert_eq!((camera.model.properties(), camera.layer), (preset, LayerConfig::ALL), "{file}");
        }
    }

    #[test]
    fn a_stage_of_the_layer_is_switched_off_by_itself() {
        let camera = config("{camera: {model: 'parrot', layer: {colour: false}}}").unwrap().camera;
        assert_eq!(camera.layer, LayerConfig { colour: false, ..LayerConfig::ALL });
        assert!(config("{camera: {layer: {color: false}}}").unwrap_err().to_string().contains("colour"));
    }

    #[test]
    fn nothing_said_is_a_relay_that_finds_others_by_itself() {
        let config = config("{}").unwrap();
        assert!(matches!(config.camera.source, SourceSection::None));
        assert!(config.links.scouting.enabled);
        assert_eq!(config.name(), "robot-1");
    }

    #[test]
    fn what_is_wrong_is_named_with_its_key_and_its_mend() {
        for (text, key, mend) in [
            ("{rouns: {}}", "rouns", "rounds"),
            ("{rounds: {alpha: 0.7}}", "rounds", "below 0.5"),
            ("{rounds: {deadline: 5}}", "rounds.deadline", "duration"),
            ("{camera: {decorrelation: '0s'}}", "camera.decorrelation", "above 0"),
            ("{rounds: {deadline: '5 parsecs'}}", "rounds.deadline", "unit"),
            ("{rounds: {rule: 'vote'}}", "rounds.rule", "log_pool"),
            ("{swarm: 'a/b'}", "swarm", "A-Z"),
            ("{robot: {id: -1}}", "robot.id", "u32"),
            ("{learning: {samples: {capacity: 0}}}", "learning.samples", "capacity"),
            ("{learning: {samples: {selection: 'best'}}}", "learning.samples.selection", "representativity"),
            ("{learning: {enabled: true}}", "learning.enabled", "rendered"),
            ("{center: {max_robots: 0}}", "center.max_robots", "1..=256"),
            ("{center: {workers: 0}}", "center.workers", "one per core"),
            ("{center: {gone_after: '1s'}}", "center.gone_after", "frozen_after"),
            ("{center: {fuse: 'mean'}}", "center.fuse", "central"),
            ("{center: {robots: {'7': {camera: 'kite'}}}}", "center.robots.7.camera", "parrot"),
            ("{links: {max_links: 1}}", "links.max_links", "2..=16"),
            ("{camera: {source: {video: {path: 'x.mp4'}}}}", "model", "classifier"),
            ("{camera: {motion: {area: 2}}}", "camera.motion", "0.0002"),
            ("{camera: {motion: {hold: 3}}}", "camera.motion.hold", "duration"),
            ("{camera: {source: {rendered: {schedule: {period: '2s', still: '2s'}}}}}", "schedule", "4s"),
            ("{zenoh: {transprot: {}}}", "zenoh", "transprot"),
            ("{zenoh: {id: 'a1'}}", "zenoh.id", "leave it out"),
        ] {
            let error = config(text).unwrap_err().to_string();
            assert!(error.contains(key) && error.contains(mend), "{text}: {error}");
        }
    }

    #[test]
    fn a_camera_may_have_a_decorrelation_time_of_its_own() {
        let of = |text: &str| config(text).unwrap().mind().decorrelation;
        assert_eq!(of("{rounds: {decorrelation: '700ms'}}"), Duration::from_millis(700));
        let own = "{rounds: {decorrelation: '700ms'}, camera: {decorrelation: '2s'}}";
        assert_eq!(of(own), Duration::from_secs(2));
    }

    #[test]
    fn a_syntax_error_says_where() {
        let error = config("{robot: {id: 1,\n name 'x'}}").unwrap_err().to_string();
        assert!(error.contains("line 2"), "{error}");
    }
}
