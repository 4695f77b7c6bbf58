//! What a robot makes of what it saw and was told: samples, labelled, kept, shared and forgotten.

use std::cell::OnceCell;
use std::collections::{BTreeSet, VecDeque};
use std::fmt;
use std::hash::Hasher;
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{Digest, FeatureSpaceId, Lesson, RobotId, RoundId, SampleId};
use gestalt_rounds::Vocabulary;
use gestalt_svm::FeatureSpace;
use rand::Rng;
use siphasher::sip::SipHasher24;

use super::budget::SharedSoFar;
use super::changes::TrainingChange;
use super::config::LearningConfig;
use super::judged::JudgedRounds;
use super::memory::{self, Counters, Item, Owner, RecordChange, RobotMemory};
use super::recent_rounds::RecentRounds;
use super::setup::{LearningError, LearningSetup};
use super::shelf::Shelf;
use super::unresolved::Unresolved;
use crate::believe::{Believe, Standing};
use crate::candidates::Candidates;
use crate::groups::Groups;
use crate::lessons::{LessonBook, LessonReceipt, Verdict};
use crate::names::NameBook;
use crate::sample::Batches;
use crate::scrutiny::{PoisonDefence, Scrutiny};
use crate::training_set::{SetChange, TrainingSet};
use crate::vector_codec::VectorError;

/// The most times that a robot shares before the disk has kept up.
pub(super) const MAX_UNSENT: usize = 64;

/// Why a received sample was not taken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Declined {
    Vector(VectorError),
    Class,
    Number,
}

/// What has come of samples and lessons so far.
///
/// What it holds is bounded, whatever arrives and however long the robot lives:
///
/// | what | at most |
/// |---|---|
/// | samples held | [`capacity`](LearningConfig::capacity), of other authors as a full set's [shares](crate::shares) say |
/// | samples of which it is open what they show | [`aside`](LearningConfig::aside) |
/// | batches they were shared in | one a sample held, of 32 KiB at most |
/// | series of samples seen | 4,096; 64 lives of an author; 16,384 intervals of numbers in all |
/// | gestures that were named | 256 |
/// | lessons | 1,024 rounds, 16 instructors each; who was heard of first: 256 |
/// | rounds whose votes are kept | 64, of 16 robots each |
/// | rounds lived through | 32, with 1,024 names and [`keep`](LearningConfig::keep) looks each |
/// | shared and not yet on the disk | 64 times of sharing |
/// | robots met | 4,096, or those alive |
/// | changes to be trained and remembered | those of one input: they are taken after each |
///
/// Beside it, in the mind: what was settled with 64 neighbours (each within the bounds of what is seen, and 64 rounds),
/// 64 answers that wait, and the 64 words that were answered and heard last.
pub(crate) struct Learning {
    pub(super) config: LearningConfig,
    pub(super) me: RobotId,
    pub(super) space: Arc<FeatureSpace>,
    pub(super) space_id: FeatureSpaceId,
    pub(super) vocabulary: Vocabulary,
    pub(super) rng: Box<dyn rand::Rng + Send>,
    pub(super) set: TrainingSet,
    /// Unless all are believed: which samples of others are trained on.
    pub(super) scrutiny: Option<Scrutiny>,
    pub(super) lessons: LessonBook,
    /// The rounds of which something was said before any of that count was known here.
    pub(super) ahead: BTreeSet<RoundId>,
    pub(super) names: NameBook,
    /// In a sealed swarm: who knows who may teach.
    pub(super) believer: Option<Arc<dyn Believe>>,
    /// All gestures there are to be told apart.
    pub(super) gestures: Candidates,
    pub(super) recent: RecentRounds,
    pub(super) judged: JudgedRounds,
    /// Of the robots that live with it in one process.
    pub(crate) shelf: Arc<Shelf>,
    pub(super) aside: Unresolved,
    /// The highest counter of a round that this robot knows of.
    pub(super) newest: Option<u32>,
    /// The key of the digest, and that itself once somebody asked for it: most change again before.
    key: u64,
    digest: OnceCell<Digest>,
    /// From which the keys of the digest follow, and how many were drawn.
    secret: u64,
    drawn: u64,
    /// Something was said that does not go to the disk yet, or is to be said again.
    pub(super) heard: bool,
    /// Samples that may still be shared, by the bounds of the rounds so far.
    pub(super) credit: f64,
    /// What was shared in the newest round, of the swarm's budget.
    pub(super) shared: SharedSoFar,
    /// What is to be trained and remembered, and was not yet said.
    pub(super) training: Vec<TrainingChange>,
    pub(super) dirty: BTreeSet<Item>,
    pub(super) durable: bool,
    pub(super) revision: u64,
    pub(super) remembered: u64,
    /// As their authors said them, and those of which a sample was lately let go of.
    pub(super) batches: Batches,
    pub(super) thinned: BTreeSet<SampleId>,
    /// Batches that wait until that revision is remembered: at most [`MAX_UNSENT`] rounds' worth.
    pub(super) unsent: VecDeque<(u64, SampleId)>,
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
    /// What that robot learned so far, in the life that drew this number; whether it signs what it shares takes room of that.
    pub fn new(me: RobotId, life: u32, signs: bool, setup: LearningSetup) -> Result<Self, LearningError> {
        let LearningSetup { config, space, vocabulary, rng, memory, rules } = setup;
        config.validate()?;
        config.check_share_bytes(&space, signs)?;
        let durable = memory.is_some();
        let memory = memory.unwrap_or_default();
        let newest = memory.newest_counter();
        let space_id = space.id();
        let owner = Owner::new(me, space_id, vocabulary.id());
        memory.check(owner, space.components(), vocabulary.labels().len())?;
        let (selection, forgetting) = rules.make(&config);
        let mut set = TrainingSet::new(me, config.capacity, selection, forgetting).in_life(life);
        set = set.in_groups(Groups::new(config.learner.groups));
        if !config.author_shares {
            set = set.without_shares();
        }
        let fresh = memory.is_empty();
        let RobotMemory { counters, samples, seen, lessons: heard, namings, aside, batches: told, .. } =
            memory;
        set.restore(samples, seen, counters.next_key)?;
        let mut lessons = LessonBook::default();
        heard.iter().for_each(|lesson| {
            lessons.hear_again(lesson);
        });
        let mut names = NameBook::default();
        namings.iter().for_each(|naming| {
            names.hear_again(naming);
        });
        let gestures = Candidates::of(vocabulary.all());
        let dirty = if durable && fresh { [Item::Owner, Item::Counters].into() } else { BTreeSet::new() };
        let mut batches = Batches::default();
        let thinned = told.into_iter().filter_map(|batch| batches.keep(batch)).collect();
        let is_on = config.poison != PoisonDefence::default();
        let scrutiny = is_on.then(|| Scrutiny::new(config.poison.clone(), me, space.variance()));
        let mut rng = rng;
        let secret = rng.next_u64();
        let mut learning = Self {
            key: secret,
            digest: OnceCell::new(),
            secret,
            drawn: 0,
            heard: false,
            aside: Unresolved::new(aside, counters.next_aside, config.aside),
            config,
            me,
            space,
            space_id,
            vocabulary,
            rng,
            set,
            scrutiny,
            lessons,
            ahead: BTreeSet::new(),
            names,
            believer: None,
            gestures,
            recent: RecentRounds::default(),
            judged: JudgedRounds::default(),
            shelf: Arc::default(),
            newest,
            credit: 0.0,
            shared: SharedSoFar::default(),
            training: Vec::new(),
            dirty,
            durable,
            revision: 0,
            remembered: 0,
            batches,
            // What is held and what was told of it may have been written at different times.
            thinned,
            unsent: VecDeque::new(),
        };
        learning.let_go_aside();
        learning.trim();
        learning.gestures = learning.all_gestures();
        learning.judge_from_the_start();
        learning.training = learning.training_anew();
        Ok(learning)
    }

