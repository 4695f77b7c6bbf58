//! The thread that trains, so that training never stops the voting: changes in, a whole new classifier out.

use std::collections::{BTreeMap, BTreeSet};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::ClassId;
use gestalt_strategies::{Classifier, LearnError, Learner, TrainingChange};

use crate::failure::Part;
use crate::panics::said;
use crate::supervisor::Supervisor;
use crate::worker::{Tray, Worker};

/// How long after a panic it is tried again: at first, and at most.
const RETRY: Duration = Duration::from_millis(200);
const MAX_RETRY: Duration = Duration::from_secs(30);

/// Trains on what it is given; what comes while it trains waits for the next training, all at once. Dropping it waits
/// until the training under way is over; what still waits is not trained.
pub(super) struct Trainer(Worker<Samples>);

/// What a sample shows, where it lies, of which showing it is, and of which group of authors.
type Sample = (ClassId, Arc<[f32]>, u64, Option<usize>);

/// All samples there are to train on, so that training can begin anew; and those that changed since the last time.
#[derive(Default)]
struct Samples {
    all: BTreeMap<u64, Sample>,
    changed: BTreeSet<u64>,
    /// Those there were before are not to be trained on any more.
    anew: bool,
}

impl Samples {
    fn apply(&mut self, change: TrainingChange) {
        let key = match change {
            TrainingChange::Insert { key, class, vector, showing, group } => {
                self.all.insert(key, (class, vector, showing, group));
                key
            }
            TrainingChange::Remove(key) => {
                self.all.remove(&key);
                key
            }
            TrainingChange::Relabel { key, class } => {
                if let Some(sample) = self.all.get_mut(&key) {
                    sample.0 = class;
                }
                key
            }
        };
        self.changed.insert(key);
    }

    /// What changed, each sample as it is now; `None` for one that is gone.
    fn take(&mut self) -> (bool, Vec<(u64, Option<Sample>)>) {
        let changed = std::mem::take(&mut self.changed);
        let changed = changed.into_iter().map(|key| (key, self.all.get(&key).cloned()));
        (std::mem::take(&mut self.anew), changed.collect())
    }

    fn begin_anew(&mut self) {
        self.anew = true;
        self.changed = self.all.keys().copied().collect();
    }
}

impl Trainer {
    /// Starts to train, with a learner that `begin` makes, each time that it begins anew. `learned` is told of each new
    /// classifier, `failed` of samples that cannot be trained on.
    pub fn start(
        begin: impl Fn() -> Result<Learner, LearnError> + Send + 'static,
        supervisor: Arc<Supervisor>,
        learned: impl Fn(Arc<Classifier>) + Send + 'static,
        failed: impl Fn(&LearnError) + Send + 'static,
    ) -> std::io::Result<Self> {
        let of_death = supervisor.clone();
        let died = move |panic: &(dyn std::any::Any + Send)| of_death.end(Part::Training, said(panic));
        let work = move |tray: &Tray<Samples>| train_all(tray, &begin, &supervisor, &learned, &failed);
        Worker::start("training", Samples::default(), work, died).map(Self)
    }

    /// Hands over changes of the samples.
    pub fn train(&self, changes: Vec<TrainingChange>) {
        self.0.hand_over(|samples| changes.into_iter().for_each(|change| samples.apply(change)));
    }

    /// Forgets all samples.
    pub fn forget(&self) {
        self.0.hand_over(|samples| {
            samples.all.clear();
            samples.begin_anew();
        });
    }
}

fn train_all(
    tray: &Tray<Samples>,
    begin: &impl Fn() -> Result<Learner, LearnError>,
    supervisor: &Supervisor,
    learned: &impl Fn(Arc<Classifier>),
    failed: &impl Fn(&LearnError),
) {
    let mut learner = None;
    let mut pause = RETRY;
    loop {
        let is_work = |samples: &Samples| !samples.changed.is_empty() || supervisor.is_doomed(Part::Training);
        let ((anew, changed), ended) = tray.take(is_work, Supervisor::GLANCE, Samples::take);
        if ended {
            return;
        }
        if anew {
            learner = None;
        }
        if changed.is_empty() && !supervisor.is_doomed(Part::Training) {
            continue;
        }
        let trained = catch_unwind(AssertUnwindSafe(|| {
            supervisor.stumble(Part::Training);
            let learner = match &mut learner {
                Some(learner) => learner,
                None => learner.insert(begin()?),
            };
            follow_all(learner, &changed).iter().for_each(failed);
            learner.learn()
        }));
        match trained {
            Ok(Ok(classifier)) => {
                pause = RETRY;
                learned(classifier);
            }
            Ok(Err(error)) => failed(&error),
            Err(panic) => {
                supervisor.failed(Part::Training, &said(&*panic));
                if tray.put_back(Samples::begin_anew, pause) {
                    return;
                }
                pause = (pause * 2).min(MAX_RETRY);
            }
        }
    }
}

