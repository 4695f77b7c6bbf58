//! Whole minds that learn, joined by a network of a few lines.

mod asking;
mod believing;
mod feedback;
mod giving;
mod knowledge;
mod naming;
mod preceding;
mod refusing;
mod repeating;
mod rest;
mod sharing;
mod trusting;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{
    ClassId, Envelope, FeatureSpaceId, Gesture, HeldBatch, Instruction, Lesson, Message, Outcome, RobotId,
    RoundId, SampleId, Samples, SharedSample, Stamp, Vector, VocabularyId, Vote, Word,
};
use gestalt_rounds::{Classify, ClassifyError, Life, Observation, Refusal, RoundsConfig, Vocabulary};
use gestalt_svm::{Components, FeatureSpace, ScalingMethod};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Input, Instructed, Mind, Output};
use crate::believe::Believe;
use crate::learning::{
    Learning, LearningConfig, LearningError, LearningSetup, MemoryError, OwnRules, RecordChange, RobotMemory,
    TrainingChange, training_key,
};
use crate::sample::SetPart;
use crate::scrutiny::PoisonDefence;
use crate::selection::SelectionRule;
use crate::vector_codec::Precision;

const CLASSES: u32 = 6;

fn space() -> Arc<FeatureSpace> {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let rows: Vec<Vec<f32>> = (0..60).map(|_| (0..8).map(|_| rng.random::<f32>()).collect()).collect();
    let rows = rows.iter().map(Vec::as_slice);
    Arc::new(FeatureSpace::fit("test", rows, ScalingMethod::PerComponent, Components::Count(4), &mut rng))
}

fn vocabulary() -> Vocabulary {
    Vocabulary::new((0..CLASSES).map(|class| class.to_string())).unwrap()
}

/// Tells the gesture from the first feature; sure of what it says.
#[derive(Debug)]
struct ByFirst;

impl Classify for ByFirst {
    fn vocabulary(&self) -> &Vocabulary {
        static VOCABULARY: std::sync::OnceLock<Vocabulary> = std::sync::OnceLock::new();
        VOCABULARY.get_or_init(vocabulary)
    }

    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        let shown = features[0] as usize % CLASSES as usize;
        Ok((0..CLASSES as usize).map(|class| if class == shown { 0.95 } else { 0.01 }).collect())
    }

    fn probabilities_in_space(&self, _: &[f32]) -> Option<Vec<f64>> {
        let mut p = vec![0.001; CLASSES as usize];
        p[2] = 0.5;
        p[4] = 0.5;
        Some(p)
    }
}

/// Robots 1 to n, each linked to all. What they write is kept; what they say arrives, or is lost.
struct Swarm {
    minds: Vec<Mind>,
    disks: Vec<BTreeMap<Vec<u8>, Vec<u8>>>,
    config: LearningConfig,
    rules: OwnRules,
    now: Duration,
    loss: f64,
    rng: ChaCha8Rng,
    answers: Vec<gestalt_protocol::Answer>,
    asked: Vec<(Duration, gestalt_protocol::Question)>,
    said: Vec<SharedSample>,
    trained: Vec<BTreeMap<u64, ClassId>>,
    spaces: Vec<Arc<FeatureSpace>>,
    vocabularies: Vec<Vocabulary>,
    /// In a sealed swarm: who knows who may teach.
    believer: Option<Arc<dyn Believe>>,
    /// What the clock says at the next start, if not the truth.
    boot: Option<u32>,
    /// Of the latest start.
    started: u32,
    nonce: u32,
    /// How many messages robots told each other, and their bytes, by kind.
    told: BTreeMap<&'static str, (usize, usize)>,
}

impl Swarm {
    fn new(n: usize, config: LearningConfig, seed: u64) -> Self {
        Self::with_rules(n, config, OwnRules::default(), seed)
    }

    fn with_rules(n: usize, config: LearningConfig, rules: OwnRules, seed: u64) -> Self {
        let mut swarm = Self {
            minds: Vec::new(),
            disks: vec![BTreeMap::new(); n],
            config,
            rules,
            now: Duration::ZERO,
            loss: 0.0,
            rng: ChaCha8Rng::seed_from_u64(seed),
            answers: Vec::new(),
            asked: Vec::new(),
            said: Vec::new(),
            trained: vec![BTreeMap::new(); n],
            spaces: vec![space(); n],
            vocabularies: vec![vocabulary(); n],
            believer: None,
            boot: None,
            started: 0,
            nonce: 0,
            told: BTreeMap::new(),
        };
        for i in 0..n {
            let mind = swarm.waken(i);
            swarm.minds.push(mind);
        }
        for i in 0..n {
            swarm.introduce(i);
        }
        swarm
    }

