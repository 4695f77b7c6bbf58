//! The thread that writes a robot's memory, so that a slow disk never delays a vote.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::RobotId;
use gestalt_strategies::{Classifier, RecordChange, RobotMemory};

use super::error::StoreError;
use super::place::Place;
use super::store::{Records, Run, Store};
use crate::failure::Part;
use crate::panics::said;
use crate::supervisor::Supervisor;
use crate::worker::{Tray, Worker};

/// How long after a failure the disk is tried again: at first, and at most.
const RETRY: Duration = Duration::from_secs(1);
const MAX_RETRY: Duration = Duration::from_secs(5);

/// How often a robot with nothing to write makes sure that its file is still there.
const LOOK_AFTER: Duration = Duration::from_secs(1);

/// What the scribe has to tell.
pub(crate) enum Told {
    /// All up to that revision is on the disk.
    Wrote(u64),
    /// Something failed; what could not be written is tried again.
    Failed(StoreError),
    /// The disk came late, and holds what this robot knew before. Nothing is written until [`Scribe::take_up`].
    Found(Found),
}

/// What a disk that came late holds.
pub(crate) struct Found {
    pub memory: RobotMemory,
    pub classifier: Option<Arc<Classifier>>,
    /// The number of this life, now that all starts are counted.
    pub boot: u32,
}

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
    /// What is handed over now is of a mind that will give way to one that knows what was found.
    found: bool,
}

impl Pending {
    fn is_work(&self) -> bool {
        !self.found && (!self.records.is_empty() || self.classifier.is_some())
    }
}

/// Where a scribe writes, and for whom.
pub(crate) struct Assignment {
    pub place: Arc<dyn Place>,
    pub robot: RobotId,
    /// The number of this life.
    pub boot: u32,
    /// What stands in the store, or could be read where it could not be written.
    pub known: Records,
    /// The classifier that stands, or stood, there.
    pub classifier: Option<Arc<Classifier>>,
    /// `None` where the disk is not there yet.
    pub store: Option<Store>,
}

impl Scribe {
    /// Starts to write.
    pub fn start(
        assignment: Assignment,
        supervisor: Arc<Supervisor>,
        tell: impl Fn(Told) + Send + 'static,
    ) -> std::io::Result<Self> {
        let of_death = supervisor.clone();
        let work = move |tray: &Tray<Pending>| Writing::new(assignment, supervisor).run(tray, &tell);
        let died = move |panic: &(dyn std::any::Any + Send)| of_death.end(Part::Memory, said(panic));
        Worker::start("memory", Pending::default(), work, died).map(Self)
    }

    /// Hands over changes, which [`Told::Wrote`] will name by their revision.
    pub fn remember(&self, revision: u64, changes: Vec<RecordChange>) {
        self.0.hand_over(|pending| {
            if !pending.found {
                pending.records.extend(changes.into_iter().map(|change| (change.key, change.value)));
                pending.revision = revision;
            }
        });
    }

    /// Hands over a new classifier.
    pub fn remember_classifier(&self, classifier: Arc<Classifier>) {
        self.0.hand_over(|pending| {
            if !pending.found {
                pending.classifier = Some(classifier);
            }
        });
    }

    /// What is handed over from now on is of a mind that knows what was found.
    pub fn take_up(&self) {
        self.0.hand_over(|pending| pending.found = false);
    }
}

/// What came of trying to write.
#[expect(clippy::large_enum_variant, reason = "it is looked at as it comes, and not kept")]
enum Done {
    /// There was nothing to write, and the file is still there.
    Nothing,
    Wrote,
    Found(Found),
}

/// The thread's own side.
struct Writing {
    place: Arc<dyn Place>,
    robot: RobotId,
    boot: u32,
    store: Option<Store>,
    /// Set once a file of this run was open.
    run: Option<Run>,
    /// All that the file should hold, for one that is removed while the robot runs. Bounded as the robot's own knowledge.
    known: Records,
    classifier: Option<Arc<Classifier>>,
    supervisor: Arc<Supervisor>,
}

impl Writing {
    fn new(assignment: Assignment, supervisor: Arc<Supervisor>) -> Self {
        let Assignment { place, robot, boot, known, classifier, store } = assignment;
        let run = store.as_ref().map(Store::run);
        Self { place, robot, boot, store, run, known, classifier, supervisor }
    }

