//! A recognition experiment's file: a scene, and the swarms that look at it.

use std::path::Path;
use std::time::Duration;

use gestalt_strategies::MindConfig;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::experiment::error::ExperimentError;
use gestalt_vision::camera_model::CameraModel;
use gestalt_vision::perception::LayerConfig;
use gestalt_vision::pose::Pose;
use gestalt_vision::source::Glove;

/// What is asked, and how: a commented JSON5 file. See `configs/experiments/cameras/`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recognition {
    /// The question, for tables and plots.
    pub title: String,
    /// Where robots stand, unless their kind says otherwise.
    #[serde(default)]
    pub place: Where,
    /// What the drawn hands wear.
    #[serde(default)]
    pub glove: Glove,
    /// How swarms decide: fields of a [`MindConfig`].
    #[serde(default)]
    pub rounds: Map<String, Value>,
    /// How long each gesture is shown, at most.
    #[serde(default = "two_seconds", with = "humantime_serde")]
    pub shown_for: Duration,
    /// How many gestures each seed shows.
    #[serde(default = "twelve")]
    pub showings: u32,
    /// How many drawn hands the classifiers are trained on.
    #[serde(default = "three_thousand")]
    pub training_frames: usize,
    /// What is compared; each with the first.
    pub swarms: Vec<SwarmPlan>,
    /// How many seeds, unless the command line says otherwise.
    #[serde(default = "twenty")]
    pub seeds: u32,
}

fn two_seconds() -> Duration {
    Duration::from_secs(2)
}

fn twelve() -> u32 {
    12
}

fn twenty() -> u32 {
    20
}

fn three_thousand() -> usize {
    3000
}

/// A swarm, and how its robots see.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SwarmPlan {
    /// Its line in the plots, over the number of robots.
    pub line: String,
    /// What it is made of.
    pub robots: Vec<Kind>,
    /// Which stages of the heterogeneity layer are on.
    #[serde(default)]
    pub layer: LayerConfig,
    /// The cameras on whose views its classifier was trained; all three when there are none.
    #[serde(default)]
    pub trained_on: Vec<String>,
    /// Fields of a [`MindConfig`] in which it differs from the others.
    #[serde(default)]
    pub rounds: Map<String, Value>,
}

/// Robots of one kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Kind {
    /// Their camera: `footbot`, `parrot` or `laptop`.
    pub camera: String,
    /// How many.
    pub count: usize,
    /// Frames per second, if not as the camera has them.
    #[serde(default)]
    pub fps: Option<f64>,
    /// The frames' width in pixels, if not as the camera has it; the height follows.
    #[serde(default)]
    pub width_px: Option<i32>,
    /// The quality of the JPEG through which their frames go; none: they are judged on board.
    #[serde(default)]
    pub jpeg: Option<i32>,
    /// Where they stand, if not where all do.
    #[serde(default)]
    pub place: Option<Where>,
}

/// Where robots stand around the hand: each anywhere within these bounds, whatever the others do.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Where {
    /// Around the vertical, 0 before the palm; degrees.
    pub bearing_deg: [f64; 2],
    /// Above the hand's height; degrees.
    pub elevation_deg: [f64; 2],
    /// From the palm; metres.
    pub distance_m: [f64; 2],
}

impl Default for Where {
    fn default() -> Self {
        Self { bearing_deg: [-75.0, 75.0], elevation_deg: [-25.0, 12.0], distance_m: [0.8, 1.6] }
    }
}

impl Where {
    /// A place within the bounds.
    pub fn draw(&self, rng: &mut ChaCha8Rng) -> Pose {
        let mut between = |[low, high]: [f64; 2]| low + (high - low) * rng.random::<f64>();
        Pose {
            bearing_deg: between(self.bearing_deg),
            elevation_deg: between(self.elevation_deg),
            distance_m: between(self.distance_m),
        }
    }
}

impl Kind {
    /// The camera, as it is changed.
    ///
    /// # Errors
    /// A camera that is none, or cannot be.
    pub fn model(&self) -> Result<CameraModel, ExperimentError> {
        let mut model = camera(&self.camera)?;
        if let Some(fps) = self.fps {
            model.fps = fps;
        }
        if let Some(width) = self.width_px {
            model.height_px =
                (f64::from(model.height_px) * f64::from(width) / f64::from(model.width_px)) as i32;
            model.width_px = width;
        }
        model.validate().map_err(|error| ExperimentError::Setting(error.to_string()))?;
        Ok(model)
    }
}

/// The camera of that name.
pub fn camera(name: &str) -> Result<CameraModel, ExperimentError> {
    CameraModel::named(name).ok_or_else(|| {
        ExperimentError::Setting(format!("'{name}' is no camera: choose footbot, parrot or laptop"))
    })
}

impl SwarmPlan {
    /// How many robots it has.
    #[must_use]
    pub fn size(&self) -> usize {
        self.robots.iter().map(|kind| kind.count).sum()
    }

    /// Each robot by its number in the whole swarm, whatever its kind: the n-th of every swarm stands at the same place, and each of one at a
    /// place of its own.
    pub fn members(&self) -> impl Iterator<Item = (usize, &Kind)> {
        self.robots.iter().flat_map(|kind| std::iter::repeat_n(kind, kind.count)).enumerate()
    }

