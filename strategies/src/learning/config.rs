//! The parameters of a robot's learning.

use std::time::Duration;

use gestalt_svm::LearnerOptions;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::asking::{QuestionsConfig, QuestionsConfigError};
use crate::forgetting::ForgettingRule;
use crate::scrutiny::PoisonDefence;
use crate::selection::SelectionRule;
use crate::shares::LEAST;
use crate::vector_codec::Precision;

/// Parameters no robot can learn with; each names the field and the mend.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum LearningConfigError {
    /// A number of samples out of range.
    #[error("{field} is {value}: choose from {least} to {most}")]
    Range {
        /// The field.
        field: &'static str,
        /// What it is.
        value: usize,
        /// The least it may be.
        least: usize,
        /// The most it may be.
        most: usize,
    },
    /// A part that is none.
    #[error("{field} is {value}: choose it from {least} to 1")]
    Part {
        /// The field.
        field: &'static str,
        /// What it is.
        value: f64,
        /// The least it may be.
        least: f64,
    },
    /// Groups have room of their own, and no share beside.
    #[error(
        "author_shares is false and learner.groups set: groups have room of their own, and the rule of forgetting is not asked; leave one of them out"
    )]
    Shares,
    /// Groups whose samples would go as they come.
    #[error(
        "capacity is {capacity} and learner.groups {groups}: each group and this robot have an equal part of the room, of {LEAST} samples at least; choose a capacity of {least} or more, or fewer groups"
    )]
    Room {
        /// The most samples held.
        capacity: usize,
        /// How many groups.
        groups: usize,
        /// The least capacity for as many.
        least: usize,
    },
    /// Fewer bytes than one sample takes.
    #[error(
        "share_bytes is {0}: choose at least 128, and as many as one sample of the model takes, or null for no bound"
    )]
    Bytes(u32),
    /// A weight in the defence against poison that is none.
    #[error("poison.{field} is {value}: choose it from {least} to 100, or 0 to do without")]
    Weight {
        /// The field.
        field: &'static str,
        /// What it is.
        value: f64,
        /// The least it may be, beside 0.
        least: f64,
    },
    /// Which samples of one author are trained on follows from those of the others, so nothing is certain of a majority of groups.
    #[error("poison and learner.groups exclude each other: leave one of them out")]
    Groups,
    /// An unlikely time between looks.
    #[error("spacing is longer than a minute: choose a shorter duration, for example 400ms")]
    Spacing,
    /// Questions that nobody can ask.
    #[error(transparent)]
    Questions(#[from] QuestionsConfigError),
}

/// How a robot learns: what it keeps, what it shares, what it forgets. In a configuration file what is left out is the
/// default.
///
/// | name | default | meaning | range |
/// |---|---|---|---|
/// | `capacity` | 1000 | T: the most samples held | 2–100,000, with groups of authors at least 5 for each and 5 more |
/// | `keep` | 3 | M: observations of a round that become samples | 1–64 |
/// | `spacing` | 400ms | least time between two of them | ≤ 1 min |
/// | `share_samples` | none | n: the most samples shared per round | ≥ 0 |
/// | `share_fraction` | 1.0 | B: the most samples shared, as a part of those newly acquired | 0–1 |
/// | `share_per_round` | 100 | the most samples that the whole swarm shares per round | ≥ 0 |
/// | `share_bytes` | 512 | the most bytes of samples per round, with their envelopes and, where robots sign, 64 for each signature | ≥ 128, and what [one sample](Self::check_share_bytes) takes |
/// | `precision` | i8 | how shared vectors travel | |
/// | `selection` | k_center | which samples are shared | |
/// | `forgetting` | redundancy | which samples go when there are more than T | |
/// | `author_shares` | true | no author's samples push out those of the others, whatever the rule of forgetting names; false: the rule alone | |
/// | `sure` | 0.95 | probability from which a sample of several possible gestures is labelled by the robot itself | 0.5–1 |
/// | `poison` | | how samples of others are met that would teach wrongly: see [`PoisonDefence`] |  |
/// | `aside` | 256 | the most samples kept aside until it is known what they show | 0–100,000 |
/// | `learner` | | how the support vector machines are trained | |
/// | `questions` | | when the swarm asks its instructor, see [`QuestionsConfig`] | |
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LearningConfig {
    /// T: the most samples held, personal, shared and external together.
    pub capacity: usize,
    /// M: how many observations of a round become samples.
    pub keep: usize,
    /// The least time between two of them: frames that follow each other show the same.
    #[serde(with = "humantime_serde")]
    pub spacing: Duration,
    /// n: the most samples shared per round.
    pub share_samples: Option<u32>,
    /// B: the most samples shared, as a part of those newly acquired. What a round leaves of it counts for the next.
    pub share_fraction: f64,
    /// The most samples that all robots alive share per round, about: divided by their number, and what that leaves over falls by lot. All
    /// robots of a swarm should have the same; each keeps to it by itself. What it withholds stays personal.
    ///
    /// Every robot takes in what all share, so without it their work grows with the square of their number, and no sample lasts: a
    /// thousand robots that share three each replace all of 1000 samples three times a round. By default it is a tenth of the default
    /// `capacity`: what a round brings stays for ten, and at most 33 robots that look three times share all they would.
    pub share_per_round: Option<u32>,
    /// The most bytes of samples per round, with their envelopes and signatures.
    pub share_bytes: Option<u32>,
    /// How shared vectors travel.
    pub precision: Precision,
    /// Which samples are shared.
    pub selection: SelectionRule,
    /// Which samples go when there are more than T.
    pub forgetting: ForgettingRule,
    /// Whether each author has a share of the room: of more than ⌈1.25 · T / robots⌉ samples of another robot the oldest go before the rule of
    /// forgetting is asked, and own ones stay while they are ⌈T / robots⌉ or fewer, though the rule names them. So whoever sends most changes
    /// little. Without it the rule alone says what goes: that is for comparing rules, and for no robot among strangers.
    pub author_shares: bool,
    /// From which probability on a sample of which several gestures are possible is labelled by the robot itself.
    pub sure: f64,
    /// The most samples kept aside until it is known what they show.
    pub aside: usize,
    /// How samples of others are met that would teach wrongly.
    pub poison: PoisonDefence,
    /// How the support vector machines are trained.
    pub learner: LearnerOptions,
    /// When the swarm asks its instructor, and what.
    pub questions: QuestionsConfig,
}

