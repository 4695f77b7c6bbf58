//! Where the messages of a recorder go: into a file, or to those who look on.

use std::collections::BTreeMap;

use mcap::McapError;
use thiserror::Error;

use crate::passing::Entry;

/// Takes the messages that a recorder makes of what passes, in the order in which it was heard. It is called by the recorder's
/// thread alone, and may take its time: what comes meanwhile waits in the recorder's queue, or is counted as dropped.
pub trait Sink: Send + 'static {
    /// Takes one message; `false` when there is no room for another channel.
    ///
    /// # Errors
    /// [`WriteError`]: from then on all is lost.
    fn write(&mut self, entry: &Entry) -> Result<bool, WriteError>;

    /// How many bytes wait for the next flush.
    fn pending(&self) -> usize;

    /// Lets go of what waits; called four times a second, or more often.
    ///
    /// # Errors
    /// [`WriteError`]: what waited is lost.
    fn flush(&mut self) -> Result<(), WriteError>;

    /// Ends it with what is to be said of the whole.
    ///
    /// # Errors
    /// [`WriteError`] when that cannot be said.
    fn finish(self, end: BTreeMap<String, String>) -> Result<(), WriteError>;
}

/// A recording that cannot be written on.
#[derive(Debug, Error)]
pub enum WriteError {
    /// The disk is full, gone or forbids it.
    #[error("cannot write the recording: {0}")]
    Disk(#[from] std::io::Error),
    /// What MCAP cannot hold.
    #[error("cannot write the recording: {0}")]
    Mcap(McapError),
}

impl From<McapError> for WriteError {
    fn from(error: McapError) -> Self {
        match error {
            McapError::Io(error) => Self::Disk(error),
            other => Self::Mcap(other),
        }
    }
}
