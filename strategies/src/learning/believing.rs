//! Which samples of others are trained on, and what follows when that changes.

use gestalt_protocol::{Doubted, RobotId};

use super::changes::{TrainingChange, inserted};
use super::state::Learning;

impl Learning {
    /// Judges anew which samples of others are trained on.
    pub(super) fn scrutinise(&mut self) {
        for (key, heeded) in self.scrutiny.reckon(&self.set) {
            self.training.extend(if heeded {
                self.set.get(key).map(inserted)
            } else {
                Some(TrainingChange::Remove(key))
            });
        }
    }

    /// A sample that shows another gesture than it was held for is judged as if it had just come.
    pub(super) fn train_anew(&mut self, key: u64) {
        let Some(before) = self.set.get(key).map(|sample| self.scrutiny.is_trained_on(sample)) else {
            return;
        };
        let heeded = self.scrutiny.judge(&self.set, key);
        self.training.extend(self.set.get(key).and_then(|sample| match (before, heeded) {
            (true, true) => Some(TrainingChange::Relabel { key, class: sample.class }),
            (true, false) => Some(TrainingChange::Remove(key)),
            (false, true) => Some(inserted(sample)),
            (false, false) => None,
        }));
    }

    /// Of each other robot: how many of its samples are held, and how many of these are trained on.
    pub fn heeded(&self) -> Vec<(RobotId, usize, usize)> {
        self.scrutiny.heeded(&self.set)
    }

    /// Whose samples are not all trained on.
    pub(super) fn doubted(&self) -> Vec<Doubted> {
        let doubted = self.heeded().into_iter().filter(|(_, held, trained)| trained < held);
        doubted.map(|(robot, held, trained)| Doubted { robot, held, trained }).collect()
    }
}
