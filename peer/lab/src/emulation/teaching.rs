//! How robots are taught.

use std::time::Duration;

use gestalt_strategies::LearningConfig;
use serde::{Deserialize, Serialize};

use super::answering::{Answering, AskedBy};

/// How robots are taught, and how they learn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Teaching {
    /// What the instructor says of each gesture shown.
    pub feedback: Feedback,
    /// How long after a gesture is shown the instructor speaks.
    #[serde(with = "humantime_serde")]
    pub after: Duration,
    /// How every robot learns.
    pub robots: LearningConfig,
    /// Who asks, and how the instructor answers.
    pub answering: Answering,
}

impl Default for Teaching {
    fn default() -> Self {
        Self {
            feedback: Feedback::default(),
            after: Duration::from_secs(5),
            robots: LearningConfig::default(),
            answering: Answering::default(),
        }
    }
}

impl Teaching {
    /// How every robot learns: where nobody answers, nobody asks.
    #[must_use]
    pub fn of_robots(&self) -> LearningConfig {
        let mut robots = self.robots.clone();
        robots.questions.ask &= self.feedback == Feedback::Asked && self.answering.asked_by == AskedBy::Swarm;
        robots
    }
}

/// What a scripted instructor says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Feedback {
    /// Which gesture it was.
    #[default]
    Full,
    /// Whether the decision was right; nothing where there is none.
    Partial,
    /// Which gesture it was, where that is asked.
    Asked,
    /// Nothing: robots stay with what they know.
    None,
}
