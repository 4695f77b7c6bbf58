//! One robot, as it reports itself.

use std::collections::BTreeMap;
use std::time::Duration;

use gestalt_protocol::{
    Camera, ClassId, Heeded, Holding, Opinion, Rank, Reported, RobotId, RoundId, Status, VocabularyId,
};
use gestalt_strategies::Vocabulary;
use serde::Serialize;

use super::SILENT;
use super::text::{clipped, finite};

/// The most links, doubted robots, counters and errors that are kept of a robot.
const MAX_LINKS: usize = 64;
const MAX_DOUBTED: usize = 64;
const MAX_COUNTERS: usize = 128;
const MAX_ERRORS: usize = 16;

/// For how many rounds it is kept what a robot holds.
const MAX_HELD: usize = 2;

/// One robot for people's eyes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RobotView {
    /// Which robot.
    pub id: RobotId,
    /// Its name for people; empty before its first status.
    pub name: String,
    /// Whether it answers: it has reported itself within the last five seconds.
    pub answers: bool,
    /// How often it has started.
    pub boot: u32,
    /// Its classifier, in words.
    pub model: String,
    /// Whether it signs what it says.
    pub sealed: bool,
    /// The robots it is directly linked to.
    pub links: Vec<RobotId>,
    /// How many robots it knows to be alive, itself included.
    pub alive: usize,
    /// The newest round it knows.
    pub round: Option<RoundId>,
    /// Whether that round is open.
    pub open: bool,
    /// What it sees with, and how that goes.
    pub camera: Camera,
    /// What it has learned from; `None` for a robot that does not learn.
    pub learning: Option<LearningView>,
    /// Its latest errors, newest last, each with the fix.
    pub errors: Vec<Reported>,
}

/// What a robot has learned from, in totals over all gestures.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LearningView {
    /// Its own samples that it has not shared.
    pub personal: usize,
    /// Its own samples that it has shared.
    pub shared: usize,
    /// The samples it has from others.
    pub external: usize,
    /// How many samples it may hold.
    pub capacity: usize,
    /// How often it has trained.
    pub trainings: u64,
    /// Other robots whose samples it does not all train on.
    pub doubted: Vec<Heeded>,
    /// Where it keeps all this.
    pub memory: String,
}

/// What is kept of one robot.
#[derive(Clone, Debug)]
pub(super) struct Robot {
    has_token: bool,
    told: Option<Told>,
    /// When it came or reported itself last.
    heard: Duration,
    /// What it holds for the newest rounds: robots end the next one before the swarm's decision of it is heard.
    held: BTreeMap<RoundId, Held>,
}

/// What one robot holds for a round.
#[derive(Clone, Copy, Debug)]
pub(super) struct Held {
    rank: Rank,
    /// The gesture.
    pub class: Option<ClassId>,
}

#[derive(Clone, Debug)]
struct Told {
    status: Status,
    vocabulary: Option<(VocabularyId, Vocabulary)>,
}

impl Robot {
    pub fn new(now: Duration) -> Self {
        Self { has_token: false, told: None, heard: now, held: BTreeMap::new() }
    }

    /// Its token is there. Says whether that is new.
    pub fn come(&mut self, now: Duration) -> bool {
        self.heard = self.heard.max(now);
        !std::mem::replace(&mut self.has_token, true)
    }

    /// It reports itself; the account of an earlier start that was under way for long is passed over.
    pub fn tell(&mut self, now: Duration, status: Status) {
        self.heard = self.heard.max(now);
        match &mut self.told {
            Some(told) if told.status.boot > status.boot => {}
            Some(told)
                if told.vocabulary.as_ref().map(|(_, it)| it) == Vocabulary::of_status(&status).as_ref() =>
            {
                told.status = bounded(status);
            }
            told => *told = Some(Told::new(status)),
        }
    }

    pub fn hold(&mut self, holding: &Holding) {
        let Holding { round, class, rank, .. } = holding;
        let held = Held { rank: *rank, class: *class };
        let known = self.held.entry(*round).or_insert(held);
        if known.rank < held.rank {
            *known = held;
        }
        if self.held.len() > MAX_HELD {
            self.held.pop_first();
        }
    }

    /// What it holds for that round, if that is one of the newest.
    pub fn holds(&self, round: RoundId) -> Option<Held> {
        self.held.get(&round).copied()
    }

