//! What a learning robot needs beside its mind: the thread that trains and the thread that remembers.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use gestalt_protocol::{Digest, Learning, RobotId};
use gestalt_strategies::{
    Change, Classifier, FeatureSpace, Input, Learner, LearningConfig, LearningSetup, Memory, Mind,
    MindConfig, TrainingChange, Vocabulary,
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::LinkError;
use super::account::Account;
use super::inbox::Inbox;
use super::trainer::Trainer;
use crate::memory::{Scribe, Store};

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
    pub memory: Option<PathBuf>,
    /// What its random choices follow from, together with its id and the number of its start.
    pub seed: u64,
}

/// An opened memory, before there is a mind.
pub(super) struct Prepared {
    learning: RobotLearning,
    store: Option<Store>,
    memory: Option<Memory>,
    remembered: Option<Arc<Classifier>>,
    /// Why there is no store, where there should be one.
    failure: Option<String>,
    pub boot: u32,
}

impl Prepared {
    /// Opens the memory. A disk that fails is no error yet: the robot goes on without, and says so.
    pub fn open(id: RobotId, boot: u32, learning: RobotLearning) -> Result<Self, LinkError> {
        let mut prepared =
            Self { learning, store: None, memory: None, remembered: None, failure: None, boot };
        let Some(path) = prepared.learning.memory.clone() else { return Ok(prepared) };
        let opened =
            Store::open(&path, id, boot).and_then(|store| Ok((store.memory()?, store.classifier()?, store)));
        match opened {
            Ok((memory, remembered, store)) => {
                prepared.boot = store.boot();
                prepared.memory = Some(memory);
                prepared.remembered = remembered.map(Arc::new);
                prepared.store = Some(store);
            }
            Err(error) if error.is_of_the_disk() => prepared.failure = Some(error.to_string()),
            Err(error) => return Err(error.into()),
        }
        Ok(prepared)
    }

    /// What the mind needs of it.
    pub fn setup(&mut self, id: RobotId) -> LearningSetup {
        let mut rng = ChaCha8Rng::seed_from_u64(self.learning.seed);
        rng.set_stream(u64::from(id.0) << 32 | u64::from(self.boot));
        LearningSetup {
            config: self.learning.config.clone(),
            space: self.learning.space.clone(),
            vocabulary: self.learning.vocabulary.clone(),
            rng: Box::new(rng),
            memory: self.memory.take(),
        }
    }

    /// The classifier to start with: the one trained last, or the one to build on.
    pub fn classifier(&self) -> Option<Arc<Classifier>> {
        let same = |known: &&Arc<Classifier>| known.space().id() == self.learning.space.id();
        self.remembered.as_ref().filter(same).or(self.learning.base.as_ref()).cloned()
    }
}

impl RobotLearning {
    /// Whether that robot could learn like this: opens its memory as a start would, which counts as one, and closes it.
    ///
    /// # Errors
    /// See [`LinkError`]: a memory that cannot be opened, is another robot's, or does not fit the model.
    pub fn check(&self, robot: RobotId, mind: &MindConfig) -> Result<(), LinkError> {
        let mut prepared = Prepared::open(robot, 1, self.clone())?;
        if let Some(failure) = &prepared.failure {
            let key = "learning.memory".to_owned();
            return Err(LinkError::Config { key, cause: failure.to_string() });
        }
        Mind::new(robot, prepared.boot, mind.clone())?.learning(prepared.setup(robot))?;
        Ok(())
    }
}

/// The two threads, and what they have done so far.
pub(super) struct Apprentice {
    // In this order: what is trained last is still to be written.
    trainer: Trainer,
    scribe: Option<Arc<Scribe>>,
    trainings: Arc<AtomicU64>,
    memory: Arc<Mutex<String>>,
    /// What the status says: keys used, samples held, digest, trainings; and of the memory.
    reported: Option<((u64, usize, Digest, u64), String)>,
}

impl Apprentice {
    pub fn start(prepared: Prepared, inbox: &Arc<Inbox>, account: &Arc<Account>) -> Result<Self, LinkError> {
        let Prepared { learning, store, failure, .. } = prepared;
        let RobotLearning { config, space, vocabulary, base, .. } = learning;
        let mut learner = Learner::new(space, vocabulary, config.learner.clone())?;
        if let Some(base) = &base {
            learner.build_on(base)?;
        }
        let state = match (&store, &failure) {
            (Some(store), _) => store.path().display().to_string(),
            (None, Some(failure)) => format!("failing: {failure}"),
            (None, None) => "none".to_owned(),
        };
        if let Some(failure) = failure {
            account.error(&failure);
        }
        let memory = Arc::new(Mutex::new(state.clone()));
        let scribe = match store {
            Some(store) => Some(Arc::new(start_scribe(store, state, &memory, inbox, account)?)),
            None => None,
        };
        let trainings = Arc::new(AtomicU64::new(0));
        let learned = {
            let (inbox, account, scribe, trainings) =
                (inbox.clone(), account.clone(), scribe.clone(), trainings.clone());
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
        let failed = {
            let account = account.clone();
            move |error: &gestalt_strategies::LearnError| account.error(&format!("training: {error}"))
        };
        let trainer = Trainer::start(learner, learned, failed)?;
        Ok(Self { trainer, scribe, trainings, memory, reported: None })
    }

    pub fn train(&self, changes: Vec<TrainingChange>) {
        self.trainer.train(changes);
    }

    pub fn remember(&self, revision: u64, changes: Vec<Change>) {
        if let Some(scribe) = &self.scribe {
            scribe.remember(revision, changes);
        }
    }

    /// Whether there is anything that the status does not say yet.
    pub fn has_news(&mut self, mind: &Mind) -> bool {
        let Some((keys, held, digest)) = mind.learned_so_far() else { return false };
        let now = (keys, held, digest, self.trainings.load(Ordering::Relaxed));
        let memory = self.memory.lock().unwrap_or_else(PoisonError::into_inner);
        if self.reported.as_ref().is_some_and(|(before, known)| *before == now && *known == *memory) {
            return false;
        }
        self.reported = Some((now, memory.clone()));
        true
    }

    pub fn status(&self, mind: &Mind) -> Option<Learning> {
        let trainings = self.trainings.load(Ordering::Relaxed);
        Some(Learning { memory: self.memory(), trainings, ..mind.learned()? })
    }

    fn memory(&self) -> String {
        self.memory.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

fn start_scribe(
    store: Store,
    sound: String,
    state: &Arc<Mutex<String>>,
    inbox: &Arc<Inbox>,
    account: &Arc<Account>,
) -> std::io::Result<Scribe> {
    let set = |state: &Mutex<String>, to: String| {
        *state.lock().unwrap_or_else(PoisonError::into_inner) = to;
    };
    let (of_success, of_failure) = (state.clone(), state.clone());
    let (inbox, account) = (inbox.clone(), account.clone());
    Scribe::start(
        store,
        move |revision| {
            set(&of_success, sound.clone());
            inbox.deliver(Input::Remembered(revision));
        },
        move |error| {
            set(&of_failure, format!("failing: {error}"));
            account.count("memory_failed");
            account.error(&error.to_string());
        },
    )
}
