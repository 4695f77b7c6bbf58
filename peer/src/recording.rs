//! A running swarm into a file.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use gestalt_desk::Tap;
use gestalt_link::{Client, LinkConfig, LinkError};
use gestalt_protocol::{Keys, PROTOCOL_VERSION};
use gestalt_strategies::MindConfig;
use gestalt_tape::{Disk, Ledger, ROUNDS, Recorder, Room, SWARM, WriteError};
use thiserror::Error;

/// Why there is no recording, or not all of it.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// A file of that name is there.
    #[error("{0} is there already, and no recording is ever overwritten: choose another name")]
    Exists(PathBuf),
    /// The file cannot be made.
    #[error("cannot write {path}: {cause}: its folder must be there, with room, and yours to write to")]
    Create {
        /// Which file.
        path: PathBuf,
        /// The system's reason.
        cause: std::io::Error,
    },
    /// The swarm cannot be reached.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The disk took no more. What is in the file can be read.
    #[error(
        "{path}: {cause}: {written} messages are in it and can be replayed; {missing}; make room and record again"
    )]
    Disk {
        /// Which file.
        path: PathBuf,
        /// What went wrong.
        cause: WriteError,
        /// How many messages are in it.
        written: u64,
        /// What is not.
        missing: String,
    },
}

/// What is to be recorded.
#[derive(Clone, Debug)]
pub struct RecordingPlan<'a> {
    /// The swarm's name.
    pub swarm: &'a str,
    /// How one of its robots is reached.
    pub link: &'a LinkConfig,
    /// Into which new file.
    pub file: &'a Path,
    /// The rounds of its robots, if they are known: a replay counts by them.
    pub rounds: Option<&'a MindConfig>,
    /// Whether to record what cameras stream.
    pub frames: bool,
}

/// A recording that is being made.
pub struct Recording {
    file: PathBuf,
    recorder: Recorder,
    tap: Tap,
}

impl Recording {
    /// Attaches to the swarm and records from now on.
    ///
    /// # Errors
    /// [`RecordingError`]; no file is left where there is no recording.
    pub async fn start(plan: RecordingPlan<'_>) -> Result<Self, RecordingError> {
        let RecordingPlan { swarm, link, file, rounds, frames } = plan;
        let keys = Keys::new(swarm).map_err(LinkError::from)?;
        let client = Client::open(swarm, link).await?;
        let disk = Disk::create(file).map_err(|cause| match cause.kind() {
            ErrorKind::AlreadyExists => RecordingError::Exists(file.to_owned()),
            _ => RecordingError::Create { path: file.to_owned(), cause },
        })?;
        let begun = Begun(file);
        gestalt_file::keep_name(file)
            .map_err(|cause| RecordingError::Create { path: file.to_owned(), cause })?;
        let mut about = BTreeMap::from([
            (SWARM.to_owned(), swarm.to_owned()),
            ("version".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
            ("protocol".to_owned(), PROTOCOL_VERSION.to_string()),
        ]);
        about
            .extend(rounds.and_then(|rounds| Some((ROUNDS.to_owned(), serde_json::to_string(rounds).ok()?))));
        let recorder =
            Recorder::start(disk, keys, about, Room::default()).map_err(|cause| RecordingError::Disk {
                path: file.to_owned(),
                cause,
                written: 0,
                missing: "nothing was heard yet".to_owned(),
            })?;
        let tap = Tap::open(Arc::new(client), frames, recorder.intake().clone()).await?;
        begun.keep();
        Ok(Self { file: file.to_owned(), recorder, tap })
    }

    /// What was received, written and lost so far.
    #[must_use]
    pub fn ledger(&self) -> Ledger {
        self.recorder.intake().ledger()
    }

    /// Whether the disk takes no more: all that comes is lost.
    #[must_use]
    pub fn has_failed(&self) -> bool {
        self.recorder.intake().has_failed()
    }

    /// Ends the recording, with an index and a footer.
    ///
    /// # Errors
    /// [`RecordingError::Disk`] when not all of what was heard could be written.
    pub async fn finish(self) -> Result<Ledger, RecordingError> {
        let Self { file: path, recorder, tap } = self;
        tap.close().await;
        let written_to = path.clone();
        let finish = move || {
            let (ledger, ended) = recorder.finish();
            (ledger, ended.and_then(|()| settle(&written_to).map_err(WriteError::Disk)))
        };
        let finished = tokio::task::spawn_blocking(finish).await;
        let (ledger, ended) = finished.map_err(|error| RecordingError::Create {
            path: path.clone(),
            cause: std::io::Error::other(error),
        })?;
        let written = Ledger::total(&ledger.written);
        match ended {
            Ok(()) => Ok(ledger),
            Err(cause) => {
                let missing = ledger.missing().unwrap_or_else(|| "it has no index".to_owned());
                Err(RecordingError::Disk { path, cause, written, missing })
            }
        }
    }
}

/// Makes a recording that is whole survive a power cut.
fn settle(path: &Path) -> std::io::Result<()> {
    File::open(path)?.sync_all()?;
    gestalt_file::keep_name(path)
}

/// A new file that goes again where no recording begins in it: it would keep the next one from its name.
struct Begun<'a>(&'a Path);

impl Begun<'_> {
    fn keep(self) {
        std::mem::forget(self);
    }
}

impl Drop for Begun<'_> {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_that_does_not_begin_leaves_its_name_free() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("run.mcap");
        let begin = || Disk::create(&file).map(|_| Begun(&file));
        drop(begin().unwrap());
        begin().unwrap().keep();
        assert!(file.exists() && begin().is_err());
    }
}
