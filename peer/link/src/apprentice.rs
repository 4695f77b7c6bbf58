//! What a learning robot needs beside its mind: the thread that trains and the thread that remembers.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::SystemTime;

use gestalt_protocol::{Digest, LearningStatus, RobotId};
use gestalt_strategies::{
    Classifier, FeatureSpace, Input, LearnError, Learner, LearningConfig, LearningError, LearningSetup, Mind,
    MindConfig, OwnRules, RecordChange, RobotMemory, TrainingChange, Vocabulary,
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use tokio::sync::mpsc;

use crate::account::Account;
use crate::boot::{boot_number, leap};
use crate::error::LinkError;
use crate::identity;
use crate::inbox::Inbox;
use crate::memory::{Assignment, FilePlace, Found, Place, Records, Scribe, Store, StoreError, Told};
use crate::supervisor::Supervisor;
use crate::trainer::Trainer;

/// How a robot learns, and where it keeps what it learned.
#[derive(Clone, Debug)]
pub struct RobotLearning {
    /// What it keeps, shares and forgets.
    pub config: LearningConfig,
    /// The space its samples lie in: the same at all robots of a swarm.
    pub space: Arc<FeatureSpace>,
    /// The gestures there are to be learned.
    pub vocabulary: Vocabulary,
    /// The offline classifier it builds on; `None` to learn from nothing.
    pub base: Option<Arc<Classifier>>,
    /// The file it keeps its memory in; `None` for a robot that forgets all when it stops.
    ///
    /// A file that is damaged, or another's, is refused at the start. Where the disk is not there, full or read-only, the
    /// robot starts, with what it can read of the file, says so in its status, and goes on trying; until it succeeds, nothing
    /// that it sees or hears counts as learned for good: nothing of it is shared, and no instructor answered. Then it begins
    /// anew with what is on the disk.
    pub memory: Option<PathBuf>,
    /// What its random choices follow from, together with its id and the number of its start.
    pub seed: u64,
    /// Your own rules of selection and forgetting, in place of those that `config` names; none by default.
    pub rules: OwnRules,
}

impl RobotLearning {
    /// What a mind needs of it in that life.
    pub(crate) fn setup(&self, id: RobotId, boot: u32, memory: Option<RobotMemory>) -> LearningSetup {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(u64::from(id.0) << 32 | u64::from(boot));
        LearningSetup {
            config: self.config.clone(),
            space: self.space.clone(),
            vocabulary: self.vocabulary.clone(),
            rng: Box::new(rng),
            memory,
            rules: self.rules.clone(),
        }
    }

    /// The classifier to start with: the one trained last, or the one to build on.
    pub(crate) fn first_classifier(&self, remembered: Option<Arc<Classifier>>) -> Option<Arc<Classifier>> {
        let same = |known: &Arc<Classifier>| known.space().id() == self.space.id();
        remembered.filter(same).or_else(|| self.base.clone())
    }

    fn learner(&self) -> Result<Learner, LearnError> {
        let mut learner =
            Learner::new(self.space.clone(), self.vocabulary.clone(), self.config.learner.clone())?;
        if let Some(base) = &self.base {
            learner.build_on(base)?;
        }
        Ok(learner)
    }
}

/// An opened memory, before there is a mind.
pub(crate) struct Prepared {
    pub learning: RobotLearning,
    pub boot: u32,
    place: Option<Arc<dyn Place>>,
    store: Option<Store>,
    /// The number of the start that was counted last.
    counted: u32,
    records: Records,
    memory: Option<RobotMemory>,
    remembered: Option<Arc<Classifier>>,
    /// Why there is no store, where there should be one.
    failure: Option<StoreError>,
    new: bool,
}

impl Prepared {
    /// Opens the memory. A disk that fails is no error yet: the robot goes on with what it can read of it, and says so.
    pub fn open(id: RobotId, boot: u32, learning: RobotLearning) -> Result<Self, LinkError> {
        let mut prepared = Self::with_nothing(boot, learning);
        if let Some(place) = prepared.place.clone() {
            prepared.open_at(place, id)?;
        }
        Ok(prepared)
    }

    /// What a robot has that remembers nothing yet.
    pub fn with_nothing(boot: u32, learning: RobotLearning) -> Self {
        let place = learning.memory.clone().map(|path| Arc::new(FilePlace::new(path)) as Arc<dyn Place>);
        Self {
            boot,
            store: None,
            counted: 0,
            records: Records::new(),
            memory: place.as_ref().map(|_| RobotMemory::default()),
            place,
            learning,
            remembered: None,
            failure: None,
            new: false,
        }
    }

    /// The same, of the memory that lies there.
    pub fn open_at(&mut self, place: Arc<dyn Place>, id: RobotId) -> Result<(), StoreError> {
        let failure = match self.open_store(&place, id) {
            Err(error) if error.is_of_the_disk() => error,
            opened => return opened,
        };
        // The starts are counted on the disk: until it takes them, the clock has to do, and chance where it is behind.
        self.boot = self.boot.max(boot_number(SystemTime::now()));
        if self.boot <= self.counted {
            self.boot = self.counted.saturating_add(leap());
        }
        self.failure = Some(failure);
        Ok(())
    }

    /// Opens the memory, takes up what it holds, and counts this start in it. What can be read alone is taken up, too.
    fn open_store(&mut self, place: &Arc<dyn Place>, id: RobotId) -> Result<(), StoreError> {
        let (mut store, new) = match Store::look(place.clone(), id) {
            Err(error) if error.is_of_the_disk() => {
                let copy = Store::copy(place.clone(), id);
                return match copy.and_then(|copy| copy.map_or(Ok(()), |copy| self.know(&copy))) {
                    Err(other) if !other.is_of_the_disk() => Err(other),
                    _ => Err(error),
                };
            }
            opened => opened?,
        };
        self.know(&store)?;
        store.count(self.boot)?;
        self.boot = store.boot();
        self.store = Some(store);
        self.new = new;
        Ok(())
    }

    /// Takes up what stands there.
    fn know(&mut self, store: &Store) -> Result<(), StoreError> {
        let (memory, records, classifier) = (store.memory()?, store.records()?, store.classifier()?);
        self.memory = Some(memory);
        self.records = records;
        self.remembered = classifier.map(Arc::new);
        self.counted = store.boot();
        Ok(())
    }

    /// That mind, set up to learn, with what was on the disk: which tells that it has lived before also where nothing was taught.
    ///
    /// # Errors
    /// See [`Mind::learning`].
    pub fn bring_up(&mut self, mind: Mind) -> Result<Mind, LearningError> {
        // Also where the disk takes nothing, or is not there, it most likely was before.
        let has_lived = self.place.is_some() && !self.new;
        let setup = self.learning.setup(mind.me(), self.boot, self.memory.take());
        let mind = mind.learning(setup)?;
        Ok(if has_lived { mind.started_again() } else { mind })
    }

    /// The classifier to start with.
    pub fn classifier(&self) -> Option<Arc<Classifier>> {
        self.learning.first_classifier(self.remembered.clone())
    }
}

impl RobotLearning {
    /// Whether that robot could learn like this: brings it up with a copy of its memory, which is in this process alone. The file is left as it is,
    /// and one that is not there is not made.
    ///
    /// # Errors
    /// See [`LinkError`]: a memory that cannot be read, is another robot's, or does not fit the model.
    pub fn check(&self, robot: RobotId, mind: &MindConfig) -> Result<(), LinkError> {
        let mut prepared = Prepared::with_nothing(1, self.clone());
        if let Some(place) = prepared.place.clone()
            && let Some(copy) = Store::copy(place, robot)?
        {
            prepared.know(&copy)?;
        }
        prepared.bring_up(Mind::new(robot, identity::life(prepared.boot, 0), mind.clone())?)?;
        Ok(())
    }
}

/// The two threads, and what they have done so far.
pub(crate) struct Apprentice {
    // In this order: what is trained last is still to be written.
    trainer: Trainer,
    scribe: Option<Arc<Scribe>>,
    learning: RobotLearning,
    found: mpsc::Receiver<Found>,
    trainings: Arc<AtomicU64>,
    memory: Arc<MemoryState>,
    /// What the status says: keys used, samples held, digest, trainings; and of the memory.
    reported: Option<((u64, usize, Digest, u64), String)>,
}

/// What the status says of the memory.
#[derive(Default)]
struct MemoryState(Mutex<String>);

impl MemoryState {
    fn set(&self, to: String) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = to;
    }

    fn get(&self) -> String {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Apprentice {
    pub fn start(
        prepared: Prepared,
        id: RobotId,
        inbox: &Arc<Inbox>,
        account: &Arc<Account>,
        supervisor: &Arc<Supervisor>,
    ) -> Result<Self, LinkError> {
        let Prepared { learning, boot, place, store, records, remembered, failure, new, .. } = prepared;
        // What cannot be learned on is an error of the start, not of the thread.
        learning.learner()?;
        if new {
            account.count("memory_begun");
            tracing::info!(robot = id.0, "a new memory was begun");
        }
        let memory = Arc::new(MemoryState::default());
        memory.set(match (&place, &failure) {
            (None, _) => "none".to_owned(),
            (Some(place), None) => place.path().display().to_string(),
            (Some(_), Some(failure)) => format!("failing: {failure}"),
        });
        if let Some(failure) = failure {
            account.count("memory_failed");
            account.error(&failure.to_string());
        }
        // One at most: a file is found late only once.
        let (tell_found, found) = mpsc::channel(1);
        let scribe = place.map(|place| {
            let sound = place.path().display().to_string();
            let (inbox, account, memory) = (inbox.clone(), account.clone(), memory.clone());
            let tell = move |told| match told {
                Told::Wrote(revision) => {
                    memory.set(sound.clone());
                    inbox.deliver(Input::Remembered(revision));
                }
                Told::Failed(error) => {
                    memory.set(format!("failing: {error}"));
                    account.count("memory_failed");
                    account.error(&error.to_string());
                }
                Told::Found(found) => {
                    // There is room for the only one; an error says that the robot is ending.
                    let _ = tell_found.try_send(found);
                }
            };
            Scribe::start(
                Assignment { place, robot: id, boot, known: records, classifier: remembered, store },
                supervisor.clone(),
                tell,
            )
        });
        let scribe = scribe.transpose()?.map(Arc::new);
        let trainings = Arc::new(AtomicU64::new(0));
        let trainer =
            start_trainer(&learning, inbox, account, supervisor, scribe.clone(), trainings.clone())?;
        Ok(Self { trainer, scribe, learning, found, trainings, memory, reported: None })
    }

    pub fn train(&self, changes: Vec<TrainingChange>) {
        self.trainer.train(changes);
    }

    pub fn remember(&self, revision: u64, changes: Vec<RecordChange>) {
        if let Some(scribe) = &self.scribe {
            scribe.remember(revision, changes);
        }
    }

    /// Waits for a memory that came late.
    pub async fn found(&mut self) -> Found {
        match self.found.recv().await {
            Some(found) => found,
            // Without a scribe nothing is ever found.
            None => std::future::pending().await,
        }
    }

    /// Makes both threads follow a mind that knows what was found, from its first change on.
    pub fn take_up(&self) {
        self.trainer.forget();
        if let Some(scribe) = &self.scribe {
            scribe.take_up();
        }
    }

    /// Says why what was found is not taken up. Nothing is remembered from then on.
    pub fn refuse(&self, why: &str) {
        self.memory.set(format!("failing: {why}"));
    }

    pub fn learning(&self) -> &RobotLearning {
        &self.learning
    }

    /// Whether there is anything that the status does not say yet.
    pub fn has_news(&mut self, mind: &Mind) -> bool {
        let Some((keys, held, digest)) = mind.learned_so_far() else { return false };
        let now = (keys, held, digest, self.trainings.load(Ordering::Relaxed));
        let memory = self.memory.get();
        if self.reported.as_ref().is_some_and(|(before, known)| *before == now && *known == memory) {
            return false;
        }
        self.reported = Some((now, memory));
        true
    }

    pub fn status(&self, mind: &Mind) -> Option<LearningStatus> {
        let trainings = self.trainings.load(Ordering::Relaxed);
        Some(LearningStatus { memory: self.memory.get(), trainings, ..mind.learned()? })
    }
}

fn start_trainer(
    learning: &RobotLearning,
    inbox: &Arc<Inbox>,
    account: &Arc<Account>,
    supervisor: &Arc<Supervisor>,
    scribe: Option<Arc<Scribe>>,
    trainings: Arc<AtomicU64>,
) -> std::io::Result<Trainer> {
    let begin = {
        let learning = learning.clone();
        move || learning.learner()
    };
    let learned = {
        let (inbox, account) = (inbox.clone(), account.clone());
        move |classifier: Arc<Classifier>| {
            trainings.fetch_add(1, Ordering::Relaxed);
            let mut status = account.lock();
            status.model = format!("learned, {} support vectors", classifier.support_vectors());
            drop(status);
            if let Some(scribe) = &scribe {
                scribe.remember_classifier(classifier.clone());
            }
            inbox.deliver(Input::Learned(classifier));
        }
    };
    let account = account.clone();
    let failed = move |error: &LearnError| account.error(&format!("training: {error}"));
    Trainer::start(begin, supervisor.clone(), learned, failed)
}