    /// A mind with what its disk holds.
    fn waken(&mut self, i: usize) -> Mind {
        let id = RobotId(i as u32 + 1);
        // No start has the number of another: who says two things under one stamp is taken for two.
        self.started = self.started.max(self.now.as_secs() as u32) + 1;
        let boot = self.boot.unwrap_or(self.started);
        self.nonce = self.nonce.wrapping_mul(0x9E37_79B1).wrapping_add(1);
        let config = RoundsConfig { patience: Duration::from_millis(600), ..RoundsConfig::default() };
        let records = self.disks[i].iter().map(|(key, value)| (key.as_slice(), value.as_slice()));
        let setup = LearningSetup {
            config: self.config.clone(),
            space: self.spaces[i].clone(),
            vocabulary: self.vocabularies[i].clone(),
            rng: Box::new(ChaCha8Rng::seed_from_u64(u64::from(id.0) * 1000 + u64::from(boot))),
            memory: Some(RobotMemory::read(records).unwrap()),
            rules: self.rules.clone(),
        };
        self.trained[i].clear();
        let life = Life { boot, nonce: self.nonce };
        Mind::new(id, life, config).unwrap().learning(setup).unwrap()
    }

    fn introduce(&mut self, i: usize) {
        let others: BTreeSet<RobotId> = self.minds.iter().map(Mind::me).collect();
        if let Some(believer) = self.believer.clone() {
            self.input(i, Input::Believe(believer));
        }
        self.input(i, Input::Learned(Arc::new(ByFirst)));
        self.input(i, Input::Alive(Arc::new(others.clone())));
        self.input(i, Input::Neighbours(others));
    }

    fn restart(&mut self, i: usize) {
        let mind = self.waken(i);
        self.minds[i] = mind;
        self.introduce(i);
    }

    /// Its disk is gone.
    fn restart_empty(&mut self, i: usize) {
        self.disks[i].clear();
        self.restart(i);
    }

    /// All are switched off and on: none finds another that goes on.
    fn restart_all(&mut self) {
        self.pass(Duration::from_secs(1));
        for i in 0..self.minds.len() {
            self.minds[i] = self.waken(i);
        }
        (0..self.minds.len()).for_each(|i| self.introduce(i));
    }

    fn input(&mut self, i: usize, input: Input) {
        let mut due = VecDeque::from([(i, input)]);
        while let Some((i, input)) = due.pop_front() {
            let me = self.minds[i].me();
            let wake = self.minds[i].next_wake();
            let is_shared = matches!(&input, Input::Received(Envelope { author, message: Message::Samples(_), .. }) if *author != me);
            let outputs = self.minds[i].handle(self.now, input);
            if is_shared && wake.is_none_or(|wake| wake > self.now) {
                // What an author shares may so be told to a mind later than it comes.
                let concerns_it_alone =
                    |out: &Output| matches!(out, Output::Train(_) | Output::Remember { .. });
                assert!(outputs.iter().all(concerns_it_alone), "{outputs:?}");
                assert_eq!(self.minds[i].next_wake(), wake);
            }
            for output in outputs {
                match output {
                    Output::Broadcast(envelope) => {
                        if let Message::Samples(samples) = &envelope.message {
                            self.said.extend(samples.samples.clone());
                        }
                        for j in (0..self.minds.len()).filter(|j| *j != i) {
                            if self.arrives() {
                                due.push_back((j, Input::Received(envelope.clone())));
                            }
                        }
                    }
                    Output::Tell(robot, envelope) => {
                        let told = self.told.entry(kind(&envelope.message)).or_default();
                        *told = (told.0 + 1, told.1 + envelope.encode().len());
                        if self.arrives() {
                            due.push_back((robot.0 as usize - 1, Input::Received(envelope)));
                        }
                    }
                    Output::Answer(by, answer) => {
                        for j in 0..self.minds.len() {
                            due.push_back((j, Input::Answered(by.clone(), answer.at, me)));
                        }
                        self.answers.push(answer);
                    }
                    Output::Remember { revision, changes } => {
                        for RecordChange { key, value } in changes {
                            match value {
                                Some(value) => self.disks[i].insert(key, value),
                                None => self.disks[i].remove(&key),
                            };
                        }
                        due.push_back((i, Input::Remembered(revision)));
                    }
                    Output::Train(changes) => {
                        for change in changes {
                            match change {
                                TrainingChange::Insert { key, class, .. } => {
                                    self.trained[i].insert(key, class);
                                }
                                // One that went as soon as it came was never told.
                                TrainingChange::Remove(key) => {
                                    self.trained[i].remove(&key);
                                }
                                TrainingChange::Relabel { key, class } => {
                                    assert!(self.trained[i].insert(key, class).is_some());
                                }
                            }
                        }
                    }
                    Output::Ask(question) => {
                        for j in (0..self.minds.len()).filter(|j| *j != i) {
                            due.push_back((j, Input::Asked(question.clone())));
                        }
                        assert!(!self.minds[i].is_open(), "never while a round is open, as far as it knows");
                        self.asked.push((self.now, question));
                    }
                    Output::Announce(announcement) => {
                        for j in (0..self.minds.len()).filter(|j| *j != i) {
                            if self.loss == 0.0 || self.arrives() {
                                due.push_back((j, Input::Announced(announcement.clone())));
                            }
                        }
                    }
                    Output::Hold(_) | Output::Opened(_) | Output::Closed(_) => {}
                }
            }
        }
    }

