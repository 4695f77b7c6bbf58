//! The view, between the one that keeps it true and those who ask for it.

use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use tokio::time::Instant;

use crate::view::{Input, View};

/// A view and its clock.
#[derive(Debug)]
pub(crate) struct Known {
    view: Mutex<View>,
    began: Instant,
}

impl Known {
    pub fn new() -> Self {
        Self { view: Mutex::default(), began: Instant::now() }
    }

    /// The time since the view began.
    pub fn now(&self) -> Duration {
        self.began.elapsed()
    }

    /// Takes in what was heard. Says whether there is something new to show.
    pub fn hear(&self, input: Input) -> bool {
        let holds = matches!(input, Input::Held(..));
        self.with_mut(|view, now| view.hear(now, input)).is_some() || holds
    }

    /// Looks at the view; nothing else may look meanwhile, so it is to be brief.
    pub fn with<T>(&self, look: impl FnOnce(&View, Duration) -> T) -> T {
        self.with_mut(|view, now| look(view, now))
    }

    fn with_mut<T>(&self, change: impl FnOnce(&mut View, Duration) -> T) -> T {
        change(&mut self.view.lock().unwrap_or_else(PoisonError::into_inner), self.now())
    }
}
