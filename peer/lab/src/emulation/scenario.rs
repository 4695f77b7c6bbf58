//! A scenario: robots, links, faults and rounds, as data.

use std::path::Path;
use std::time::Duration;

use gestalt_protocol::{FusionRule, MAX_CLASSES, RobotId};
use gestalt_strategies::{LearnError, LearningConfigError, MindConfig, MindConfigError};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::learning::Teaching;
use crate::topology::Topology;

/// A scenario that cannot be run; nothing was.
#[derive(Debug, Error)]
pub enum ScenarioError {
    /// The file cannot be read.
    #[error("cannot read the scenario {path}: {source}")]
    Read {
        /// Which file.
        path: String,
        /// Why not.
        source: std::io::Error,
    },
    /// The text is no scenario.
    #[error("scenario {path}, at {key}: {cause}")]
    Syntax {
        /// Which file.
        path: String,
        /// Where in it.
        key: String,
        /// What is wrong there.
        cause: String,
    },
    /// A value no scenario can have.
    #[error("{key}: {mend}")]
    Value {
        /// Which key.
        key: &'static str,
        /// What to write instead.
        mend: String,
    },
    /// Parameters no mind can work with.
    #[error("mind: {0}")]
    Mind(#[from] MindConfigError),
    /// Parameters no robot can learn with.
    #[error("learning.robots: {0}")]
    Learning(#[from] LearningConfigError),
    /// Nothing that support vector machines can be trained with.
    #[error("learning: {0}")]
    Learner(#[from] LearnError),
}

/// An emulated swarm and what happens to it. Times count from the start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// The robots, numbered from 1 in this order.
    pub robots: Vec<Group>,
    /// Who is linked to whom.
    pub topology: Topology,
    /// What a link does to a message.
    #[serde(default)]
    pub link: LinkModel,
    /// How many gestures there are to tell apart.
    #[serde(default = "six")]
    pub classes: usize,
    /// How many gestures are shown.
    #[serde(default = "twenty")]
    pub rounds: u32,
    /// Which of them when.
    #[serde(default)]
    pub order: Order,
    /// From one showing to the next; the first is after one interval of calm, and one follows the last.
    #[serde(default = "seven_seconds", with = "humantime_serde")]
    pub interval: Duration,
    /// How every robot takes part.
    #[serde(default)]
    pub mind: MindConfig,
    /// How robots learn, if they do. Who has a classifier by its view then starts without it.
    #[serde(default)]
    pub learning: Option<Teaching>,
    /// What goes wrong, and when it is mended.
    #[serde(default)]
    pub faults: Vec<Fault>,
    /// Links that fail and heal at random.
    #[serde(default)]
    pub churn: Option<Churn>,
    /// The fusion rules to compare; the order is that of the table.
    #[serde(default)]
    pub compare: Vec<Contender>,
    /// How many seeds a report is made over, unless the command line says otherwise.
    #[serde(default = "twenty")]
    pub seeds: u32,
}

/// Which gesture is shown when.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Order {
    /// Any, each time.
    #[default]
    Random,
    /// All, one after the other in an order left to chance; then all again.
    InTurn,
}

/// Robots of one kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Group {
    /// A name for people.
    pub name: String,
    /// How many.
    pub count: usize,
    /// What they see; none for robots that only relay, fuse and decide.
    #[serde(default)]
    pub view: Option<View>,
}

/// A statistical view: class scores, the shown class raised by `signal`, each with Gaussian noise of variance 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct View {
    /// Frames per second.
    pub fps: f64,
    /// How far the shown class stands out, in standard deviations of the noise.
    pub signal: f64,
    /// The share of the noise's variance that stays the same for a whole showing, `0.0..=1.0`: at 1 every frame
    /// of a showing errs alike.
    #[serde(default)]
    pub persistence: f64,
}

/// What a link does to a message.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LinkModel {
    /// How long a message takes over one hop, at least.
    #[serde(with = "humantime_serde")]
    pub latency: Duration,
    /// How much longer it may take, uniformly.
    #[serde(with = "humantime_serde")]
    pub jitter: Duration,
    /// The probability that one hop loses it, `0.0..1.0`.
    pub loss: f64,
    /// How long until robots notice that a link or a robot has gone or come, and route accordingly.
    #[serde(with = "humantime_serde")]
    pub detection: Duration,
}

