//! Whole minds that learn, joined by a network of a few lines.

use gestalt_protocol::{Envelope, Gesture, Instruction, Message, Outcome, Samples, Stamp, Vector, Word};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::mind::Instructed;
use crate::{
    Classify, ClassifyError, Components, Input, Mind, MindConfig, Observation, Output, Precision, Refusal,
    ScalingMethod, SelectionRule,
};

const CLASSES: u8 = 6;

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
        let shown = features[0] as usize % usize::from(CLASSES);
        Ok((0..usize::from(CLASSES)).map(|class| if class == shown { 0.95 } else { 0.01 }).collect())
    }

    fn probabilities_in_space(&self, _: &[f32]) -> Option<Vec<f64>> {
        let mut p = vec![0.001; usize::from(CLASSES)];
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
    now: Duration,
    loss: f64,
    rng: ChaCha8Rng,
    answers: Vec<gestalt_protocol::Answer>,
    said: Vec<SharedSample>,
    trained: Vec<BTreeMap<u64, ClassId>>,
}

impl Swarm {
    fn new(n: usize, config: LearningConfig, seed: u64) -> Self {
        let mut swarm = Self {
            minds: Vec::new(),
            disks: vec![BTreeMap::new(); n],
            config,
            now: Duration::ZERO,
            loss: 0.0,
            rng: ChaCha8Rng::seed_from_u64(seed),
            answers: Vec::new(),
            said: Vec::new(),
            trained: vec![BTreeMap::new(); n],
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
        let boot = self.now.as_secs() as u32 + 1;
        let config = MindConfig { patience: Duration::from_millis(600), ..MindConfig::default() };
        let records = self.disks[i].iter().map(|(key, value)| (key.as_slice(), value.as_slice()));
        let setup = LearningSetup {
            config: self.config.clone(),
            space: space(),
            vocabulary: vocabulary(),
            rng: Box::new(ChaCha8Rng::seed_from_u64(u64::from(id.0) * 1000 + u64::from(boot))),
            memory: Some(Memory::read(records).unwrap()),
        };
        self.trained[i].clear();
        Mind::new(id, boot, config).unwrap().learning(setup).unwrap()
    }

    fn introduce(&mut self, i: usize) {
        let others: BTreeSet<RobotId> = self.minds.iter().map(Mind::me).collect();
        self.input(i, Input::Learned(Arc::new(ByFirst)));
        self.input(i, Input::Alive(others.clone()));
        self.input(i, Input::Neighbours(others));
    }

    fn restart(&mut self, i: usize) {
        let mind = self.waken(i);
        self.minds[i] = mind;
        self.introduce(i);
    }

    fn input(&mut self, i: usize, input: Input) {
        let mut due = VecDeque::from([(i, input)]);
        while let Some((i, input)) = due.pop_front() {
            for output in self.minds[i].handle(self.now, input) {
                let me = self.minds[i].me();
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
                        if self.arrives() {
                            due.push_back((robot.0 as usize - 1, Input::Received(envelope)));
                        }
                    }
                    Output::Hold(decision) => {
                        for j in (0..self.minds.len()).filter(|j| *j != i) {
                            due.push_back((j, Input::Heard(me, decision.clone())));
                        }
                    }
                    Output::Answer(by, answer) => {
                        for j in 0..self.minds.len() {
                            due.push_back((j, Input::Answered(by.clone(), answer.at, me)));
                        }
                        self.answers.push(answer);
                    }
                    Output::Remember { revision, changes } => {
                        for Change { key, value } in changes {
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
                                TrainingChange::Remove(key) => {
                                    assert!(self.trained[i].remove(&key).is_some())
                                }
                                TrainingChange::Relabel { key, class } => {
                                    assert!(self.trained[i].insert(key, class).is_some());
                                }
                            }
                        }
                    }
                    Output::Announce(_) | Output::Opened(_) | Output::Closed(_) => {}
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
    fn show(&mut self, class: u8) -> RoundId {
        self.input(0, Input::Open);
        for _ in 0..self.config.keep {
            for i in 0..self.minds.len() {
                let mut features: Vec<f32> = (0..8).map(|_| self.rng.random::<f32>() * 0.9).collect();
                features[0] += f32::from(class);
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
            let instructed = Instructed { by: who.parse().unwrap(), at, instruction: instruction.clone() };
            if self.arrives() {
                self.input(i, Input::Instructed(instructed));
            }
        }
        self.pass(Duration::from_secs(3));
        at
    }

    fn was(&mut self, round: RoundId, class: u8) -> u64 {
        self.say("ada", Instruction::Was { round, class: Gesture::Class(ClassId(class)) })
    }

    fn outcome(&self, at: u64) -> Outcome {
        let answers: Vec<_> = self.answers.iter().filter(|answer| answer.at == at).collect();
        assert_eq!(answers.len(), 1, "one answer each: {answers:?}");
        answers[0].outcome
    }

    fn sizes(&self, i: usize) -> [usize; 3] {
        let set = self.minds[i].training_set().unwrap();
        [Part::Personal, Part::Shared, Part::External].map(|part| set.total(part))
    }

    fn common(&self) -> BTreeSet<String> {
        self.minds.iter().map(|mind| mind.learned().unwrap().common).collect()
    }

    /// That each trains on exactly what it holds, and its disk holds it too.
    fn check(&self) {
        for (i, mind) in self.minds.iter().enumerate() {
            let set = mind.training_set().unwrap();
            let held: BTreeMap<u64, ClassId> = set.iter().map(|sample| (sample.key, sample.class)).collect();
            let mut trained = self.trained[i].clone();
            // Beyond these are its own guesses.
            trained.split_off(&aside::training_key(0));
            assert_eq!(held, trained, "robot {} trains on what it holds", i + 1);
            let records = self.disks[i].iter().map(|(key, value)| (key.as_slice(), value.as_slice()));
            let memory = Memory::read(records).unwrap();
            let kept: BTreeMap<u64, ClassId> = memory.samples.iter().map(|s| (s.key, s.class)).collect();
            assert_eq!(held, kept, "robot {} remembers what it holds", i + 1);
            assert_eq!(&memory.seen, set.seen());
        }
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

#[test]
fn ten_robots_hold_what_the_source_says() {
    let mut swarm = Swarm::new(10, config(5, 0.2), 1);
    for class in 0..CLASSES {
        let round = swarm.show(class);
        swarm.was(round, class);
    }
    for i in 0..10 {
        assert_eq!(swarm.sizes(i), [24, 6, 54], "robot {}", i + 1);
    }
    assert_eq!(swarm.common().len(), 1);
    swarm.check();
}

#[test]
fn the_size_follows_the_formula() {
    for (n, fraction) in [(5, 0.0), (5, 0.1), (5, 0.5), (5, 1.0), (20, 0.1)] {
        let mut swarm = Swarm::new(n, config(5, fraction), 2);
        for class in 0..CLASSES {
            let round = swarm.show(class);
            swarm.was(round, class);
        }
        let own = f64::from(CLASSES) * 5.0;
        let expected = own + fraction * own * (n as f64 - 1.0);
        for i in 0..n {
            assert_eq!(swarm.sizes(i).iter().sum::<usize>() as f64, expected, "{n} robots, B = {fraction}");
        }
    }
}

#[test]
fn whatever_is_lost_all_end_with_the_same_common_knowledge() {
    let mut swarm = Swarm::new(6, config(3, 0.5), 3);
    swarm.loss = 0.5;
    for class in 0..8 {
        let round = swarm.show(class % CLASSES);
        swarm.was(round, class % CLASSES);
    }
    swarm.loss = 0.0;
    swarm.pass(Duration::from_secs(10));
    assert_eq!(swarm.common().len(), 1, "all the same");
    let held: BTreeSet<SampleId> =
        swarm.minds[0].training_set().unwrap().common().filter_map(|s| s.id).collect();
    assert_eq!(held.len(), swarm.said.len(), "all that was shared");
    swarm.check();
}

#[test]
fn a_restarted_robot_has_all_and_shares_nothing_twice() {
    let mut swarm = Swarm::new(3, config(3, 0.5), 4);
    for class in 0..4 {
        let round = swarm.show(class);
        swarm.was(round, class);
        let before = swarm.sizes(1);
        swarm.restart(1);
        assert_eq!(swarm.sizes(1), before);
    }
    swarm.pass(Duration::from_secs(10));
    let ids: BTreeSet<SampleId> = swarm.said.iter().map(|sample| sample.id).collect();
    assert_eq!(ids.len(), swarm.said.len(), "no number twice");
    let vectors: Vec<_> = swarm.said.iter().map(|sample| &sample.vector).collect();
    assert!((1..vectors.len()).all(|i| !vectors[..i].contains(&vectors[i])), "no sample twice");
    assert_eq!(swarm.common().len(), 1);
    swarm.check();
}

#[test]
fn a_robot_that_lost_its_disk_gets_its_own_samples_back_and_goes_on_counting() {
    let mut swarm = Swarm::new(3, config(3, 1.0), 5);
    let round = swarm.show(1);
    swarm.was(round, 1);
    swarm.disks[1].clear();
    swarm.restart(1);
    swarm.pass(Duration::from_secs(6));
    assert_eq!(swarm.sizes(1), [0, 3, 6], "its own are shared ones again");
    let round = swarm.show(2);
    swarm.was(round, 2);
    let ids: BTreeSet<SampleId> = swarm.said.iter().map(|sample| sample.id).collect();
    assert_eq!(ids.len(), swarm.said.len(), "no number twice");
    assert_eq!(swarm.common().len(), 1);
}

#[test]
fn a_correction_reaches_all_also_who_was_away() {
    let mut swarm = Swarm::new(3, config(3, 1.0), 6);
    let round = swarm.show(1);
    swarm.was(round, 1);
    // The third hears nothing of the correction.
    let at = swarm.now.as_millis() as u64;
    for i in 0..2 {
        let instruction = Instruction::Was { round, class: Gesture::Label("4".to_owned()) };
        swarm.input(i, Input::Instructed(Instructed { by: "ada".parse().unwrap(), at, instruction }));
    }
    swarm.pass(Duration::from_secs(10));
    assert_eq!(swarm.outcome(at), Outcome::Learned);
    for mind in &swarm.minds {
        assert_eq!(mind.training_set().unwrap().class_count(ClassId(4)), 9);
        assert_eq!(mind.training_set().unwrap().class_count(ClassId(1)), 0);
    }
    swarm.check();
}

#[test]
fn what_is_taken_back_is_forgotten_and_what_is_said_then_counts() {
    let mut swarm = Swarm::new(3, config(3, 1.0), 7);
    let round = swarm.show(1);
    swarm.was(round, 1);
    let at = swarm.say("ada", Instruction::Retract { round });
    assert_eq!(swarm.outcome(at), Outcome::Learned);
    for i in 0..3 {
        assert_eq!(swarm.sizes(i), [0, 0, 0]);
    }
    swarm.check();
    swarm.restart(2);
    swarm.was(round, 5);
    for i in 0..3 {
        assert_eq!(swarm.sizes(i), [0, 3, 6], "robot {} has them back, once", i + 1);
        assert_eq!(swarm.minds[i].training_set().unwrap().class_count(ClassId(5)), 9);
    }
    assert_eq!(swarm.said.len(), 9, "nothing is shared again");
    swarm.check();
}

#[test]
fn right_and_wrong_are_about_the_decision() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 8);
    let round = swarm.show(3);
    let at = swarm.say("ada", Instruction::Right { round });
    assert_eq!(swarm.outcome(at), Outcome::Learned);
    assert_eq!(swarm.minds[1].training_set().unwrap().class_count(ClassId(3)), 4);
    let round = swarm.show(2);
    let at = swarm.say("ada", Instruction::Wrong { round });
    assert_eq!(swarm.outcome(at), Outcome::NothingSeen, "nothing of it can be trained on yet");
    assert_eq!(swarm.minds[0].training_set().unwrap().class_count(ClassId(2)), 0);
    assert_eq!(swarm.minds[0].learned().unwrap().aside, 2);
    swarm.restart(0);
    assert_eq!(swarm.minds[0].learned().unwrap().aside, 2);
    let guessed =
        |swarm: &Swarm| swarm.trained[0].range(aside::training_key(0)..).map(|(_, c)| *c).collect::<Vec<_>>();
    assert_eq!(guessed(&swarm), [ClassId(4); 2], "without 2, the classifier is sure of 4");
    assert_eq!(swarm.said.len(), 4, "a guess is shared with nobody");
    swarm.was(round, 5);
    assert_eq!(guessed(&swarm), [], "what is said counts more");
    assert_eq!(swarm.minds[0].training_set().unwrap().class_count(ClassId(5)), 4);
    swarm.check();
}

#[test]
fn every_word_is_answered_once() {
    let mut swarm = Swarm::new(3, config(2, 1.0), 9);
    let round = swarm.show(1);
    let unknown = RoundId { counter: 77, opener: RobotId(1) };
    let was = |round, class: &str| Instruction::Was { round, class: Gesture::Label(class.to_owned()) };
    for (instruction, outcome) in [
        (was(round, "1"), Outcome::Learned),
        (was(round, "1"), Outcome::Known),
        (was(round, "seven"), Outcome::UnknownGesture),
        (was(unknown, "1"), Outcome::UnknownRound),
        (Instruction::Right { round: unknown }, Outcome::UnknownRound),
    ] {
        let at = swarm.say("ada", instruction.clone());
        assert_eq!(swarm.outcome(at), outcome, "{instruction:?}");
    }
    let at = swarm.say("bob", was(round, "1"));
    assert_eq!(swarm.outcome(at), Outcome::Learned, "another instructor's word is a new one");
}

#[test]
fn who_does_not_learn_says_so() {
    let mut mind = Mind::new(RobotId(1), 1, MindConfig::default()).unwrap();
    let instruction = Instruction::Right { round: RoundId { counter: 1, opener: RobotId(1) } };
    mind.handle(
        Duration::ZERO,
        Input::Instructed(Instructed { by: "ada".parse().unwrap(), at: 1, instruction }),
    );
    let out = mind.handle(Duration::from_secs(2), Input::Tick);
    let answered = |output: &Output| matches!(output, Output::Answer(_, answer) if answer.outcome == Outcome::NotLearning);
    assert!(out.iter().any(answered));
}

#[test]
fn bytes_bound_what_a_round_shares() {
    let mut swarm = Swarm::new(2, LearningConfig { share_bytes: Some(128), ..config(8, 1.0) }, 10);
    let round = swarm.show(1);
    swarm.was(round, 1);
    for mind in &swarm.minds {
        let learning = mind.learning.as_ref().unwrap();
        let own = learning.set().common().filter(|sample| sample.part == Part::Shared);
        let message = Message::Samples(learning.told(own));
        let stamp = Stamp { boot: 1, sequence: 100 };
        let length = Envelope { author: mind.me(), stamp, message }.encode().len();
        assert!((80..=128).contains(&length), "{length} bytes");
    }
}

#[test]
fn a_sample_that_is_none_is_refused_and_counted() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 11);
    let space = space().id();
    let sample = |number, class, vector| SharedSample {
        id: SampleId { author: RobotId(9), number },
        class: ClassId(class),
        round: RoundId { counter: 1, opener: RobotId(9) },
        vector,
    };
    let sound = Vector::F32(vec![0.5; 4]);
    for (space, sample, refusal) in [
        (FeatureSpaceId(1), sample(1, 1, sound.clone()), Refusal::OtherSpace),
        (space, sample(1, 1, Vector::F32(vec![0.5; 3])), Refusal::BadVector),
        (space, sample(1, 1, Vector::I8(vec![1; 5])), Refusal::BadVector),
        (space, sample(1, 1, Vector::F32(vec![0.5, f32::NAN, 0.5, 0.5])), Refusal::BadVector),
        (space, sample(1, 1, Vector::F16(vec![0, 0x7c, 0, 0, 0, 0, 0, 0])), Refusal::BadVector),
        (space, sample(1, CLASSES, sound.clone()), Refusal::UnknownClass),
        (space, sample(u32::MAX, 1, sound.clone()), Refusal::SampleNumber),
    ] {
        let before = swarm.minds[0].refusals().count(refusal);
        let message = Message::Samples(Samples { space, samples: vec![sample] });
        let stamp = Stamp { boot: 1, sequence: 1 };
        swarm.input(0, Input::Received(Envelope { author: RobotId(9), stamp, message }));
        assert_eq!(swarm.minds[0].refusals().count(refusal), before + 1, "{refusal:?}");
        assert_eq!(swarm.sizes(0), [0, 0, 0]);
    }
    let message = Message::Samples(Samples { space, samples: vec![sample(1, 1, sound)] });
    let stamp = Stamp { boot: 1, sequence: 2 };
    swarm.input(0, Input::Received(Envelope { author: RobotId(9), stamp, message }));
    assert_eq!(swarm.sizes(0), [0, 0, 1], "a sound one is taken");
    swarm.check();
}

#[test]
fn a_memory_of_another_robot_or_space_is_refused() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 12);
    let round = swarm.show(1);
    swarm.was(round, 1);
    let records = swarm.disks[0].iter().map(|(key, value)| (key.as_slice(), value.as_slice()));
    let memory = Memory::read(records).unwrap();
    let setup = |space: Arc<FeatureSpace>, vocabulary| LearningSetup {
        config: config(2, 1.0),
        space,
        vocabulary,
        rng: Box::new(ChaCha8Rng::seed_from_u64(1)),
        memory: Some(memory.clone()),
    };
    let new = |me, setup| Learning::new(RobotId(me), setup).map(|_| ());
    assert_eq!(new(1, setup(space(), vocabulary())), Ok(()));
    let robot = new(2, setup(space(), vocabulary())).unwrap_err();
    assert!(matches!(robot, LearningError::Memory(MemoryError::Robot { .. })));
    let other = Vocabulary::new(["a", "b", "c", "d", "e", "f"]).unwrap();
    let vocabulary_error = new(1, setup(space(), other)).unwrap_err();
    assert_eq!(vocabulary_error, LearningError::Memory(MemoryError::Vocabulary));
    let rows = [[0.0_f32; 8], [1.0; 8]];
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let rows = rows.iter().map(<[f32; 8]>::as_slice);
    let other = FeatureSpace::fit("test", rows, ScalingMethod::PerComponent, Components::Count(1), &mut rng);
    let space_error = new(1, setup(Arc::new(other), vocabulary())).unwrap_err();
    assert!(matches!(space_error, LearningError::Memory(MemoryError::Space { .. })));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn under_loss_restarts_and_contradictions_all_end_the_same(
        seed in any::<u64>(),
        events in prop::collection::vec((0..5_u8, 0..4_usize, 0..CLASSES), 1..10),
    ) {
        let mut swarm = Swarm::new(4, LearningConfig { aside: 1000, ..config(2, 0.5) }, seed);
        let mut rounds = vec![swarm.show(0)];
        for (what, who, class) in events {
            swarm.loss = 0.3;
            let round = rounds[who % rounds.len()];
            match what {
                0 => rounds.push(swarm.show(class)),
                1 => swarm.restart(who),
                2 => {
                    swarm.say("ada", Instruction::Retract { round });
                }
                3 => {
                    swarm.say("bob", Instruction::Wrong { round });
                }
                _ => {
                    swarm.was(round, class);
                }
            }
        }
        swarm.loss = 0.0;
        swarm.pass(Duration::from_secs(16));
        prop_assert_eq!(swarm.common().len(), 1);
        let digests: Vec<_> = swarm.minds.iter().map(|mind| mind.learning.as_ref().unwrap().digest()).collect();
        prop_assert!(digests.iter().all(|digest| *digest == digests[0]), "{:?}", digests);
        let ids: BTreeSet<SampleId> = swarm.said.iter().map(|sample| sample.id).collect();
        prop_assert_eq!(ids.len(), swarm.said.len());
        swarm.check();
    }
}

#[test]
fn a_lesson_counts_for_samples_that_come_after_it() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 13);
    let round = swarm.show(1);
    let lesson = Lesson { round, instructor: "ada".parse().unwrap(), at: 9, word: Word::Was(ClassId(3)) };
    swarm.minds[0].learning.as_mut().unwrap().hear(&lesson);
    let sample = SharedSample {
        id: SampleId { author: RobotId(9), number: 1 },
        class: ClassId(1),
        round,
        vector: Vector::F32(vec![0.5; 4]),
    };
    let message = Message::Samples(Samples { space: space().id(), samples: vec![sample] });
    let stamp = Stamp { boot: 1, sequence: 1 };
    swarm.input(0, Input::Received(Envelope { author: RobotId(9), stamp, message }));
    let set = swarm.minds[0].training_set().unwrap();
    assert_eq!((set.class_count(ClassId(3)), set.class_count(ClassId(1))), (3, 0));
}
