//! The thread that writes a robot's memory, so that a slow disk never delays a vote.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use gestalt_strategies::{Change, Classifier};

use super::{Store, StoreError};
use crate::worker::{Desk, Worker};

/// How long after a failure the disk is tried again.
const RETRY: Duration = Duration::from_secs(2);

/// Writes what it is given, in order, many changes at once when they come faster than the disk takes them. Dropping it
/// waits until what was handed over is written, or has failed once more.
pub(crate) struct Scribe(Worker<Pending>);

/// What is still to be written: the latest value of each record, so that a disk that fails for hours costs no more
/// memory than the robot's own.
#[derive(Default)]
struct Pending {
    records: BTreeMap<Vec<u8>, Option<Vec<u8>>>,
    revision: u64,
    classifier: Option<Arc<Classifier>>,
}

impl Pending {
    fn is_work(&self) -> bool {
        !self.records.is_empty() || self.classifier.is_some()
    }
}

impl Scribe {
    /// Starts to write to `store`. `wrote` is told of each revision that is safe, `failed` of each failure; what
    /// could not be written is tried again.
    pub fn start(
        store: Store,
        wrote: impl Fn(u64) + Send + 'static,
        failed: impl Fn(&StoreError) + Send + 'static,
    ) -> std::io::Result<Self> {
        Worker::start("memory", move |desk| write_all(desk, store, &wrote, &failed)).map(Self)
    }

    /// Hands over changes, which `wrote` will name by their revision.
    pub fn remember(&self, revision: u64, changes: Vec<Change>) {
        self.0.hand_over(|pending| {
            pending.records.extend(changes.into_iter().map(|change| (change.key, change.value)));
            pending.revision = revision;
        });
    }

    /// Hands over a new classifier.
    pub fn remember_classifier(&self, classifier: Arc<Classifier>) {
        self.0.hand_over(|pending| pending.classifier = Some(classifier));
    }
}

fn write_all(desk: &Desk<Pending>, store: Store, wrote: &impl Fn(u64), failed: &impl Fn(&StoreError)) {
    let (path, boot) = (store.path().to_owned(), store.boot());
    let mut store = Some(store);
    // A classifier alone is written under the revision before.
    let mut latest = 0;
    loop {
        let (pending, ended) = desk.take(Pending::is_work);
        if ended && !pending.is_work() {
            return;
        }
        let Pending { records, revision, classifier } = pending;
        latest = revision.max(latest);
        let changes: Vec<Change> = records.into_iter().map(|(key, value)| Change { key, value }).collect();
        let opened = store.take().map_or_else(|| Store::reopen(&path, boot), Ok);
        let written = opened.and_then(|open| open.write(&changes, classifier.as_deref()).map(|()| open));
        match written {
            Ok(open) => {
                store = Some(open);
                wrote(latest);
            }
            Err(error) => {
                failed(&error);
                // Whatever comes meanwhile can wait as well: the disk is not to be tried at every sample.
                let ended = desk.put_back(
                    |pending| {
                        for Change { key, value } in changes {
                            pending.records.entry(key).or_insert(value);
                        }
                        pending.classifier = pending.classifier.take().or(classifier);
                    },
                    RETRY,
                );
                if ended {
                    return;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;

    use gestalt_protocol::RobotId;

    use super::*;

    fn change(key: u8, value: u8) -> Change {
        Change { key: vec![key], value: Some(vec![value]) }
    }

    #[test]
    fn what_is_handed_over_is_written_and_said_to_be() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m");
        let (wrote, written) = mpsc::channel();
        let store = Store::open(&path, RobotId(1), 1).unwrap();
        let scribe =
            Scribe::start(store, move |revision| wrote.send(revision).unwrap(), |e| panic!("{e}")).unwrap();
        for revision in 1..=20 {
            scribe.remember(revision, vec![change(revision as u8, 1)]);
        }
        drop(scribe);
        assert_eq!(written.iter().last(), Some(20));
        let read = Store::open(&path, RobotId(1), 1).unwrap().memory();
        assert!(read.is_err(), "twenty records of no kind");
    }

    #[test]
    fn a_disk_that_fails_is_reported_and_tried_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m");
        let store = Store::open(&path, RobotId(1), 1).unwrap();
        // A table of another type under the same name is refused at every write.
        let (failed, failures) = mpsc::channel();
        store.spoil();
        let scribe = Scribe::start(
            store,
            |_| panic!("nothing was written"),
            move |e| {
                let _ = failed.send(e.to_string());
            },
        )
        .unwrap();
        scribe.remember(1, vec![change(1, 1)]);
        let patience = Duration::from_secs(20);
        assert!(failures.recv_timeout(patience).unwrap().contains("make room"));
        assert!(failures.recv_timeout(patience).is_ok(), "tried again");
    }
}