impl Default for LinkModel {
    fn default() -> Self {
        Self {
            latency: Duration::from_millis(2),
            jitter: Duration::from_millis(2),
            loss: 0.0,
            detection: Duration::from_millis(1500),
        }
    }
}

/// One thing that happens to the swarm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fault {
    /// When.
    #[serde(with = "humantime_serde")]
    pub at: Duration,
    /// What.
    pub event: Event,
}

/// What can happen to a swarm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Event {
    /// The link between two robots falls silent.
    Cut(RobotId, RobotId),
    /// That link works again.
    Heal(RobotId, RobotId),
    /// A robot is gone, with all it knew.
    Kill(RobotId),
    /// It starts again, knowing nothing.
    Restart(RobotId),
    /// A robot stops in the midst of things; what is sent to it waits.
    Freeze(RobotId),
    /// It goes on.
    Thaw(RobotId),
}

/// Links that fail and heal at random; at the end all are healed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Churn {
    /// From when.
    #[serde(with = "humantime_serde")]
    pub from: Duration,
    /// Until when.
    #[serde(with = "humantime_serde")]
    pub until: Duration,
    /// The time between two changes: each cuts a link or heals one, whichever link the chance falls on.
    #[serde(with = "humantime_serde")]
    pub period: Duration,
}

/// A fusion rule in a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Contender {
    /// Which rule.
    pub rule: FusionRule,
    /// With which α, when not that of the mind: a share of 5 of 9 votes is a majority, but no probability of .95.
    #[serde(default)]
    pub alpha: Option<f64>,
}

fn six() -> usize {
    6
}

fn twenty() -> u32 {
    20
}

fn seven_seconds() -> Duration {
    Duration::from_secs(7)
}

impl Scenario {
    /// Reads a scenario from a JSON5 file.
    ///
    /// # Errors
    /// See [`ScenarioError`].
    pub fn load(path: &Path) -> Result<Self, ScenarioError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| ScenarioError::Read { path: path.display().to_string(), source })?;
        Self::parse(&text, &path.display().to_string())
    }

    /// Reads a scenario from JSON5 text; `origin` names it in errors.
    ///
    /// # Errors
    /// See [`ScenarioError`].
    pub fn parse(text: &str, origin: &str) -> Result<Self, ScenarioError> {
        let mut deserializer = json5::Deserializer::from_str(text);
        let scenario: Self =
            serde_path_to_error::deserialize(&mut deserializer).map_err(|error| ScenarioError::Syntax {
                path: origin.to_owned(),
                key: error.path().to_string(),
                cause: error.inner().to_string(),
            })?;
        scenario.validate()?;
        Ok(scenario)
    }

    /// How many robots there are.
    #[must_use]
    pub fn swarm_size(&self) -> usize {
        self.robots.iter().map(|group| group.count).sum()
    }

    /// The group of each robot, in the order of their numbers.
    pub fn members(&self) -> impl Iterator<Item = &Group> {
        self.robots.iter().flat_map(|group| std::iter::repeat_n(group, group.count))
    }

    /// Whether the scenario can be run.
    ///
    /// # Errors
    /// The first [`ScenarioError`] found.
    pub fn validate(&self) -> Result<(), ScenarioError> {
        let wrong = |key, mend: String| Err(ScenarioError::Value { key, mend });
        let size = self.swarm_size();
        if !(1..=1000).contains(&size) {
            return wrong("robots", format!("{size} robots in all: choose 1 to 1000"));
        }
        if !(2..=MAX_CLASSES).contains(&self.classes) {
            return wrong("classes", format!("is {}: choose 2 to {MAX_CLASSES}", self.classes));
        }
        if !(1..=100_000).contains(&self.rounds) {
            return wrong("rounds", format!("is {}: choose 1 to 100000", self.rounds));
        }
        if self.seeds == 0 {
            return wrong("seeds", "is 0: choose at least 1".to_owned());
        }
        if !(0.0..1.0).contains(&self.link.loss) {
            return wrong("link.loss", format!("is {}: choose from 0 to below 1", self.link.loss));
        }
        for view in self.robots.iter().filter_map(|group| group.view) {
            if !(view.fps > 0.0 && view.fps <= 1000.0) {
                return wrong("robots.view.fps", format!("is {}: choose above 0, at most 1000", view.fps));
            }
            if !(view.signal >= 0.0 && view.signal <= 100.0) {
                return wrong("robots.view.signal", format!("is {}: choose 0 to 100", view.signal));
            }
            if !(0.0..=1.0).contains(&view.persistence) {
                return wrong("robots.view.persistence", format!("is {}: choose 0 to 1", view.persistence));
            }
        }
        self.mind.validate()?;
        if let Some(teaching) = &self.learning {
            teaching.robots.validate()?;
            if teaching.after >= self.interval {
                return wrong("learning.after", "speak before the next gesture is shown".to_owned());
            }
        }
        for contender in &self.compare {
            self.contending(*contender).mind.validate()?;
        }
        if self.interval <= self.mind.refractory {
            return wrong(
                "interval",
                "no longer than mind.refractory: no second round would open".to_owned(),
            );
        }
        if let Some(churn) = self.churn
            && (churn.period.is_zero() || churn.until <= churn.from)
        {
            return wrong("churn", "choose a period above 0 and an end after the beginning".to_owned());
        }
        let known = |robot: RobotId| (1..=size).contains(&(robot.0 as usize));
        for fault in &self.faults {
            let robots = fault.event.robots();
            if let Some(robot) = robots.into_iter().find(|robot| !known(*robot)) {
                return wrong("faults", format!("there is no robot {robot}: choose 1 to {size}"));
            }
            if matches!(fault.event, Event::Cut(a, b) | Event::Heal(a, b) if a == b) {
                return wrong("faults", "a link has two ends: name two robots".to_owned());
            }
        }
        Ok(())
    }

    /// The same scenario under another fusion rule.
    #[must_use]
    pub fn contending(&self, contender: Contender) -> Self {
        let mut scenario = self.clone();
        scenario.mind.rule = contender.rule;
        scenario.mind.alpha = contender.alpha.unwrap_or(self.mind.alpha);
        scenario
    }

    /// When the `n`th gesture is shown, from 0; `n = rounds` is the end.
    #[must_use]
    pub fn showing_at(&self, n: u32) -> Duration {
        self.interval * (n + 1)
    }
}

