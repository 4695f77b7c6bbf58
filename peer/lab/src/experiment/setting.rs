//! One setting of an experiment: a swarm, what it is shown, and how it learns.

use std::time::Duration;

use gestalt_protocol::MAX_CLASSES;
use gestalt_strategies::{LearningConfig, MindConfig, Ranking};
use serde::{Deserialize, Serialize};

use super::error::ExperimentError;
use crate::emulation::{Answering, Feedback, Group, Order, Poison, Scenario, Teaching};
use crate::shape::NetworkShape;

/// A swarm that learns, and everything that an experiment may vary. What is left out is the default.
///
/// | name | default | meaning |
/// |---|---|---|
/// | `robots` | 10 | how many |
/// | `liars` | 0 | how many of them, the last, share what poisons others |
/// | `poison` | silent | what the liars share |
/// | `rounds` | 12 | gestures shown, one after the other in a random order, then all again |
/// | `topology` | ring | who is linked to whom |
/// | `start` | nothing | what robots know before |
/// | `reduction` | pca | from 110 features to few |
/// | `components` | 24 | how few; at most as many as there are |
/// | `moments` | own | whether robots look at the hand at the same moments |
/// | `drift` | none | what changes half-way |
/// | `feedback` | full | what the instructor says |
/// | `answering` | the swarm asks, no answer is wrong | who asks where the instructor speaks when asked, and which part of what they say is wrong |
/// | `learning` | | how robots keep, share, forget and train |
/// | `own_rules` | none | the name of rules of your own, as handed to [`conduct_by`](super::conduct_by) |
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Setting {
    /// How many robots, at least 1.
    pub robots: usize,
    /// How many of them, the last ones, share what poisons others. What is measured is how well the honest ones judge.
    pub liars: usize,
    /// What the liars share.
    pub poison: Poison,
    /// How many gestures are shown.
    pub rounds: u32,
    /// Who is linked to whom.
    pub topology: NetworkShape,
    /// What robots know before.
    pub start: Start,
    /// From many features to few.
    pub reduction: Method,
    /// How few.
    pub components: usize,
    /// When robots look.
    pub moments: Moments,
    /// What changes half-way.
    pub drift: Drift,
    /// What the instructor says.
    pub feedback: Feedback,
    /// Who asks where the instructor speaks when asked, and how they answer.
    pub answering: Answering,
    /// How robots keep, share, forget and train.
    pub learning: LearningConfig,
    /// The name of rules of your own, in place of those that `learning` names and of the logarithmic pool.
    pub own_rules: Option<String>,
}

/// What robots know before the first round.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Start {
    /// No gesture. Their feature space is fitted on rendered hands.
    #[default]
    Nothing,
    /// A classifier, trained on other hands; their feature space is fitted on these too.
    Model,
    /// The shipped model of learned eyes, as far as its gestures are shown.
    Shipped,
}

/// How many features become few.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// The principal components of most variance.
    #[default]
    Pca,
    /// The features of most information gain.
    InformationGain,
    /// The features of greatest gain ratio.
    GainRatio,
}

impl Method {
    /// The ranking of those that rank.
    #[must_use]
    pub fn ranking(self) -> Option<Ranking> {
        match self {
            Self::Pca => None,
            Self::InformationGain => Some(Ranking::InformationGain),
            Self::GainRatio => Some(Ranking::GainRatio),
        }
    }
}

/// Whether two robots see the same picture of a hand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Moments {
    /// Each looks at its own times: two robots see two pictures of the gesture.
    #[default]
    Own,
    /// All look at once: they see one picture, each from its place.
    Common,
}

/// What changes for good after half of the rounds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Drift {
    /// Nothing.
    #[default]
    None,
    /// The light: it gets dim and warm.
    Light,
    /// The people who show gestures.
    Person,
    /// The cameras: those of another model, Parrots' in place of Foot-bots', Foot-bots' in place of Parrots' and laptops'.
    Camera,
}

impl Default for Setting {
    fn default() -> Self {
        Self {
            robots: 10,
            liars: 0,
            poison: Poison::Silent,
            rounds: 12,
            topology: NetworkShape::Ring,
            start: Start::default(),
            reduction: Method::default(),
            components: 24,
            moments: Moments::default(),
            drift: Drift::default(),
            feedback: Feedback::default(),
            answering: Answering::default(),
            learning: LearningConfig::default(),
            own_rules: None,
        }
    }
}

impl Setting {
    /// The scenario that is emulated: whole minds on a network that loses nothing, and that says little beside samples.
    ///
    /// # Errors
    /// Values that no swarm can have.
    pub fn scenario(&self, classes: usize) -> Result<Scenario, ExperimentError> {
        if self.components == 0 || !(2..=MAX_CLASSES).contains(&classes) {
            return Err(ExperimentError::Setting("components is 0: choose at least 1".to_owned()));
        }
        if self.liars >= self.robots {
            return Err(ExperimentError::Setting(format!(
                "{} liars of {} robots: leave at least one that is honest",
                self.liars, self.robots
            )));
        }
        let seconds = Duration::from_secs;
        let mind = MindConfig {
            // All look for as long; nobody needs to vote twice, and what nothing loses needs no hurried repair.
            vote_interval: seconds(2),
            vote_repeat: seconds(30),
            patience: seconds(2),
            deadline: seconds(4),
            repair_busy: seconds(20),
            repair_idle: seconds(120),
            ..MindConfig::default()
        };
        let group = |name: &str, count, poison| Group {
            name: name.to_owned(),
            count,
            view: None,
            lies: None,
            poison,
        };
        let scenario = Scenario {
            robots: vec![
                group("robot", self.robots - self.liars, None),
                group("liar", self.liars, Some(self.poison)),
            ],
            topology: self.topology,
            link: crate::emulation::LinkModel::default(),
            classes,
            rounds: self.rounds,
            order: Order::InTurn,
            interval: seconds(8),
            mind,
            learning: Some(Teaching {
                feedback: self.feedback,
                after: seconds(6),
                robots: self.learning.clone(),
                answering: self.answering,
            }),
            faults: Vec::new(),
            churn: None,
            compare: Vec::new(),
            seeds: 1,
        };
        scenario.validate()?;
        Ok(scenario)
    }

    /// The time between two frames, in seconds: as slow as a Foot-bot's, unless more are to be kept of a round.
    #[must_use]
    pub fn period(&self) -> f64 {
        (3.0 / self.learning.keep as f64).min(0.5)
    }
}
