//! What a robot makes of what it saw and was told: samples, labelled, kept, shared and forgotten.

mod aside;
mod config;
mod labelling;
mod lived;
mod memory;
mod sharing;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{
    ClassId, Digest, FeatureSpaceId, Learning as Status, Lesson, RobotId, RoundId, SampleId, SharedSample,
};
use thiserror::Error;

use aside::Shelf;
pub use config::{LearningConfig, LearningConfigError};
use lived::Lives;
pub use memory::{Change, Memory, MemoryError};
use memory::{Counters, Item, Owner};

use crate::fnv::Fnv1a;
use crate::{
    FeatureSpace, Heard, HeldSample, LearnError, Learner, LessonBook, Part, Receipt, RestoreError, SetChange,
    TrainingSet, VectorError, Verdict, Vocabulary, decode_vector,
};

/// What a robot needs to learn.
pub struct LearningSetup {
    /// Its parameters.
    pub config: LearningConfig,
    /// The space its samples lie in; all robots of a swarm need the same.
    pub space: Arc<FeatureSpace>,
    /// The gestures there are to be learned.
    pub vocabulary: Vocabulary,
    /// Where chance comes from.
    pub rng: Box<dyn rand::Rng + Send>,
    /// What the robot remembers from before; `None` for a robot whose host keeps nothing: such a one is never owed an
    /// [`Input::Remembered`](crate::Input::Remembered).
    pub memory: Option<Memory>,
}

impl fmt::Debug for LearningSetup {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("LearningSetup").field("config", &self.config).finish_non_exhaustive()
    }
}

/// Why a robot cannot learn.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum LearningError {
    /// Its parameters.
    #[error(transparent)]
    Config(#[from] LearningConfigError),
    /// What it remembers is not its own.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// What it remembers contradicts itself.
    #[error("the memory is damaged: {0}; move the file away")]
    Restore(#[from] RestoreError),
}

/// One change of the samples that a classifier is to be trained on.
#[derive(Clone, Debug, PartialEq)]
pub enum TrainingChange {
    /// This sample is new, or replaces the one of that key.
    Insert {
        /// Names the sample.
        key: u64,
        /// The gesture it shows.
        class: ClassId,
        /// Its coordinates in the feature space.
        vector: Arc<[f32]>,
    },
    /// That sample is gone.
    Remove(u64),
    /// That sample shows another gesture.
    Relabel {
        /// Which sample.
        key: u64,
        /// The gesture it shows.
        class: ClassId,
    },
}

impl TrainingChange {
    /// Makes a learner follow it.
    ///
    /// # Errors
    /// [`LearnError`] for a sample that cannot be trained on; the learner is unchanged.
    pub fn apply_to(&self, learner: &mut Learner) -> Result<(), LearnError> {
        match self {
            Self::Insert { key, class, vector } => learner.insert(*key, *class, vector),
            Self::Remove(key) => {
                learner.remove(*key);
                Ok(())
            }
            Self::Relabel { key, class } => learner.relabel(*key, *class).map(|_| ()),
        }
    }
}

/// Why a received sample was not taken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Declined {
    Vector(VectorError),
    Class,
    Number,
}

/// What has come of samples and lessons so far.
pub(super) struct Learning {
    config: LearningConfig,
    me: RobotId,
    space: Arc<FeatureSpace>,
    space_id: FeatureSpaceId,
    vocabulary: Vocabulary,
    rng: Box<dyn rand::Rng + Send>,
    set: TrainingSet,
    lessons: LessonBook,
    lives: Lives,
    aside: Shelf,
    /// Samples that may still be shared, by the bounds of the rounds so far.
    credit: f64,
    /// Whether the numbers of this robot's samples are sure not to have been used before.
    numbered: bool,
    /// What is to be trained and remembered, and was not yet said.
    training: Vec<TrainingChange>,
    dirty: BTreeSet<Item>,
    durable: bool,
    revision: u64,
    remembered: u64,
    /// Shared samples that wait until that revision is remembered.
    unsent: VecDeque<(u64, Vec<SampleId>)>,
}

impl fmt::Debug for Learning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Learning")
            .field("set", &self.set)
            .field("lessons", &self.lessons)
            .finish_non_exhaustive()
    }
}

