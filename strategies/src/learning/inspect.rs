//! What the mind wants to know of what was learned, before it asks for more.

use std::collections::BTreeMap;

use gestalt_protocol::{ClassId, RoundId};

use super::config::LearningConfig;
use super::state::Learning;
use crate::lessons::Verdict;

impl Learning {
    /// Its parameters.
    pub fn config(&self) -> &LearningConfig {
        &self.config
    }

    /// How many looks at the gesture of that round this robot kept.
    pub fn looks(&self, round: RoundId) -> usize {
        self.recent.looks(round)
    }

    /// For each gesture, of how many of the rounds that it knows of instructors say that they showed it.
    pub fn label_counts(&self) -> BTreeMap<ClassId, usize> {
        let mut counts = BTreeMap::new();
        for (round, _) in self.lessons.rounds(0) {
            if let Verdict::Class(class) = self.lessons.verdict(round, &self.gestures)
                && let Some(class) = self.trained_as(class)
            {
                *counts.entry(class).or_default() += 1;
            }
        }
        counts
    }
}