    fn run(mut self, tray: &Tray<Pending>, tell: &impl Fn(Told)) {
        // A classifier alone is written under the revision before.
        let mut latest = 0;
        let mut pause = RETRY;
        loop {
            let take = |pending: &mut Pending| {
                let (records, classifier) = (std::mem::take(&mut pending.records), pending.classifier.take());
                (records, pending.revision, classifier, pending.found)
            };
            let ready = |pending: &Pending| pending.is_work() || self.supervisor.is_doomed(Part::Memory);
            let ((records, revision, classifier, found), ended) = tray.take(ready, LOOK_AFTER, take);
            if ended && records.is_empty() && classifier.is_none() {
                return;
            }
            // It is not known yet whether that can be taken up, or it cannot: then the file is not this robot's to write, nor to make anew.
            if found {
                continue;
            }
            latest = revision.max(latest);
            let changes: Vec<RecordChange> =
                records.into_iter().map(|(key, value)| RecordChange { key, value }).collect();
            let written = catch_unwind(AssertUnwindSafe(|| {
                self.supervisor.stumble(Part::Memory);
                match &self.store {
                    Some(store) if changes.is_empty() && classifier.is_none() => {
                        store.check().map(|()| Done::Nothing)
                    }
                    _ => self.write(&changes, classifier.as_ref()),
                }
            }));
            let error = match written {
                Ok(Ok(Done::Nothing)) => continue,
                Ok(Ok(Done::Wrote)) => {
                    pause = RETRY;
                    tell(Told::Wrote(latest));
                    continue;
                }
                Ok(Ok(Done::Found(found))) => {
                    // Revisions are counted anew, as the mind is.
                    latest = 0;
                    tray.put_back(
                        |pending| *pending = Pending { found: true, ..Pending::default() },
                        Duration::ZERO,
                    );
                    tell(Told::Found(found));
                    continue;
                }
                Ok(Err(error)) => Some(error),
                Err(panic) => {
                    self.supervisor.failed(Part::Memory, &said(&*panic));
                    None
                }
            };
            // The database takes nothing more until it is opened again.
            self.store = None;
            if let Some(error) = error {
                tell(Told::Failed(error));
            }
            // What came and went while the disk failed leaves nothing: the file never held it, or is rid of it when it is opened again.
            let known = &self.known;
            let changes = changes.into_iter().filter(|it| it.value.is_some() || known.contains_key(&it.key));
            // Whatever comes meanwhile can wait as well: the disk is not to be tried at every sample.
            let ended = tray.put_back(
                |pending| {
                    for RecordChange { key, value } in changes {
                        pending.records.entry(key).or_insert(value);
                    }
                    pending.classifier = pending.classifier.take().or(classifier);
                },
                pause,
            );
            pause = (pause * 2).min(MAX_RETRY);
            if ended {
                return;
            }
        }
    }

    /// Writes, to a file that is opened first where there is none open.
    fn write(
        &mut self,
        changes: &[RecordChange],
        classifier: Option<&Arc<Classifier>>,
    ) -> Result<Done, StoreError> {
        if self.store.is_none()
            && let Some(found) = self.open()?
        {
            return Ok(Done::Found(found));
        }
        self.classifier = classifier.or(self.classifier.as_ref()).cloned();
        if let Some(store) = &self.store {
            store.write(changes, classifier.map(|classifier| &**classifier))?;
        }
        for RecordChange { key, value } in changes {
            match value {
                Some(value) => self.known.insert(key.clone(), value.clone()),
                None => self.known.remove(key),
            };
        }
        Ok(Done::Wrote)
    }

    /// Opens the file. `Some` when it came late and knows something.
    fn open(&mut self) -> Result<Option<Found>, StoreError> {
        let Some(run) = self.run else { return self.open_late() };
        let store = Store::reopen(self.place.clone(), self.robot, run)?;
        // What the file should hold and does not: all of it, where it is a new one.
        let (holds, has_none) = (store.records()?, store.classifier()?.is_none());
        let lacks = self.known.iter().filter(|(key, value)| holds.get(*key) != Some(value));
        let lacks = lacks.map(|(key, value)| RecordChange { key: key.clone(), value: Some(value.clone()) });
        let surplus = holds.keys().filter(|key| !self.known.contains_key(*key));
        let surplus = surplus.map(|key| RecordChange { key: key.clone(), value: None });
        let changes: Vec<RecordChange> = lacks.chain(surplus).collect();
        let classifier = self.classifier.as_deref().filter(|_| has_none);
        if classifier.is_some() || !changes.is_empty() {
            store.write(&changes, classifier)?;
        }
        self.store = Some(store);
        Ok(None)
    }

    /// A disk that was not there at the start may hold what this robot knew before.
    fn open_late(&mut self) -> Result<Option<Found>, StoreError> {
        let (mut store, new) = Store::look(self.place.clone(), self.robot)?;
        // Before this start is counted: what is refused is tried again and again, and nothing is written to it.
        let (memory, holds, classifier) = (store.memory()?, store.records()?, store.classifier()?);
        // Under a number that nothing was said under: until now it voted under the clock's.
        store.count(self.boot.saturating_add(1))?;
        let classifier = classifier.map(Arc::new);
        let found = if new || memory.is_empty() {
            // One that was read while it could not be written, and has gone since.
            let lacks = self.known.iter().filter(|(key, _)| !holds.contains_key(*key));
            let lacks =
                lacks.map(|(key, value)| RecordChange { key: key.clone(), value: Some(value.clone()) });
            let lacks: Vec<RecordChange> = lacks.collect();
            let unwritten = self.classifier.as_deref().filter(|_| classifier.is_none());
            if unwritten.is_some() || !lacks.is_empty() {
                store.write(&lacks, unwritten)?;
            }
            self.known.extend(holds);
            self.classifier = classifier.or(self.classifier.take());
            None
        } else {
            self.known = holds;
            self.classifier.clone_from(&classifier);
            Some(Found { memory, classifier, boot: store.boot() })
        };
        self.run = Some(store.run());
        self.store = Some(store);
        Ok(found)
    }
}
