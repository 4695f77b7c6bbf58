//! The thread that trains, so that training never stops the voting: changes in, a whole new classifier out.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use gestalt_strategies::{Classifier, LearnError, Learner, TrainingChange};

/// Trains on what it is given; what comes while it trains waits for the next training, all at once.
pub(super) struct Trainer {
    desk: Arc<Desk>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct Desk {
    pending: Mutex<Pending>,
    changed: Condvar,
}

#[derive(Default)]
struct Pending {
    changes: Vec<TrainingChange>,
    ended: bool,
}

impl Desk {
    fn lock(&self) -> MutexGuard<'_, Pending> {
        self.pending.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Trainer {
    /// Starts to train. `learned` is told of each new classifier, `failed` of samples that cannot be trained on.
    pub fn start(
        learner: Learner,
        learned: impl Fn(Arc<Classifier>) + Send + 'static,
        failed: impl Fn(&LearnError) + Send + 'static,
    ) -> std::io::Result<Self> {
        let desk = Arc::new(Desk::default());
        let of_thread = desk.clone();
        let thread = std::thread::Builder::new()
            .name("training".to_owned())
            .spawn(move || train_all(&of_thread, learner, &learned, &failed))?;
        Ok(Self { desk, thread: Some(thread) })
    }

    /// Hands over changes of the samples.
    pub fn train(&self, changes: Vec<TrainingChange>) {
        self.desk.lock().changes.extend(changes);
        self.desk.changed.notify_one();
    }
}

impl Drop for Trainer {
    /// Waits until the training under way is over.
    fn drop(&mut self) {
        let mut pending = self.desk.lock();
        pending.ended = true;
        pending.changes.clear();
        drop(pending);
        self.desk.changed.notify_one();
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("the thread that trains ended badly");
        }
    }
}

fn train_all(
    desk: &Desk,
    mut learner: Learner,
    learned: &impl Fn(Arc<Classifier>),
    failed: &impl Fn(&LearnError),
) {
    loop {
        let mut pending = desk.lock();
        while pending.changes.is_empty() && !pending.ended {
            pending = desk.changed.wait(pending).unwrap_or_else(PoisonError::into_inner);
        }
        if pending.ended {
            return;
        }
        let changes = std::mem::take(&mut pending.changes);
        drop(pending);
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
