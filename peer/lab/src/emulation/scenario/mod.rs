//! A scenario: robots, links, faults and rounds, as data.

mod error;
mod fault;
mod group;
mod link_model;
mod possible;
mod validate;

use std::path::Path;
use std::time::Duration;

use gestalt_protocol::FusionRule;
use gestalt_strategies::MindConfig;
use serde::{Deserialize, Serialize};

pub use error::ScenarioError;
pub use fault::{Churn, Event, Fault};
pub use group::{Group, Lies, View};
pub use link_model::LinkModel;

use super::teaching::Teaching;
use crate::shape::NetworkShape;

/// An emulated swarm and what happens to it. Times count from the start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// The robots, numbered from 1 in this order.
    pub robots: Vec<Group>,
    /// Who is linked to whom.
    pub topology: NetworkShape,
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

/// A fusion rule in a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Contender {
    /// Which rule.
    pub rule: FusionRule,
    /// With which α, when not that of the mind, or the rule's own.
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

    /// The same scenario under another fusion rule.
    #[must_use]
    pub fn contending(&self, contender: Contender) -> Self {
        let mut scenario = self.clone();
        scenario.mind.rule = contender.rule;
        scenario.mind.alpha = contender.alpha.or(self.mind.alpha);
        scenario
    }

    /// When the `n`th gesture is shown, from 0; `n = rounds` is the end.
    #[must_use]
    pub fn showing_at(&self, n: u32) -> Duration {
        self.interval * (n + 1)
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
            ("fps: 2", "robots.view.fps", "fps: 1e-30"),
            ("\"line\"", "topology", "\"star-shaped\""),
            ("\"line\"", "mind.settle", "\"line\", mind: { settle: 3 }"),
            ("\"line\"", "alpha", "\"line\", mind: { alpha: 0.7 }"),
            ("\"line\"", "link.loss", "\"line\", link: { loss: 1 }"),
            (
                "\"line\"",
                "churn.until",
                "\"line\", rounds: 4, churn: { from: '1s', until: '35s', period: '1s' }",
            ),
            ("\"line\"", "robot 9", "\"line\", faults: [{ at: \"1s\", event: { kill: 9 } }]"),
        ]
        .map(|(from, key, to)| (SMALL.replace(from, to), key))
        {
            let error = Scenario::parse(&change, "test").unwrap_err().to_string();
            assert!(error.contains(key), "{key}: {error}");
        }
    }

    #[test]
    fn durations_that_cannot_be_added_up_are_refused_by_name() {
        // A year is more than a day; the times of what happens reach to the end of the longest run.
        let ages = "500000000000years";
        for (key, more) in [
            ("interval", format!("interval: '{ages}'")),
            ("link.latency", format!("link: {{ latency: '{ages}' }}")),
            ("link.jitter", format!("link: {{ jitter: '{ages}' }}")),
            ("link.detection", format!("link: {{ detection: '{ages}' }}")),
            ("churn.period", format!("churn: {{ from: '0s', until: '9s', period: '{ages}' }}")),
            ("churn.from", format!("churn: {{ from: '{ages}', until: '9s', period: '1s' }}")),
            ("churn.until", format!("churn: {{ from: '0s', until: '{ages}', period: '1s' }}")),
            ("faults.at", format!("faults: [{{ at: '{ages}', event: {{ kill: 1 }} }}]")),
            ("learning.after", format!("learning: {{ after: '{ages}' }}")),
        ] {
            let text = SMALL.replace("\"line\"", &format!("\"line\", {more}"));
            let error = Scenario::parse(&text, "test").unwrap_err().to_string();
            assert!(error.contains(key) && error.contains("choose"), "{key}: {error}");
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
