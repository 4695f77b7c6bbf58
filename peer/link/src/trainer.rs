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
            for (key, sample) in &changed {
                if let Err(error) = follow(learner, *key, sample.as_ref()) {
                    failed(&error);
                }
            }
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

/// Makes a learner take one sample as it is now.
fn follow(learner: &mut Learner, key: u64, sample: Option<&Sample>) -> Result<(), LearnError> {
    match sample {
        // A sample that only changed its class keeps its place, which spares its row of the kernel.
        Some((class, vector, showing, group)) => {
            learner.relabel(key, *class)?;
            learner.insert_of(*group, key, *class, vector.clone(), *showing)
        }
        None => {
            learner.remove(key);
            Ok(())
        }
    }
}
