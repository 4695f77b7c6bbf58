//! What a robot is told before it starts: one commented JSON5 file.

mod camera;
mod center;
#[cfg(feature = "opencv")]
pub mod check;
mod document;
mod error;
mod learning;
mod links;
mod ros;
mod strict;
mod template;
mod trust;
mod web;

use std::convert::Infallible;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use gestalt_protocol::{Keys, RobotId};
use gestalt_strategies::MindConfig;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use gestalt_link::{LinkConfig, LinkError, Scouting};

pub use camera::{
    CameraChoice, CameraSection, DeviceSection, FilesSection, RenderedSection, RosSection, SourceSection,
    StreamSection,
};
pub use center::{CenterSection, Fuse, StreamingSection};
pub use document::{Document, Override};
pub use error::ConfigError;
pub use gestalt_vision::config::{DeviceSettings, LayerConfig, MotionConfig, MotionConfigError, Schedule};
pub use learning::{LearnFrom, LearningSection};
pub use links::{LinksSection, ScoutingSection};
pub use ros::RosNodeSection;
pub use template::TEMPLATE;
pub use trust::{ROSTER_FILE, TrustSection, certificate_file, client_key_file, key_file};
pub use web::WebSection;

/// One robot: who it is, what it sees with, how it decides, whom it talks to.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Who this is.
    pub robot: RobotSection,
    /// The swarm's name.
    pub swarm: SwarmName,
    /// The camera, and what is in front of it.
    pub camera: CameraSection,
    /// The classifier.
    pub model: ModelSection,
    /// How the robot learns from feedback.
    pub learning: LearningSection,
    /// How the swarm decides; the same for all its robots.
    pub rounds: MindConfig,
    /// For a fusion centre: how it serves robots that only stream.
    pub center: CenterSection,
    /// Whom the robot believes.
    pub trust: TrustSection,
    /// A page to watch and teach the swarm.
    pub web: WebSection,
    /// What ROS sees of the robot.
    pub ros: RosNodeSection,
    /// How the robot finds others, and how many it links to.
    pub links: LinksSection,
    /// Zenoh's own configuration, verbatim; it takes precedence over what Gestalt sets, key by key.
    pub zenoh: Map<String, Value>,
}

/// Who a robot is.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RobotSection {
    /// Its number, unique in the swarm.
    pub id: RobotId,
    /// Its display name; `robot-<id>` when empty.
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

/// Which classifier a robot starts with.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ModelSection {
    /// None: the robot relays, and takes part in decisions without voting.
    #[default]
    None,
    /// The one of learned eyes, for bare hands before any camera: gestures `0` to `5`.
    Hands,
    /// The one of rendered hands, trained on them: gestures `0` to `5`.
    Rendered,
    /// One that `gestalt train` wrote.
    File(PathBuf),
}

impl FromStr for ModelSection {
    type Err = Infallible;

    /// `none`, `hands`, `rendered`, or else the path of a file (`./rendered` for one of that name).
    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(match text {
            "none" => Self::None,
            "hands" => Self::Hands,
            "rendered" => Self::Rendered,
            path => Self::File(path.into()),
        })
    }
}

impl Config {
    /// The names of the sections: what a `--cfg` path can begin with, besides Zenoh's own keys.
    pub const SECTIONS: &[&str] = &[
        "robot", "swarm", "camera", "model", "learning", "rounds", "center", "trust", "web", "ros", "links",
        "zenoh",
    ];

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