/// Makes a learner take all that changed; gives what keeps it from taking some of it. Where there are as many gestures as can be told apart, a new one takes the place
/// of one that has no samples any more: so what goes does so first, and what finds no place leaves its own, maybe to another, and is tried once more.
fn follow_all(learner: &mut Learner, changed: &[(u64, Option<Sample>)]) -> Vec<LearnError> {
    for (key, _) in changed.iter().filter(|(_, sample)| sample.is_none()) {
        learner.remove(*key);
    }
    let held = changed.iter().filter_map(|(key, sample)| Some((*key, sample.as_ref()?)));
    let failed: Vec<_> = held.filter(|(key, sample)| follow(learner, *key, sample).is_err()).collect();
    for (key, _) in &failed {
        learner.remove(*key);
    }
    failed.into_iter().filter_map(|(key, sample)| follow(learner, key, sample).err()).collect()
}

/// Makes a learner take one sample as it is now.
fn follow(learner: &mut Learner, key: u64, sample: &Sample) -> Result<(), LearnError> {
    let (class, vector, showing, group) = sample;
    // A sample that only changed its class keeps its place, which spares its row of the kernel.
    learner.relabel(key, *class)?;
    learner.insert_of(*group, key, *class, vector.clone(), *showing)
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::MAX_CLASSES;
    use gestalt_strategies::{Classify, Components, FeatureSpace, LearnerOptions, ScalingMethod, Vocabulary};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Two samples of each of as many gestures as can be told apart, the first two of which are of the list.
    fn all_there_can_be() -> (Learner, Vec<(u64, Option<Sample>)>) {
        let rows = [[0.0_f32, 0.0], [1.0, 1.0], [0.5, 0.9]];
        let rows = rows.iter().map(<[f32; 2]>::as_slice);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let space =
            FeatureSpace::fit("test", rows, ScalingMethod::PerComponent, Components::Count(2), &mut rng);
        let vocabulary = Vocabulary::new(["left", "right"]).unwrap();
        let learner = Learner::new(Arc::new(space), vocabulary, LearnerOptions::default()).unwrap();
        let classes = (0..MAX_CLASSES).map(|n| if n < 2 { ClassId(n as u32) } else { named(n) });
        let samples = (10..).zip(classes.flat_map(|class| [class; 2]));
        (learner, samples.map(|(key, class)| (key, shows(class, key))).collect())
    }

    fn named(n: usize) -> ClassId {
        ClassId::named(&"ana".parse().unwrap(), &n.to_string())
    }

    fn shows(class: ClassId, key: u64) -> Option<Sample> {
        Some((class, [key as f32 / 100.0, 0.5].into(), key, None))
    }

    fn of(learner: &mut Learner, class: ClassId) -> u32 {
        let classifier = learner.learn().unwrap();
        classifier.vocabulary().place(class).map_or(0, |place| classifier.learned()[place])
    }

    #[test]
    fn a_new_gesture_takes_the_place_of_one_that_goes_in_whatever_order_their_samples_come() {
        let (mut learner, samples) = all_there_can_be();
        assert!(follow_all(&mut learner, &samples).is_empty());
        let full = LearnError::Class(named(100));
        assert_eq!(follow_all(&mut learner, &[(1, shows(named(100), 1))]), vec![full]);
        // One is retired, and another restored whose samples have the smaller keys.
        let last = samples.len() - 1;
        let gone = [(samples[last - 1].0, None), (samples[last].0, None)];
        let restored = [(1, shows(named(100), 1)), (2, shows(named(100), 2))];
        let failed = follow_all(&mut learner, &[restored.as_slice(), &gone].concat());
        assert_eq!((failed, of(&mut learner, named(100))), (vec![], 2));
        // All samples of one turn out to be of another.
        let corrected = [(1, shows(named(101), 1)), (2, shows(named(101), 2))];
        let failed = follow_all(&mut learner, &corrected);
        let found = [100, 101].map(|n| of(&mut learner, named(n)));
        assert_eq!((failed, found), (vec![], [0, 2]));
        // What finds no place is trained on no more.
        let failed = follow_all(&mut learner, &[(1, shows(named(102), 1))]);
        assert_eq!((failed.len(), of(&mut learner, named(101)), learner.len()), (1, 1, 2 * MAX_CLASSES - 1));
    }
}