impl Learning {
    pub fn new(me: RobotId, setup: LearningSetup) -> Result<Self, LearningError> {
        let LearningSetup { config, space, vocabulary, rng, memory } = setup;
        config.validate()?;
        let durable = memory.is_some();
        let memory = memory.unwrap_or_default();
        let space_id = space.id();
        let owner = Owner::new(me, space_id, vocabulary.id());
        memory.check(owner, space.components(), vocabulary.classes())?;
        let mut set =
            TrainingSet::new(me, config.capacity, config.selection.build(), config.forgetting.build());
        let fresh = memory.is_empty();
        let Memory { counters, samples, seen, lessons: heard, aside, .. } = memory;
        if !fresh {
            set.restore(samples, seen, counters.next_key, counters.next_number)?;
        }
        let mut lessons = LessonBook::default();
        heard.iter().for_each(|lesson| {
            lessons.hear(lesson);
        });
        let guesses = aside.iter().filter_map(|(number, aside)| {
            let key = aside::training_key(*number);
            Some(TrainingChange::Insert { key, class: aside.guess?, vector: aside.vector.clone() })
        });
        let training = set.iter().map(inserted).chain(guesses).collect();
        let dirty = if durable && fresh { [Item::Owner, Item::Counters].into() } else { BTreeSet::new() };
        Ok(Self {
            aside: Shelf::new(aside, counters.next_aside, config.aside),
            config,
            me,
            space,
            space_id,
            vocabulary,
            rng,
            set,
            lessons,
            lives: Lives::default(),
            credit: 0.0,
            numbered: durable,
            training,
            dirty,
            durable,
            revision: 0,
            remembered: 0,
            unsent: VecDeque::new(),
        })
    }

    /// Notes a look at the gesture of a round; says whether it was kept.
    pub fn look(&mut self, now: Duration, round: RoundId, features: &[f32]) -> bool {
        let Ok(vector) = self.space.project(features) else { return false };
        self.lives.look(now, round, vector, self.config.keep, self.config.spacing) && {
            self.apply_to_round(round);
            true
        }
    }

    /// Whether this robot saw something of that round and may see more.
    pub fn wants_more(&self, round: RoundId) -> bool {
        (1..self.config.keep).contains(&self.lives.looks(round))
    }

    /// Notes that this robot knows of a round, or of another name for one.
    pub fn live(&mut self, round: RoundId) {
        if self.lives.enter(round) {
            self.apply_to_round(round);
        }
    }

    /// Notes what was decided in a round.
    pub fn decided(&mut self, round: RoundId, class: Option<ClassId>) {
        self.lives.decided(round, class);
    }

    /// What was decided in a round that this robot remembers.
    pub fn decision(&self, round: RoundId) -> Option<ClassId> {
        self.lives.decision(round)
    }

    /// Whether this robot knows anything of a round.
    pub fn knows(&self, round: RoundId) -> bool {
        self.lives.contains(round) || self.lessons.contains(round) || self.held_of(round) > 0
    }

    /// How many samples of that round are held.
    pub fn held_of(&self, round: RoundId) -> usize {
        self.set.iter().filter(|sample| sample.round == round).count()
    }

    pub fn vocabulary(&self) -> &Vocabulary {
        &self.vocabulary
    }

    pub fn lessons(&self) -> &LessonBook {
        &self.lessons
    }

    pub fn set(&self) -> &TrainingSet {
        &self.set
    }

    pub fn verdict(&self, round: RoundId) -> Verdict {
        self.lessons.verdict(round, self.vocabulary.classes())
    }

    /// Takes in what an instructor said, and does to all samples of that round what follows.
    pub fn hear(&mut self, lesson: &Lesson) -> Heard {
        let oldest = self.lessons.oldest();
        let heard = self.lessons.hear(lesson);
        if heard == Heard::New {
            self.dirty.insert(Item::Lessons(lesson.round));
            let forgotten = oldest.filter(|round| !self.lessons.contains(*round));
            self.dirty.extend(forgotten.map(Item::Lessons));
            self.apply_to_round(lesson.round);
        }
        heard
    }

    /// Takes in a sample that another robot shared. Says whether it was news.
    pub fn receive(&mut self, space: FeatureSpaceId, sample: &SharedSample) -> Result<bool, Declined> {
        if space != self.space_id {
            return Err(Declined::Vector(VectorError::Space { found: space, expected: self.space_id }));
        }
        if sample.class.index() >= self.vocabulary.classes() {
            return Err(Declined::Class);
        }
        let vector = decode_vector(&sample.vector, &self.space).map_err(Declined::Vector)?;
        let SharedSample { id, round, .. } = *sample;
        let verdict = self.verdict(round);
        let class = if let Verdict::Class(class) = verdict { class } else { sample.class };
        match self.set.receive(id, class, round, vector, &mut *self.rng) {
            Receipt::New(changes) => {
                self.dirty.insert(Item::Seen(id.author));
                self.absorb(changes);
                // A class is what it was taken under; anything else concerns all samples of the round.
                if matches!(verdict, Verdict::Among(_) | Verdict::Retracted) {
                    self.apply_to_round(round);
                }
                Ok(true)
            }
            Receipt::Known => Ok(false),
            Receipt::Refused(_) => Err(Declined::Number),
        }
    }

