//! The hub as a recorder's sink.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use gestalt_tape::{Entry, Sink, WriteError};

use super::hub::Hub;

/// Hands on what a recorder makes of what passes.
#[derive(Debug)]
pub(super) struct Live {
    hub: Arc<Hub>,
    began: Instant,
}

impl Live {
    pub fn new(hub: Arc<Hub>) -> Self {
        Self { hub, began: Instant::now() }
    }
}

impl Sink for Live {
    fn write(&mut self, entry: &Entry) -> Result<bool, WriteError> {
        Ok(self.hub.write(entry, self.began.elapsed()))
    }

    fn pending(&self) -> usize {
        0
    }

    fn flush(&mut self) -> Result<(), WriteError> {
        self.hub.age(self.began.elapsed());
        Ok(())
    }

    fn finish(self, _end: BTreeMap<String, String>) -> Result<(), WriteError> {
        Ok(())
    }
}
