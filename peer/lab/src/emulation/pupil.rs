//! A robot that learns: its memory and its machine.

use std::collections::BTreeMap;
use std::sync::Arc;

use gestalt_protocol::RobotId;
use gestalt_strategies::{
    Classifier, Learner, LearningConfig, LearningSetup, Life, Mind, MindConfig, OwnRules, RecordChange,
    RobotMemory, TrainingChange,
};
use rand_chacha::ChaCha8Rng;

use super::school::School;

/// One robot that learns: its disk outlives it.
#[derive(Debug, Default)]
pub(super) struct Pupil {
    disk: BTreeMap<Vec<u8>, Vec<u8>>,
    /// Whether anybody ever reads what is on it.
    is_read: bool,
    /// The revision on the disk.
    pub remembered: u64,
    learner: Option<Learner>,
    /// What the classifier has not followed yet.
    due: Vec<TrainingChange>,
    classifier: Option<Arc<Classifier>>,
}

impl Pupil {
    /// A robot that was never started, and may be started again or not.
    pub fn new(starts_again: bool) -> Self {
        Self { is_read: starts_again, ..Self::default() }
    }

    /// The mind of this robot, with what its disk holds.
    pub fn start(
        &mut self,
        (me, life): (RobotId, Life),
        mind: MindConfig,
        school: &School,
        (config, rules): (&LearningConfig, &OwnRules),
        rng: ChaCha8Rng,
    ) -> Mind {
        let records = self.disk.iter().map(|(key, value)| (key.as_slice(), value.as_slice()));
        let memory = RobotMemory::read(records).expect("it holds what this robot's minds wrote");
        self.stop();
        self.classifier = school.start().cloned();
        self.learner = Some(school.learner().expect("the school was tried when it was made"));
        let setup = LearningSetup {
            config: config.clone(),
            space: school.space().clone(),
            vocabulary: school.vocabulary().clone(),
            rng: Box::new(rng),
            memory: Some(memory),
            rules: rules.clone(),
        };
        Mind::new(me, life, mind)
            .expect("the scenario was validated")
            .learning(setup)
            .expect("the scenario was validated, and the memory is this robot's own")
    }

    /// Loses what is on no disk.
    pub fn stop(&mut self) {
        (self.remembered, self.learner, self.classifier) = (0, None, None);
        self.due.clear();
    }

    pub fn remember(&mut self, revision: u64, changes: Vec<RecordChange>) {
        let changes = changes.into_iter().filter(|_| self.is_read);
        for RecordChange { key, value } in changes {
            match value {
                Some(value) => self.disk.insert(key, value),
                None => self.disk.remove(&key),
            };
        }
        self.remembered = revision;
    }

    pub fn train_later(&mut self, changes: Vec<TrainingChange>) {
        self.due.extend(changes);
    }

    /// The classifier, brought up to date, and whether that changed it.
    pub fn learn(&mut self) -> Option<Arc<Classifier>> {
        let learner = self.learner.as_mut().filter(|_| !self.due.is_empty())?;
        for change in what_lasts(std::mem::take(&mut self.due)) {
            change.apply_to(learner).expect("a mind trains on vectors of the school's space and classes");
        }
        self.classifier = Some(learner.learn().expect("a learner learns from any samples it took"));
        self.classifier.clone()
    }

    pub fn classifier(&self) -> Option<&Arc<Classifier>> {
        self.classifier.as_ref()
    }
}

/// The changes without those of samples that came and went meanwhile. Of a large swarm's samples most do: each costs its kernel with
/// all others.
fn what_lasts(mut changes: Vec<TrainingChange>) -> Vec<TrainingChange> {
    let gone: BTreeMap<u64, usize> = changes
        .iter()
        .enumerate()
        .filter_map(
            |(at, change)| if let TrainingChange::Remove(key) = change { Some((*key, at)) } else { None },
        )
        .collect();
    let mut at = 0;
    changes.retain(|change| {
        let (TrainingChange::Insert { key, .. }
        | TrainingChange::Relabel { key, .. }
        | TrainingChange::Remove(key)) = change;
        let lasts = gone.get(key).is_none_or(|last| *last <= at);
        at += 1;
        lasts
    });
    changes
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::ClassId;

    use super::*;

    #[test]
    fn what_came_and_went_is_not_trained_and_all_else_is_in_its_order() {
        let insert =
            |key| TrainingChange::Insert { key, class: ClassId(0), vector: [0.0].into(), showing: key };
        let relabel = |key| TrainingChange::Relabel { key, class: ClassId(1) };
        let remove = TrainingChange::Remove;
        let changes =
            vec![insert(1), insert(2), relabel(1), remove(1), insert(3), remove(4), insert(4), relabel(3)];
        // Whether the learner had one of that key before is not known here: it is told that it goes.
        assert_eq!(what_lasts(changes), [insert(2), remove(1), insert(3), remove(4), insert(4), relabel(3)]);
    }
}
