//! The thread that trains, so that training never stops the voting: changes in, a whole new classifier out.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Duration;

use gestalt_strategies::{Classifier, LearnError, Learner, TrainingChange, Untrained};

use crate::failure::Part;
use crate::panics::said;
use crate::supervisor::Supervisor;
use crate::worker::{Tray, Worker};

/// How long after a panic it is tried again: at first, and at most.
const RETRY: Duration = Duration::from_millis(200);
const MAX_RETRY: Duration = Duration::from_secs(30);

/// Trains on what it is given; what comes while it trains waits for the next training, all at once. Dropping it waits
/// until the training under way is over; what still waits is not trained.
pub(super) struct Trainer(Worker<Untrained>);

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
        let work = move |tray: &Tray<Untrained>| train_all(tray, &begin, &supervisor, &learned, &failed);
        Worker::start("training", Untrained::default(), work, died).map(Self)
    }

    /// Hands over changes of the samples.
    pub fn train(&self, changes: Vec<TrainingChange>) {
        self.0.hand_over(|untrained| changes.into_iter().for_each(|change| untrained.add(change)));
    }

    /// Forgets all samples.
    pub fn forget(&self) {
        self.0.hand_over(Untrained::forget);
    }
}

fn train_all(
    tray: &Tray<Untrained>,
    begin: &impl Fn() -> Result<Learner, LearnError>,
    supervisor: &Supervisor,
    learned: &impl Fn(Arc<Classifier>),
    failed: &impl Fn(&LearnError),
) {
    let mut learner = None;
    let mut pause = RETRY;
    loop {
        let is_work = |untrained: &Untrained| !untrained.is_empty() || supervisor.is_doomed(Part::Training);
        let (to_train, ended) = tray.take(is_work, Supervisor::GLANCE, Untrained::take);
        if ended {
            return;
        }
        if to_train.is_anew() {
            learner = None;
        }
        if to_train.is_empty() && !supervisor.is_doomed(Part::Training) {
            continue;
        }
        let trained = catch_unwind(AssertUnwindSafe(|| {
            supervisor.stumble(Part::Training);
            let learner = match &mut learner {
                Some(learner) => learner,
                None => learner.insert(begin()?),
            };
            to_train.teach(learner, |error| failed(&error));
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
                if tray.put_back(Untrained::begin_anew, pause) {
                    return;
                }
                pause = (pause * 2).min(MAX_RETRY);
            }
        }
    }
}