    pub fn is_there(&self) -> bool {
        self.has_token
    }

    pub fn is_silent(&self, now: Duration) -> bool {
        now.saturating_sub(self.heard) > SILENT
    }

    /// Its own account of itself, once it gave one.
    pub fn status(&self) -> Option<&Status> {
        self.told.as_ref().map(|told| &told.status)
    }

    pub fn newest_round(&self) -> Option<u32> {
        self.status()?.round.map(|round| round.counter)
    }

    pub fn vocabulary(&self) -> Option<&Vocabulary> {
        self.told.as_ref()?.vocabulary.as_ref().map(|(_, vocabulary)| vocabulary)
    }

    pub fn vocabulary_id(&self) -> Option<VocabularyId> {
        self.told.as_ref()?.vocabulary.as_ref().map(|(id, _)| *id)
    }

    pub fn counters(&self) -> &BTreeMap<String, u64> {
        static NONE: BTreeMap<String, u64> = BTreeMap::new();
        self.told.as_ref().map_or(&NONE, |told| &told.status.counters)
    }

    pub fn view(&self, id: RobotId, now: Duration) -> RobotView {
        let Some(Told { status, .. }) = &self.told else {
            let nothing = Status::new(id, String::new(), 0);
            return RobotView { answers: !self.is_silent(now), ..RobotView::of(&nothing) };
        };
        RobotView { answers: !self.is_silent(now), ..RobotView::of(status) }
    }
}

impl Told {
    fn new(status: Status) -> Self {
        let vocabulary = Vocabulary::of_status(&status);
        let status = bounded(status);
        Self { status, vocabulary: vocabulary.map(|vocabulary| (vocabulary.id(), vocabulary)) }
    }
}

impl RobotView {
    fn of(status: &Status) -> Self {
        let learning = status.learning.as_ref().map(|it| {
            let total = |classes: &[usize]| classes.iter().fold(0_usize, |sum, n| sum.saturating_add(*n));
            LearningView {
                personal: total(&it.personal),
                shared: total(&it.shared),
                external: total(&it.external),
                capacity: it.capacity,
                trainings: it.trainings,
                doubted: it.doubted.clone(),
                memory: it.memory.clone(),
            }
        });
        Self {
            id: status.robot,
            name: status.name.clone(),
            answers: false,
            boot: status.boot,
            model: status.model.clone(),
            sealed: status.sealed,
            links: status.neighbours.clone(),
            alive: status.alive.len(),
            round: status.round,
            open: status.open,
            camera: status.camera.clone(),
            learning,
            errors: status.errors.clone(),
        }
    }
}

/// A status with nothing in it that is long, or no number: whoever has the robot's id can write one.
fn bounded(mut status: Status) -> Status {
    // Nobody reads these here, and they may be any JSON.
    status.rounds.clear();
    let Status { name, model, session, camera, .. } = &mut status;
    for text in [name, model, session, &mut camera.source, &mut camera.trouble] {
        *text = clipped(text);
    }
    let number = |number: &mut f32| *number = finite(f64::from(*number)) as f32;
    number(&mut status.camera.fps);
    number(&mut status.camera.delay_ms);
    if let Some(Opinion { gesture, probability, .. }) = &mut status.camera.opinion {
        *gesture = clipped(gesture);
        number(probability);
    }
    if let Some(learning) = &mut status.learning {
        for text in [&mut learning.memory, &mut learning.space, &mut learning.common] {
            *text = clipped(text);
        }
        learning.named.truncate(gestalt_protocol::MAX_CLASSES);
        learning.named.iter_mut().for_each(|named| named.label = clipped(&named.label));
        learning.doubted.truncate(MAX_DOUBTED);
        for classes in [&mut learning.personal, &mut learning.shared, &mut learning.external] {
            classes.truncate(gestalt_protocol::MAX_CLASSES);
        }
    }
    status.neighbours.truncate(MAX_LINKS);
    status.alive.truncate(gestalt_protocol::MAX_ROBOTS);
    status.errors.drain(..status.errors.len().saturating_sub(MAX_ERRORS));
    status.errors.iter_mut().for_each(|error| error.what = clipped(&error.what));
    let is_name = |name: &str| {
        (1..=64).contains(&name.len())
            && name.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_')
    };
    status.counters.retain(|name, _| is_name(name));
    while status.counters.len() > MAX_COUNTERS {
        status.counters.pop_last();
    }
    status
}