    /// The groups of authors that are learned from apart, if there are any.
    pub(super) fn groups(&self) -> Option<Groups> {
        Groups::new(self.config.learner.groups)
    }

    /// Notes a look at the gesture of a round; says whether it was kept.
    pub fn look(&mut self, now: Duration, round: RoundId, features: &[f32]) -> bool {
        let Ok(vector) = self.space.project(features) else { return false };
        self.recent.look(now, round, vector, self.config.keep, self.config.spacing) && {
            self.apply_to_round(round);
            true
        }
    }

    /// These robots are alive now: their samples come before those of strangers. Gives those that were not alive before.
    pub fn meet(&mut self, alive: Arc<BTreeSet<RobotId>>) -> BTreeSet<RobotId> {
        self.set.meet(alive)
    }

    /// Those of the living say nothing. Gives those that said nothing until now.
    pub fn pass_over(&mut self, silent: &BTreeSet<RobotId>) -> BTreeSet<RobotId> {
        self.set.pass_over(silent)
    }

    /// Whether this robot knows anything of a round.
    pub fn knows(&self, round: RoundId) -> bool {
        self.recent.contains(round) || self.lessons.contains(round) || self.held_of(round) > 0
    }

    /// How many samples of that round are held, by all its names.
    pub fn held_of(&self, round: RoundId) -> usize {
        let names: BTreeSet<RoundId> = self.recent.names(round).collect();
        self.set.iter().filter(|sample| names.contains(&sample.round)).count()
    }

    /// Whether anything that was seen in that round is kept, be it until its name is known.
    pub fn has_seen(&self, round: RoundId) -> bool {
        let names: BTreeSet<RoundId> = self.recent.names(round).collect();
        self.held_of(round) > 0 || self.aside.iter().any(|(_, sample)| names.contains(&sample.round))
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
        self.lessons.verdict_by_names(self.recent.names(round), &self.gestures)
    }

