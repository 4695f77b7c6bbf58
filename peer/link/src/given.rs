//! The classifier that a program gave its robot last.

use std::sync::{Arc, Mutex, PoisonError};

use gestalt_strategies::Classify;
use tokio::sync::Notify;

/// Holds it until the robot's task takes it up: beside the queue of commands, which may be full.
#[derive(Debug, Default)]
pub(crate) struct Given {
    /// With its name for people.
    newest: Mutex<Option<(Arc<dyn Classify>, String)>>,
    there: Notify,
}

impl Given {
    /// Takes the place of one that was not taken up yet.
    pub fn put(&self, classifier: Arc<dyn Classify>, model: &str) {
        *self.newest.lock().unwrap_or_else(PoisonError::into_inner) = Some((classifier, model.to_owned()));
        self.there.notify_one();
    }

    /// Waits until there may be one.
    pub async fn there(&self) {
        self.there.notified().await;
    }

    pub fn take(&self) -> Option<(Arc<dyn Classify>, String)> {
        self.newest.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}
