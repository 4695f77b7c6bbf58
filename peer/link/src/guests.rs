//! The guests of one robot, as its task knows them.

use std::collections::BTreeSet;
use std::sync::{Mutex, MutexGuard, PoisonError};

use gestalt_protocol::RobotId;
use tokio::sync::Notify;

/// The guests of one robot: its task is told of every change.
#[derive(Debug, Default)]
pub(crate) struct Guests {
    state: Mutex<State>,
    changed: Notify,
}

#[derive(Debug, Default)]
struct State {
    present: BTreeSet<RobotId>,
    /// Those in front of which a hand holds still now.
    shown: BTreeSet<RobotId>,
}

impl Guests {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until a guest has come or gone since the last time.
    pub async fn changed(&self) {
        self.changed.notified().await;
    }

    pub fn present(&self) -> BTreeSet<RobotId> {
        self.lock().present.clone()
    }

    /// Adds a guest; `false` when there is one of that id.
    pub fn come(&self, guest: RobotId) -> bool {
        let new = self.lock().present.insert(guest);
        self.changed.notify_one();
        new
    }

    pub fn go(&self, guest: RobotId) {
        self.lock().present.remove(&guest);
        self.changed.notify_one();
    }

    /// A hand holds still in front of that guest.
    pub fn shown(&self, guest: RobotId) {
        self.lock().shown.insert(guest);
    }

    /// No hand holds still in front of that guest any more. Says whether it was the last one to see it: as long as one of
    /// them does, there is something to be seen.
    pub fn left(&self, guest: RobotId) -> bool {
        let mut state = self.lock();
        state.shown.remove(&guest) && state.shown.is_empty()
    }
}