impl Event {
    fn robots(self) -> Vec<RobotId> {
        match self {
            Self::Cut(a, b) | Self::Heal(a, b) => vec![a, b],
            Self::Kill(robot) | Self::Restart(robot) | Self::Freeze(robot) | Self::Thaw(robot) => vec![robot],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: &str =
        r#"{ robots: [{ name: "a", count: 2, view: { fps: 2, signal: 1 } }], topology: "line" }"#;

    #[test]
    fn what_is_left_out_is_the_default() {
        let scenario = Scenario::parse(SMALL, "test").unwrap();
        assert_eq!((scenario.swarm_size(), scenario.classes), (2, 6));
        assert_eq!(scenario.mind, MindConfig::default());
    }

    #[test]
    fn a_mistake_names_the_key() {
        for (change, key) in [
            ("signal: 1", "robots[0].view.signl", "signl: 1"),
            ("\"line\"", "topology", "\"star-shaped\""),
            ("\"line\"", "mind.settle", "\"line\", mind: { settle: 3 }"),
            ("\"line\"", "alpha", "\"line\", mind: { alpha: 0.7 }"),
            ("\"line\"", "link.loss", "\"line\", link: { loss: 1 }"),
            ("\"line\"", "robot 9", "\"line\", faults: [{ at: \"1s\", event: { kill: 9 } }]"),
        ]
        .map(|(from, key, to)| (SMALL.replace(from, to), key))
        {
            let error = Scenario::parse(&change, "test").unwrap_err().to_string();
            assert!(error.contains(key), "{key}: {error}");
        }
    }

    #[test]
    fn every_shipped_scenario_can_be_run() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/emulation");
        let mut found = 0;
        for entry in std::fs::read_dir(folder).unwrap() {
            Scenario::load(&entry.unwrap().path()).unwrap();
            found += 1;
        }
        assert!(found >= 3);
    }
}
