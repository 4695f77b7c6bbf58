//! What was learned, for whoever asks: the mind, before it asks for more, and the status.

use std::collections::BTreeMap;

use gestalt_protocol::{ClassId, Fnv1a, LearningStatus, RoundId};

use super::config::LearningConfig;
use super::state::Learning;
use crate::lessons::Verdict;
use crate::sample::SetPart;

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

    /// Where it stands, for the status. What the host knows of memory and training is left to it.
    pub fn status(&self) -> LearningStatus {
        let counts = |part: SetPart| self.vocabulary.all().map(|class| self.set.count(part, class)).collect();
        let common = self.set.common().filter_map(|sample| Some((sample.id?, sample.class)));
        let mut fnv = Fnv1a::default();
        for (id, class) in common.collect::<BTreeMap<_, _>>() {
            let name = [id.author.0, id.life, id.number].into_iter().flat_map(u32::to_le_bytes);
            fnv.add(name.chain(class.0.to_le_bytes()));
        }
        LearningStatus {
            space: self.space_id.to_string(),
            capacity: self.config.capacity,
            personal: counts(SetPart::Personal),
            shared: counts(SetPart::Shared),
            external: counts(SetPart::External),
            aside: self.aside.len(),
            common: format!("{:016x}", fnv.hash()),
            lessons: self.lessons.len(),
            named: self.named_gestures(),
            memory: String::new(),
            trainings: 0,
            doubted: self.doubted(),
        }
    }
}