impl Default for LearningConfig {
    fn default() -> Self {
        Self {
            capacity: 1000,
            keep: 3,
            spacing: Duration::from_millis(400),
            share_samples: None,
            share_fraction: 1.0,
            share_per_round: Some(100),
            share_bytes: Some(512),
            precision: Precision::default(),
            selection: SelectionRule::default(),
            forgetting: ForgettingRule::default(),
            author_shares: true,
            sure: 0.95,
            aside: 256,
            poison: PoisonDefence::default(),
            learner: LearnerOptions::default(),
            questions: QuestionsConfig::default(),
        }
    }
}

impl LearningConfig {
    /// Whether a robot can learn with these parameters.
    ///
    /// # Errors
    /// The first [`LearningConfigError`] found.
    pub fn validate(&self) -> Result<(), LearningConfigError> {
        for (field, value, least, most) in [
            ("capacity", self.capacity, 2, 100_000),
            ("keep", self.keep, 1, 64),
            ("aside", self.aside, 0, 100_000),
        ] {
            if !(least..=most).contains(&value) {
                return Err(LearningConfigError::Range { field, value, least, most });
            }
        }
        for (field, value, least) in [("share_fraction", self.share_fraction, 0.0), ("sure", self.sure, 0.5)]
        {
            if !(least..=1.0).contains(&value) {
                return Err(LearningConfigError::Part { field, value, least });
            }
        }
        let PoisonDefence { influence, agreement } = self.poison;
        for (field, value, least) in [("influence", influence, 1.0), ("agreement", agreement, 0.0)] {
            if value != 0.0 && !(least..=100.0).contains(&value) {
                return Err(LearningConfigError::Weight { field, value, least });
            }
        }
        if self.learner.groups > 0 && self.poison != PoisonDefence::default() {
            return Err(LearningConfigError::Groups);
        }
        if self.learner.groups > 0 && !self.author_shares {
            return Err(LearningConfigError::Shares);
        }
        let (capacity, groups) = (self.capacity, self.learner.groups);
        let least = groups.saturating_add(1).saturating_mul(LEAST);
        if groups > 0 && capacity < least {
            return Err(LearningConfigError::Room { capacity, groups, least });
        }
        if let Some(bytes) = self.share_bytes.filter(|bytes| *bytes < 128) {
            return Err(LearningConfigError::Bytes(bytes));
        }
        if self.spacing > Duration::from_secs(60) {
            return Err(LearningConfigError::Spacing);
        }
        Ok(self.questions.validate()?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_nobody_can_learn_with_is_named() {
        assert_eq!(LearningConfig::default().validate(), Ok(()));
        let default = LearningConfig::default;
        let with_groups = |groups, capacity| LearningConfig {
            capacity,
            learner: LearnerOptions { groups, ..Default::default() },
            ..default()
        };
        assert_eq!(with_groups(63, 320).validate(), Ok(()));
        for (config, field) in [
            (LearningConfig { capacity: 1, ..default() }, "capacity"),
            (LearningConfig { keep: 0, ..default() }, "keep"),
            (LearningConfig { share_fraction: 1.1, ..default() }, "share_fraction"),
            (LearningConfig { share_fraction: f64::NAN, ..default() }, "share_fraction"),
            (LearningConfig { share_bytes: Some(10), ..default() }, "share_bytes"),
            (LearningConfig { sure: 0.2, ..default() }, "sure"),
            (
                LearningConfig {
                    poison: PoisonDefence { influence: 0.5, ..Default::default() },
                    ..default()
                },
                "influence",
            ),
            (
                LearningConfig {
                    poison: PoisonDefence { agreement: f64::NAN, ..Default::default() },
                    ..default()
                },
                "agreement",
            ),
            (
                LearningConfig {
                    author_shares: false,
                    learner: LearnerOptions { groups: 3, ..Default::default() },
                    ..default()
                },
                "author_shares",
            ),
            (with_groups(63, 319), "a capacity of 320"),
            (LearningConfig { spacing: Duration::MAX, ..default() }, "spacing"),
        ] {
            let error = config.validate().unwrap_err().to_string();
            assert!(error.contains(field), "{error}");
        }
    }
}