    fn arrives(&mut self) -> bool {
        self.rng.random::<f64>() >= self.loss
    }

    fn pass(&mut self, time: Duration) {
        let end = self.now + time;
        while self.now < end {
            self.now += Duration::from_millis(50);
            for i in 0..self.minds.len() {
                self.input(i, Input::Tick);
            }
        }
    }

    /// Shows a gesture to the robots for long enough to keep all observations; gives the round.
    fn show(&mut self, class: u32) -> RoundId {
        self.input(0, Input::Open);
        for _ in 0..self.config.keep {
            for i in 0..self.minds.len() {
                let mut features: Vec<f32> = (0..8).map(|_| self.rng.random::<f32>() * 0.9).collect();
                features[0] += class as f32;
                self.input(i, Input::Observed(Observation { features, quality: 1.0 }));
            }
            self.pass(self.config.spacing);
        }
        self.pass(Duration::from_secs(3));
        self.minds[0].round().unwrap()
    }

    fn say(&mut self, who: &str, instruction: Instruction) -> u64 {
        let at = self.now.as_millis() as u64;
        for i in 0..self.minds.len() {
            let instructed =
                Instructed { by: who.parse().unwrap(), at, instruction: instruction.clone(), said: None };
            if self.arrives() {
                self.input(i, Input::Instructed(instructed));
            }
        }
        self.pass(Duration::from_secs(3));
        at
    }

    fn was(&mut self, round: RoundId, class: u32) -> u64 {
        self.say("ada", Instruction::Was { round, class: Gesture::Class(ClassId(class)) })
    }

    fn outcome(&self, at: u64) -> Outcome {
        let answers: Vec<_> = self.answers.iter().filter(|answer| answer.at == at).collect();
        assert_eq!(answers.len(), 1, "one answer each: {answers:?}");
        answers[0].outcome
    }

    fn sizes(&self, i: usize) -> [usize; 3] {
        let set = self.minds[i].training_set().unwrap();
        [SetPart::Personal, SetPart::Shared, SetPart::External].map(|part| set.total(part))
    }

    fn common(&self) -> BTreeSet<String> {
        self.minds.iter().map(|mind| mind.learned().unwrap().common).collect()
    }

    /// That each trains on what it holds and trusts, as one that begins anew would, and its disk holds it too.
    fn check(&self) {
        for (i, mind) in self.minds.iter().enumerate() {
            let set = mind.training_set().unwrap();
            let anew: BTreeMap<u64, ClassId> = mind.training().into_iter().filter_map(inserted).collect();
            assert_eq!(anew, self.trained[i], "robot {} trains on what it would if it began anew", i + 1);
            let held: BTreeMap<u64, ClassId> = set.iter().map(|sample| (sample.key, sample.class)).collect();
            if self.config.poison == PoisonDefence::default() {
                let mut trained = self.trained[i].clone();
                // Beyond these are its own guesses.
                trained.split_off(&training_key(0));
                assert_eq!(held, trained, "robot {} trains on what it holds", i + 1);
            }
            let records = self.disks[i].iter().map(|(key, value)| (key.as_slice(), value.as_slice()));
            let memory = RobotMemory::read(records).unwrap();
            let kept: BTreeMap<u64, ClassId> = memory.samples.iter().map(|s| (s.key, s.class)).collect();
            assert_eq!(held, kept, "robot {} remembers what it holds", i + 1);
            assert_eq!(&memory.seen, set.seen());
            mind.learning.as_ref().unwrap().check_batches(memory);
        }
    }
}

fn inserted(change: TrainingChange) -> Option<(u64, ClassId)> {
    match change {
        TrainingChange::Insert { key, class, .. } => Some((key, class)),
        TrainingChange::Remove(_) | TrainingChange::Relabel { .. } => None,
    }
}

fn kind(message: &Message) -> &'static str {
    match message {
        Message::Have(_) => "have",
        Message::Know(_) => "know",
        Message::Samples(_) | Message::Batches(_) => "samples",
        Message::Lessons(_) => "lessons",
        Message::Namings(_) => "names",
        _ => "other",
    }
}

fn config(keep: usize, fraction: f64) -> LearningConfig {
    LearningConfig {
        keep,
        share_fraction: fraction,
        share_bytes: None,
        precision: Precision::F32,
        selection: SelectionRule::Representativity,
        ..LearningConfig::default()
    }
}