    /// Notes what changed in the training set, for training and memory.
    fn absorb(&mut self, changes: Vec<SetChange>) {
        for change in changes {
            self.dirty.insert(Item::Counters);
            match change {
                SetChange::Added(key) => {
                    self.dirty.insert(Item::Sample(key));
                    self.training.extend(self.set.get(key).map(inserted));
                }
                SetChange::Removed(sample) => {
                    self.dirty.insert(Item::Sample(sample.key));
                    self.training.push(TrainingChange::Remove(sample.key));
                }
                SetChange::Relabelled(key) => {
                    self.dirty.insert(Item::Sample(key));
                    self.training.extend(
                        self.set.get(key).map(|sample| TrainingChange::Relabel { key, class: sample.class }),
                    );
                }
                SetChange::Shared(key, _) => {
                    self.dirty.extend([Item::Sample(key), Item::Seen(self.me)]);
                    self.training.extend(self.set.get(key).map(inserted));
                }
            }
        }
    }

    /// This robot's numbers are sure not to be used by samples it does not remember: it has heard from others.
    pub fn note_heard_from_others(&mut self) {
        self.numbered = true;
    }

    /// What is to be trained, since the last time.
    pub fn take_training(&mut self) -> Vec<TrainingChange> {
        std::mem::take(&mut self.training)
    }

    /// What is to be remembered, since the last time, as which revision. A robot without a memory on disk remembers
    /// at once what little it can.
    pub fn take_changes(&mut self) -> Option<(u64, Vec<Change>)> {
        if !self.durable {
            self.dirty.clear();
            self.revision += 1;
            self.remembered = self.revision;
            return None;
        }
        if self.dirty.is_empty() {
            return None;
        }
        self.revision += 1;
        let dirty = std::mem::take(&mut self.dirty);
        let changes = dirty.into_iter().map(|item| Change { key: item.key(), value: self.record(item) });
        Some((self.revision, changes.collect()))
    }

    fn record(&self, item: Item) -> Option<Vec<u8>> {
        match item {
            Item::Owner => Some(memory::encode(&Owner::new(self.me, self.space_id, self.vocabulary.id()))),
            Item::Counters => Some(memory::encode(&Counters {
                next_key: self.set.next_key(),
                next_number: self.set.next_number(),
                next_aside: self.aside.next(),
            })),
            Item::Sample(key) => self.set.get(key).map(memory::encode_sample),
            Item::Seen(author) => Some(memory::encode(&self.set.seen().intervals(author).to_vec())),
            Item::Lessons(round) => {
                let mut lessons = self.lessons.of(round).peekable();
                lessons.peek().is_some().then(|| memory::encode_lessons(lessons))
            }
            Item::Aside(number) => self.aside.get(number).map(memory::encode_aside),
        }
    }

    /// What was to be remembered up to that revision is safe.
    pub fn note_remembered(&mut self, revision: u64) {
        self.remembered = self.remembered.max(revision);
    }

    /// The revision that what is known now will be remembered with, and whether it is.
    pub fn pending_revision(&self) -> u64 {
        if self.dirty.is_empty() { self.revision } else { self.revision + 1 }
    }

    pub fn is_remembered(&self, revision: u64) -> bool {
        self.remembered >= revision
    }

    pub fn digest(&self) -> Digest {
        Digest { samples: self.set.seen().digest(), lessons: self.lessons.digest() }
    }

    /// Where it stands, for the status. What the host knows of memory and training is left to it.
    pub fn status(&self) -> Status {
        let classes = (0..self.vocabulary.classes()).map(|class| ClassId(class as u8));
        let counts = |part: Part| classes.clone().map(|class| self.set.count(part, class)).collect();
        let common = self.set.common().filter_map(|sample| Some((sample.id?, sample.class)));
        let mut fnv = Fnv1a::default();
        for (id, class) in common.collect::<BTreeMap<_, _>>() {
            let number = id.author.0.to_le_bytes().into_iter().chain(id.number.to_le_bytes());
            fnv.add(number.chain([class.0]));
        }
        Status {
            space: self.space_id.to_string(),
            capacity: self.config.capacity,
            personal: counts(Part::Personal),
            shared: counts(Part::Shared),
            external: counts(Part::External),
            aside: self.aside.len(),
            common: format!("{:016x}", fnv.hash()),
            lessons: self.lessons.len(),
            memory: String::new(),
            trainings: 0,
        }
    }
}

fn inserted(sample: &HeldSample) -> TrainingChange {
    TrainingChange::Insert { key: sample.key, class: sample.class, vector: sample.vector.clone() }
}

#[cfg(test)]
mod tests;