    /// What it is made of, in words: `10 footbot + 2 parrot (2 fps)`.
    #[must_use]
    pub fn describe(&self) -> String {
        let words = |kind: &Kind| {
            let mut changes = Vec::new();
            changes.extend(kind.fps.map(|fps| format!("{fps} fps")));
            changes.extend(kind.width_px.map(|width| format!("{width} px")));
            changes.extend(kind.jpeg.map(|quality| format!("JPEG {quality}")));
            let changes =
                if changes.is_empty() { String::new() } else { format!(" ({})", changes.join(" ")) };
            format!("{} {}{changes}", kind.count, kind.camera)
        };
        self.robots.iter().map(words).collect::<Vec<_>>().join(" + ")
    }
}

impl Recognition {
    /// Whether a JSON5 text is meant as a recognition experiment.
    #[must_use]
    pub fn is_one(text: &str) -> bool {
        json5::from_str::<Map<String, Value>>(text).is_ok_and(|map| map.contains_key("swarms"))
    }

    /// Reads an experiment from JSON5 text; `origin` names it in errors.
    ///
    /// # Errors
    /// See [`ExperimentError`].
    pub fn parse(text: &str, origin: &Path) -> Result<Self, ExperimentError> {
        let mut deserializer = json5::Deserializer::from_str(text);
        let plan: Self =
            serde_path_to_error::deserialize(&mut deserializer).map_err(|error| ExperimentError::Syntax {
                path: origin.to_owned(),
                key: error.path().to_string(),
                cause: error.inner().to_string(),
            })?;
        plan.validate()?;
        Ok(plan)
    }

    fn validate(&self) -> Result<(), ExperimentError> {
        let wrong = |what: String| Err(ExperimentError::Setting(what));
        if self.seeds == 0 || self.swarms.is_empty() || !(1..=1000).contains(&self.showings) {
            return wrong("choose at least one seed, one swarm, and 1 to 1000 showings".to_owned());
        }
        if !(100..=100_000).contains(&self.training_frames) {
            return wrong("training_frames: choose 100 to 100000".to_owned());
        }
        if self.shown_for < Duration::from_millis(100) || self.shown_for > Duration::from_secs(60) {
            return wrong("shown_for: choose 100ms to 60s".to_owned());
        }
        for swarm in &self.swarms {
            if !(1..=100).contains(&swarm.size()) {
                return wrong(format!("{}: choose 1 to 100 robots", swarm.line));
            }
            if swarm.line.contains(|sign: char| sign == '|' || sign.is_control()) {
                return wrong("a line with a bar or a line break: write it without".to_owned());
            }
            for kind in &swarm.robots {
                kind.model()?;
                if kind.jpeg.is_some_and(|quality| !(1..=100).contains(&quality)) {
                    return wrong("jpeg: choose a quality of 1 to 100".to_owned());
                }
            }
            swarm.trained_on.iter().try_for_each(|name| camera(name).map(drop))?;
            self.mind(swarm)?;
        }
        Ok(())
    }

    /// How a swarm decides.
    ///
    /// # Errors
    /// A field that no [`MindConfig`] has, or a value it cannot have.
    pub fn mind(&self, swarm: &SwarmPlan) -> Result<MindConfig, ExperimentError> {
        let wrong = |cause: String| ExperimentError::Setting(format!("rounds: {cause}"));
        let default = MindConfig { deadline: self.shown_for, ..MindConfig::default() };
        let Ok(Value::Object(mut fields)) = serde_json::to_value(default) else {
            return Err(wrong("the default has no place in JSON".to_owned()));
        };
        fields.extend(self.rounds.clone());
        fields.extend(swarm.rounds.clone());
        let mut mind: MindConfig =
            serde_json::from_value(Value::Object(fields)).map_err(|error| wrong(error.to_string()))?;
        swarm.layer.weigh(&mut mind);
        mind.validate().map_err(|error| wrong(error.to_string()))?;
        Ok(mind)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Recognition, ExperimentError> {
        Recognition::parse(text, Path::new("test"))
    }

    const TWO: &str = "{ title: 't', swarms: [
        { line: 'Foot-bots', robots: [{ camera: 'footbot', count: 10 }] },
        { line: 'mixed', robots: [{ camera: 'footbot', count: 4 }, { camera: 'parrot', count: 2, fps: 2, width_px: 384 }],
          rounds: { discount_repeats: false } } ] }";

    #[test]
    fn a_swarm_is_what_its_file_says() {
        let plan = parse(TWO).unwrap();
        assert_eq!(plan.swarms[1].size(), 6);
        assert_eq!(plan.swarms[1].describe(), "4 footbot + 2 parrot (2 fps 384 px)");
        let parrot = plan.swarms[1].robots[1].model().unwrap();
        assert_eq!((parrot.width_px, parrot.height_px, parrot.fps), (384, 216, 2.0));
        assert!(plan.mind(&plan.swarms[0]).unwrap().discount_repeats);
        assert!(!plan.mind(&plan.swarms[1]).unwrap().discount_repeats);
    }

    #[test]
    fn what_cannot_be_is_named() {
        for (from, to, named) in [
            ("'footbot', count: 10", "'hubble', count: 10", "hubble"),
            ("count: 10", "count: 0", "1 to 100"),
            ("fps: 2,", "fps: 0,", "fps"),
            ("discount_repeats: false", "discount: false", "discount"),
            ("title: 't'", "titel: 't'", "titel"),
        ] {
            let error = parse(&TWO.replace(from, to)).unwrap_err().to_string();
            assert!(error.contains(named), "{to}: {error}");
        }
    }

    #[test]
    fn every_shipped_experiment_with_cameras_is_valid() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/experiments/cameras");
        let mut read = 0;
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let text = std::fs::read_to_string(&path).unwrap();
            assert!(Recognition::is_one(&text), "{}", path.display());
            Recognition::parse(&text, &path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
            read += 1;
        }
        assert!(read >= 4, "{read} experiments");
    }
}