    /// Takes in what an instructor said, and does to all samples of that round what follows.
    pub fn hear(&mut self, lesson: &Lesson) -> LessonReceipt {
        if lesson.round.counter > self.furthest() {
            return LessonReceipt::FarAhead;
        }
        // What is known needs no look at its signature.
        if self.lessons.is_known(lesson) {
            return LessonReceipt::Known;
        }
        let standing = self.standing_of_lesson(lesson);
        if standing == Some(Standing::Unproven) {
            return LessonReceipt::Unproven;
        }
        let recent = &self.recent;
        // By all names of the round, as whoever speaks counts on by all.
        let known = self.lessons.highest_count(recent.names(lesson.round));
        let lived = |round| recent.contains(round);
        let (heard, forgotten) = self.lessons.hear_among(known, lesson, standing, lived);
        if heard == LessonReceipt::New {
            self.judged.doubt();
            self.doubt_samples();
            self.heard = true;
            self.note_ahead(lesson.round);
            if !self.is_to_come(lesson.round) {
                self.dirty.insert(Item::Lessons(lesson.round));
            }
            self.dirty.extend(forgotten.map(Item::Lessons));
            self.apply_to_round(lesson.round);
        }
        heard
    }

    /// Notes what changed in the training set, for training and memory.
    pub(super) fn absorb(&mut self, changes: Vec<SetChange>) {
        for change in changes {
            self.dirty.insert(Item::Counters);
            match change {
                SetChange::Added(key) => {
                    self.dirty.insert(Item::Sample(key));
                    self.judge(key);
                    self.train_on(key);
                }
                SetChange::Removed(sample) => {
                    self.dirty.insert(Item::Sample(sample.key));
                    self.note_gone(sample.id);
                    if let Some(scrutiny) = &mut self.scrutiny {
                        scrutiny.forget(sample.key);
                    }
                    self.training.push(TrainingChange::Remove(sample.key));
                }
                SetChange::Seen(series) => {
                    self.dirty.insert(Item::Seen(series));
                    if self.set.seen().intervals(series).is_empty() {
                        self.let_go_aside();
                    }
                }
                SetChange::Relabelled(key, before) => {
                    self.dirty.insert(Item::Sample(key));
                    self.judge(key);
                    self.train_as_another(key, before);
                }
                SetChange::Shared(key, id) => {
                    self.dirty.extend([Item::Sample(key), Item::Seen(id.series())]);
                    self.train_on(key);
                }
            }
        }
    }

    /// What is to be trained, since the last time.
    pub fn take_training(&mut self) -> Vec<TrainingChange> {
        self.reckon_samples();
        std::mem::take(&mut self.training)
    }

    /// What is to be remembered, since the last time, as which revision. A robot without a memory on disk remembers
    /// at once what little it can.
    pub fn take_changes(&mut self) -> Option<(u64, Vec<RecordChange>)> {
        self.tidy_batches();
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
        let changes =
            dirty.into_iter().map(|item| RecordChange { key: item.key(), value: self.record(item) });
        Some((self.revision, changes.collect()))
    }

    fn record(&self, item: Item) -> Option<Vec<u8>> {
        match item {
            Item::Owner => Some(memory::encode(&Owner::new(self.me, self.space_id, self.vocabulary.id()))),
            Item::Counters => Some(memory::encode(&Counters {
                next_key: self.set.next_key(),
                next_aside: self.aside.next(),
            })),
            Item::Sample(key) => self.set.get(key).map(memory::encode_sample),
            Item::Seen(series) => {
                let intervals = self.set.seen().intervals(series);
                (!intervals.is_empty()).then(|| memory::encode(&intervals.to_vec()))
            }
            Item::Lessons(round) if self.is_to_come(round) => None,
            Item::Lessons(round) => {
                let mut lessons = self.lessons.of(round).peekable();
                lessons.peek().is_some().then(|| memory::encode_lessons(lessons))
            }
            Item::Naming(gesture) => {
                let first = self.names.first(gesture);
                self.names.get(gesture).map(|naming| memory::encode_naming(naming, first))
            }
            Item::Aside(number) => self.aside.get(number).map(memory::encode_aside),
            Item::Batch(first) => self.batches.get(first).map(memory::encode_batch),
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

    /// What it knows, under its own key.
    pub fn digest(&self) -> Digest {
        *self.digest.get_or_init(|| self.digest_under(self.key))
    }

    /// What it knows, under another's key.
    pub fn digest_under(&self, key: u64) -> Digest {
        let said = self.lessons.digest(key) ^ self.names.digest(key);
        Digest { key, samples: self.set.seen().digest(key), lessons: said }
    }

    /// Draws another key if what it knows has changed since the changes were last taken. Whoever made it change did not
    /// know that key.
    pub fn refresh_digest(&mut self) {
        let told = |item: &Item| matches!(item, Item::Seen(_) | Item::Lessons(_) | Item::Naming(_));
        if std::mem::take(&mut self.heard) || self.dirty.iter().any(told) {
            self.drawn += 1;
            let mut sip = SipHasher24::new_with_keys(self.secret, u64::from_le_bytes(*b"a key   "));
            sip.write(&self.drawn.to_le_bytes());
            (self.key, self.digest) = (sip.finish(), OnceCell::new());
        }
    }
}
