//! What the mind wants to know of what was learned, before it asks for more.

use gestalt_protocol::RoundId;

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

    /// By class, of how many of the rounds that it knows of instructors say that they showed it.
    pub fn label_counts(&self) -> Vec<usize> {
        let classes = self.vocabulary.classes();
        let mut counts = vec![0; classes];
        for (round, _) in self.lessons.rounds(0) {
            if let Verdict::Class(class) = self.lessons.verdict(round, classes)
                && let Some(count) = counts.get_mut(class.index())
            {
                *count += 1;
            }
        }
        counts
    }
}
