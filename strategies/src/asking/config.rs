//! The parameters of a swarm's questions.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Parameters nobody can ask by; each names the field and the mend.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum QuestionsConfigError {
    /// A number of rounds out of range.
    #[error("questions.rounds is {0}: choose from 1 to 1000, for example 3")]
    Rounds(u32),
    /// A duration that nobody waits for.
    #[error("questions.{0} is longer than a day: choose a shorter duration")]
    TooLong(&'static str),
    /// Nats that are none.
    #[error("questions.{field} is {nats}: choose it from 0 to 8 nats, for example {example}")]
    Nats {
        /// The field.
        field: &'static str,
        /// What it is.
        nats: f64,
        /// What it may be.
        example: f64,
    },
    /// A number of labels that is none.
    #[error("questions.familiar is {0}: choose it above 0, for example 4")]
    Familiar(f64),
}

/// When a robot asks in the name of its swarm. In a configuration file what is left out is the default.
///
/// | name | default | meaning | range |
/// |---|---|---|---|
/// | `ask` | true | whether it asks at all | |
/// | `rounds` | 3 | at most one question in so many rounds | 1–1000 |
/// | `apart` | 10s | least time between two | ≤ 1 day |
/// | `after` | 1s | how long after a round's end: an instructor may say it unasked | ≤ 1 day |
/// | `gone` | 15s | how long a question waits for its answer | ≤ 1 day |
/// | `repeated` | 60s | within which what is unknown must be shown again for its name to be asked | ≤ 1 day |
/// | `worth` | 0.15 | least worth of a label, see [`worth_asking`](crate::worth_asking) | 0–8 |
/// | `disagreement` | 0.1 | from how many nats on robots see different things | 0–8 |
/// | `familiar` | 4 | labels of a gesture after which a doubt about it counts half, and a better view of it may be asked for | > 0 |
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct QuestionsConfig {
    /// Whether it asks at all.
    pub ask: bool,
    /// At most one question in so many rounds.
    pub rounds: u32,
    /// The least time between two.
    #[serde(with = "humantime_serde")]
    pub apart: Duration,
    /// How long after a round's end.
    #[serde(with = "humantime_serde")]
    pub after: Duration,
    /// How long a question waits for its answer. Silence is none.
    #[serde(with = "humantime_serde")]
    pub gone: Duration,
    /// Within which time what is unknown must be shown again for its name to be asked.
    #[serde(with = "humantime_serde")]
    pub repeated: Duration,
    /// The least worth of a label, as [`worth_asking`](crate::worth_asking) reckons it.
    pub worth: f64,
    /// From how many nats on robots see different things.
    pub disagreement: f64,
    /// The labels of a gesture after which a doubt about it counts half, and a better view of it may be asked for: the more was said of it, the less another label teaches.
    pub familiar: f64,
}

impl Default for QuestionsConfig {
    fn default() -> Self {
        Self {
            ask: true,
            rounds: 3,
            apart: Duration::from_secs(10),
            after: Duration::from_secs(1),
            gone: Duration::from_secs(15),
            repeated: Duration::from_secs(60),
            worth: 0.15,
            disagreement: 0.1,
            familiar: 4.0,
        }
    }
}

impl QuestionsConfig {
    /// Whether a robot can ask by these parameters.
    ///
    /// # Errors
    /// The first [`QuestionsConfigError`] found.
    pub fn validate(&self) -> Result<(), QuestionsConfigError> {
        if !(1..=1000).contains(&self.rounds) {
            return Err(QuestionsConfigError::Rounds(self.rounds));
        }
        let day = Duration::from_secs(24 * 60 * 60);
        let durations =
            [("apart", self.apart), ("after", self.after), ("gone", self.gone), ("repeated", self.repeated)];
        if let Some((field, _)) = durations.iter().find(|(_, duration)| *duration > day) {
            return Err(QuestionsConfigError::TooLong(field));
        }
        for (field, nats, example) in [("worth", self.worth, 0.15), ("disagreement", self.disagreement, 0.1)]
        {
            if !(0.0..=8.0).contains(&nats) {
                return Err(QuestionsConfigError::Nats { field, nats, example });
            }
        }
        if !(self.familiar > 0.0 && self.familiar.is_finite()) {
            return Err(QuestionsConfigError::Familiar(self.familiar));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_nobody_can_ask_by_is_named() {
        assert_eq!(QuestionsConfig::default().validate(), Ok(()));
        let default = QuestionsConfig::default;
        for (config, field) in [
            (QuestionsConfig { rounds: 0, ..default() }, "rounds"),
            (QuestionsConfig { apart: Duration::MAX, ..default() }, "apart"),
            (QuestionsConfig { after: Duration::MAX, ..default() }, "after"),
            (QuestionsConfig { gone: Duration::MAX, ..default() }, "gone"),
            (QuestionsConfig { repeated: Duration::MAX, ..default() }, "repeated"),
            (QuestionsConfig { worth: f64::NAN, ..default() }, "worth"),
            (QuestionsConfig { disagreement: -1.0, ..default() }, "disagreement"),
            (QuestionsConfig { familiar: 0.0, ..default() }, "familiar"),
        ] {
            let error = config.validate().unwrap_err().to_string();
            assert!(error.contains(field), "{error}");
        }
    }
}
