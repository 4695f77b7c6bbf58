//! What a swarm is made of.

use std::time::Duration;

use gestalt_strategies::{LearningConfig, MindConfig};

use crate::attack::Setting;

/// What a swarm is made of.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Whether its robots sign.
    pub setting: Setting,
    /// How many honest robots there are, from robot 1 on.
    pub honest: u32,
    /// How many enrolled robots run the adversary's program: the numbers after the honest. They are alive and neighbours of all.
    pub liars: u32,
    /// The parameters of the rounds.
    pub rounds: MindConfig,
    /// The parameters of learning.
    pub learning: LearningConfig,
    /// The part of the frames in which a robot takes the gesture for another.
    pub errors: f64,
}

impl Plan {
    /// Five honest robots and nobody else.
    pub fn new(setting: Setting) -> Self {
        let learning = LearningConfig {
            keep: 2,
            spacing: Duration::from_millis(200),
            share_bytes: None,
            ..LearningConfig::default()
        };
        Self { setting, honest: 5, liars: 0, rounds: MindConfig::default(), learning, errors: 0.0 }
    }

    /// Those in an open swarm.
    pub fn open() -> Self {
        Self::new(Setting::Open)
    }

    /// Those in a sealed swarm.
    pub fn sealed() -> Self {
        Self::new(Setting::Sealed)
    }

    /// With so many liars among the members.
    pub fn liars(self, liars: u32) -> Self {
        Self { liars, ..self }
    }

    /// Robots that withstand so many liars: `rounds.liars`.
    pub fn withstanding(mut self, liars: u32) -> Self {
        self.rounds.liars = liars;
        self
    }
}