    /// The robot's display name.
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
            cells: self.links.cells,
            insecure: self.trust.insecure,
            zenoh: self.zenoh.clone(),
            ..LinkConfig::default()
        }
    }

    /// Checks what no single value shows: ranges, and what does not go together.
    ///
    /// # Errors
    /// [`ConfigError::Value`]: the first of the [problems](Self::problems).
    pub fn validate(&self) -> Result<(), ConfigError> {
        self.problems().into_iter().next().map_or(Ok(()), Err)
    }

    /// Everything outside its range, and everything that does not go together; empty for a configuration that can be used
    /// if the files that it names can be (see [`check`]).
    #[must_use]
    pub fn problems(&self) -> Vec<ConfigError> {
        let mut found = Vec::new();
        let mut note = |checked: Result<(), ConfigError>| found.extend(checked.err());
        note(Keys::new(&self.swarm.0).map(drop).map_err(|error| ConfigError::value("swarm", error)));
        let rounds = self.rounds.validate().map_err(|error| ConfigError::value("rounds", error));
        // What is wrong for the whole swarm is wrong for this robot as well, and said once.
        note(match rounds {
            Ok(()) => {
                self.mind().validate().map_err(|error| ConfigError::value("camera.decorrelation", error))
            }
            wrong => wrong,
        });
        let samples = &self.learning.samples;
        note(samples.validate().map_err(|error| ConfigError::value("learning.samples", error)));
        note(self.links.check());
        found.extend(self.camera.check());
        found.extend(self.check_model().err());
        found.extend(self.center.check());
        found.extend(self.ros.check(self.robot.id, !matches!(self.camera.source, SourceSection::None)));
        // Too few links would be said again, in other words.
        if self.links.check().is_ok()
            && let Err(error) = self.link().check(self.robot.id, self.trust.keys.is_some())
        {
            found.push(match error {
                LinkError::Config { key, cause } => ConfigError::Value { key, cause },
                other => ConfigError::value("zenoh", other),
            });
        }
        found
    }

    /// Whether there is a model for all that needs one.
    fn check_model(&self) -> Result<(), ConfigError> {
        if self.model != ModelSection::None {
            return Ok(());
        }
        if self.learning.enabled {
            return Err(ConfigError::value(
                "learning.enabled",
                "learning needs a feature space and a vocabulary, which come with a model: set model to \"rendered\" or {file: \"FILE\"} (with learning.from: \"nothing\" its classifier is not used)",
            ));
        }
        if matches!(self.camera.source, SourceSection::None) {
            return Ok(());
        }
        Err(ConfigError::value(
            "model",
            "a robot with a camera source needs a classifier: \"rendered\" or {file: \"FILE\"}, or set camera.source to \"none\"",
        ))
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use gestalt_vision::camera_model::CameraModel;

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
    fn what_is_wrong_is_named_with_its_key_and_how_to_fix_it() {
        for (text, key, fix) in [
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
            ("{ros: {enabled: true}}", "ros.enabled", "camera.source"),
            ("{ros: {views_per_second: 90}}", "ros.views_per_second", "0.1..=30"),
            ("{ros: {namespace: 'a b'}}", "ros.namespace", "letters"),
            ("{links: {max_links: 1}}", "links.max_links", "2..=16"),
            ("{links: {cells: {size: 51}}}", "links.cells.size", "1..=50"),
            ("{links: {cells: {}, scouting: {enabled: false}}}", "links.cells", "scouting"),
            ("{camera: {source: {video: {path: 'x.mp4'}}}}", "model", "classifier"),
            (
                "{camera: {source: {rendered: {pose: {bearing_deg: 0, elevation_deg: 0, distance_m: 0}}}}, model: 'rendered'}",
                "pose",
                "0.3",
            ),
            (
                "{camera: {source: {device: {path: '/dev/video0', v4l2: {buffers: 1}}}}, model: 'hands'}",
                "camera.source.device.v4l2",
                "2 to 10",
            ),
            ("{camera: {motion: {area: 2}}}", "camera.motion", "0.0002"),
            ("{camera: {motion: {hold: 3}}}", "camera.motion.hold", "duration"),
            ("{camera: {source: {rendered: {schedule: {period: '2s', still: '2s'}}}}}", "schedule", "4s"),
            ("{zenoh: {transprot: {}}}", "zenoh", "transprot"),
            ("{zenoh: {id: 'a1'}}", "zenoh.id", "leave it out"),
        ] {
            let error = config(text).unwrap_err().to_string();
            assert!(error.contains(key) && error.contains(fix), "{text}: {error}");
        }
    }

    #[test]
    fn all_problems_are_found_at_once() {
        let config: Config = Document::parse(
            "{swarm: 'a/b', rounds: {alpha: 0.7}, camera: {motion: {area: 2}, source: {rendered: {pose: {bearing_deg: 999, \
             elevation_deg: 0, distance_m: 1}}}}, links: {max_links: 1}, center: {workers: 0, max_robots: 0}}",
            "test",
        )
        .unwrap()
        .meaning()
        .unwrap();
        let found = config.problems().iter().map(ToString::to_string).collect::<Vec<_>>();
        let keys = ["swarm", "rounds", "model", "links.max_links", "camera.motion", "camera.source.rendered"];
        for key in keys.into_iter().chain(["center.max_robots", "center.workers"]) {
            let of_key = found.iter().filter(|problem| problem.starts_with(&format!("{key}: "))).count();
            assert_eq!(of_key, 1, "{key}: {found:?}");
        }
        assert_eq!(found.len(), 8, "{found:?}");
    }

    #[test]
    fn a_model_is_named_or_a_file() {
        let read = |text: &str| text.parse::<ModelSection>().unwrap();
        assert_eq!((read("none"), read("rendered")), (ModelSection::None, ModelSection::Rendered));
        assert_eq!(read("hands"), ModelSection::Hands);
        assert_eq!(read("./rendered"), ModelSection::File("./rendered".into()));
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
