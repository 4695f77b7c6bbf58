//! A robot that learns: its memory and its machine.

use std::collections::BTreeMap;
use std::sync::Arc;

use gestalt_protocol::RobotId;
use gestalt_strategies::{
    Classifier, Learner, LearningConfig, LearningSetup, Life, Mind, MindConfig, OwnRules, RecordChange,
    RobotMemory, Shelf, TrainingChange,
};
use rand_chacha::ChaCha8Rng;

use super::school::School;

/// How often one robot holds a vector that is to be trained on: among its samples, and in what is due.
const ITS_OWN: usize = 2;

/// One robot that learns: its disk outlives it.
#[derive(Debug, Default)]
pub(super) struct Pupil {
    disk: BTreeMap<Vec<u8>, Vec<u8>>,
    /// Whether anybody ever reads what is on it.
    is_read: bool,
    /// Whether its learner goes once it is asked no more, with all that it keeps to follow changes: of a large swarm few are asked, and seldom.
    starts_over: bool,
    /// Whether its mind writes down what it hears: of a large swarm what nobody ever reads is not even written.
    pub writes: bool,
    /// Whether there is anything that the classifier has not followed.
    is_behind: bool,
    /// Whether its mind was not told of the classifier yet.
    is_news: bool,
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
        (config, rules, shelf): (&LearningConfig, &OwnRules, &Arc<Shelf>),
        rng: ChaCha8Rng,
    ) -> Mind {
        let records = self.disk.iter().map(|(key, value)| (key.as_slice(), value.as_slice()));
        let memory = RobotMemory::read(records).expect("it holds what this robot's minds wrote");
        self.stop();
        self.writes = self.is_read || !self.starts_over;
        self.classifier = school.start().cloned();
        self.learner = (!self.starts_over).then(|| new_learner(school));
        let setup = LearningSetup {
            config: config.clone(),
            space: school.space().clone(),
            vocabulary: school.vocabulary().clone(),
            rng: Box::new(rng),
            memory: self.writes.then_some(memory),
            rules: rules.clone(),
        };
        Mind::new(me, life, mind)
            .expect("the scenario was validated")
            .learning(setup)
            .expect("the scenario was validated, and the memory is this robot's own")
            .with_shelf(shelf.clone())
    }

    /// Loses what is on no disk.
    pub fn stop(&mut self) {
        (self.remembered, self.learner, self.classifier) = (0, None, None);
        self.due.clear();
        (self.is_behind, self.is_news) = (false, false);
    }

    /// From now on it learns all anew when it is asked after a [rest](Self::rest): before it has learned anything.
    pub fn start_over(&mut self) {
        (self.starts_over, self.learner) = (true, None);
    }

    /// It is asked no more for now.
    pub fn rest(&mut self) {
        if self.starts_over {
            (self.learner, self.due) = (None, Vec::new());
        }
    }

    /// From now on it keeps what follows changes: it is asked often.
    pub fn keep_up(&mut self, mind: Option<&Mind>, school: &School) {
        if std::mem::take(&mut self.starts_over) && self.learner.is_none() {
            self.gather(mind, school);
            self.is_behind = !self.due.is_empty();
        }
    }

    /// Gets ready to learn anew, from the samples that its mind holds.
    fn gather(&mut self, mind: Option<&Mind>, school: &School) {
        self.due = mind.map_or(Vec::new(), Mind::training);
        let mut learner = new_learner(school);
        learner.make_room(self.due.iter().filter_map(|change| match change {
            TrainingChange::Insert { class, .. } => Some(*class),
            TrainingChange::Remove(_) | TrainingChange::Relabel { .. } => None,
        }));
        self.learner = Some(learner);
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
        self.is_behind |= !changes.is_empty();
        // Who starts over asks the mind what it trains on.
        if self.learner.is_some() {
            self.due.extend(changes);
        }
    }

    /// Whether it has anything to learn; gets ready to.
    pub fn prepare(&mut self, mind: Option<&Mind>, school: &School) -> bool {
        if !self.is_behind {
            return false;
        }
        if self.learner.is_none() {
            self.gather(mind, school);
        }
        // Of a shared sample all robots hold one vector: its kernel with the others is worked out once for all of them.
        for change in &self.due {
            if let TrainingChange::Insert { vector, .. } = change
                && Arc::strong_count(vector) > ITS_OWN
            {
                school.kernel().hold(vector);
            }
        }
        true
    }

    /// Brings the classifier up to date, once it is [prepared](Self::prepare).
    pub fn learn(&mut self) {
        let Some(learner) = self.learner.as_mut().filter(|_| self.is_behind) else { return };
        for change in what_lasts(std::mem::take(&mut self.due)) {
            change.apply_to(learner).expect("a mind trains on vectors of the school's space and classes");
        }
        self.classifier = Some(learner.learn().expect("a learner learns from any samples it took"));
        // Of a large swarm: not all learn at a time, and all wait in one memory.
        if !self.writes {
            learner.slim_down();
        }
        (self.is_behind, self.is_news) = (false, true);
    }

    /// The classifier, if it was learned since it was last asked for.
    pub fn take_news(&mut self) -> Option<Arc<Classifier>> {
        self.classifier.clone().filter(|_| std::mem::take(&mut self.is_news))
    }

    pub fn classifier(&self) -> Option<&Arc<Classifier>> {
        self.classifier.as_ref()
    }
}

fn new_learner(school: &School) -> Learner {
    school.learner().expect("the school was tried when it was made")
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
        let insert = |key| TrainingChange::Insert {
            key,
            class: ClassId(0),
            vector: [0.0].into(),
            showing: key,
            group: None,
        };
        let relabel = |key| TrainingChange::Relabel { key, class: ClassId(1) };
        let remove = TrainingChange::Remove;
        let changes =
            vec![insert(1), insert(2), relabel(1), remove(1), insert(3), remove(4), insert(4), relabel(3)];
        // Whether the learner had one of that key before is not known here: it is told that it goes.
        assert_eq!(what_lasts(changes), [insert(2), remove(1), insert(3), remove(4), insert(4), relabel(3)]);
    }
}
