//! The thread that trains, so that training never stops the voting: changes in, a whole new classifier out.

use std::sync::Arc;

use gestalt_strategies::{Classifier, LearnError, Learner, TrainingChange};

use crate::worker::{Desk, Worker};

/// Trains on what it is given; what comes while it trains waits for the next training, all at once. Dropping it waits
/// until the training under way is over; what still waits is not trained.
pub(super) struct Trainer(Worker<Vec<TrainingChange>>);

impl Trainer {
    /// Starts to train. `learned` is told of each new classifier, `failed` of samples that cannot be trained on.
    pub fn start(
        learner: Learner,
        learned: impl Fn(Arc<Classifier>) + Send + 'static,
        failed: impl Fn(&LearnError) + Send + 'static,
    ) -> std::io::Result<Self> {
        Worker::start("training", move |desk| train_all(desk, learner, &learned, &failed)).map(Self)
    }

    /// Hands over changes of the samples.
    pub fn train(&self, changes: Vec<TrainingChange>) {
        self.0.hand_over(|pending| pending.extend(changes));
    }
}

fn train_all(
    desk: &Desk<Vec<TrainingChange>>,
    mut learner: Learner,
    learned: &impl Fn(Arc<Classifier>),
    failed: &impl Fn(&LearnError),
) {
    loop {
        let (changes, ended) = desk.take(|pending| !pending.is_empty());
        if ended {
            return;
        }
        for change in changes {
            if let Err(error) = change.apply_to(&mut learner) {
                failed(&error);
            }
        }
        match learner.learn() {
            Ok(classifier) => learned(classifier),
            Err(error) => failed(&error),
        }
    }
}
