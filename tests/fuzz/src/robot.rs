//! An honest robot's mind, that signs its votes and learns.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use gestalt_protocol::{Decision, Envelope, MAX_LESSONS, MAX_MESSAGE, MAX_ROBOTS, Message, RobotId};
use gestalt_strategies::sample::MAX_SERIES;
use gestalt_strategies::{
    Classify, ClassifyError, Components, FeatureSpace, Input, LearningConfig, LearningSetup, Life, Mind,
    MindConfig, Observation, Output, OwnRules, RecordChange, Refusals, RobotMemory, ScalingMethod,
    Vocabulary, is_refuted,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::gate::Signer;
use crate::swarm::roster;

/// How many gestures there are.
pub const CLASSES: u32 = 3;

/// The features of a frame.
const FEATURES: usize = 8;

/// How many coordinates a sample has.
pub const COMPONENTS: usize = 4;

/// The most that a mind may want done after one input: 128 messages are one neighbour's, the rest is its own.
const MOST_OUTPUTS: usize = 200;

/// The list of gestures.
pub fn vocabulary() -> &'static Vocabulary {
    static VOCABULARY: OnceLock<Vocabulary> = OnceLock::new();
    VOCABULARY.get_or_init(|| Vocabulary::new(["open", "two", "three"]).expect("a vocabulary"))
}

/// The space that samples lie in.
pub fn space() -> Arc<FeatureSpace> {
    static SPACE: OnceLock<Arc<FeatureSpace>> = OnceLock::new();
    let fit = || {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let rows: Vec<[f32; FEATURES]> = (0..60).map(|_| std::array::from_fn(|_| rng.random())).collect();
        let rows = rows.iter().map(<[f32; FEATURES]>::as_slice);
        let keep = Components::Count(COMPONENTS);
        Arc::new(FeatureSpace::fit("fuzz", rows, ScalingMethod::PerComponent, keep, &mut rng))
    };
    SPACE.get_or_init(fit).clone()
}

/// Tells the gesture from the first feature, as sure as the second says.
#[derive(Debug)]
pub struct ByFirst;

impl Classify for ByFirst {
    fn vocabulary(&self) -> &Vocabulary {
        vocabulary()
    }

    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        let shown = features[0] as u32 % CLASSES;
        let sure = f64::from(features[1].clamp(0.34, 0.99));
        let other = (1.0 - sure) / f64::from(CLASSES - 1);
        Ok((0..CLASSES).map(|class| if class == shown { sure } else { other }).collect())
    }
}

/// A frame that shows that gesture, so surely.
pub fn frame(class: u32, sure: f32, chance: u8) -> Input {
    let mut features: [f32; FEATURES] = std::array::from_fn(|place| f32::from(chance ^ place as u8) / 256.0);
    (features[0], features[1]) = ((class % CLASSES) as f32, sure);
    Input::Observed(Observation { features: features.to_vec(), quality: 1.0 })
}

static TAKEN_IN: AtomicU64 = AtomicU64::new(0);

/// How many inputs all minds of this program have taken in.
#[must_use]
pub fn taken_in() -> u64 {
    TAKEN_IN.load(Ordering::Relaxed)
}

/// The decision that a robot gives or announces there.
fn given(output: &Output) -> Option<&Decision> {
    match output {
        Output::Announce(announcement) => Some(&announcement.decision),
        Output::Tell(_, Envelope { message: Message::Give(give), .. }) => give.decision.as_ref(),
        _ => None,
    }
}

/// A mind, and what it may never do.
#[derive(Debug)]
pub struct Robot {
    mind: Mind,
    refusals: Refusals,
    /// How often it was started.
    boot: u32,
    /// What it has written, if it learns.
    disk: Option<Records>,
    /// Whether it has ever had as many samples as it holds at most, so that it forgot some.
    full: bool,
}

/// What is on a disk.
type Records = BTreeMap<Vec<u8>, Vec<u8>>;

/// The mind of a member of the swarm in its life of that number, with what is on its disk. One that does not learn is made in no time.
fn mind(me: RobotId, boot: u32, disk: Option<&Records>) -> Mind {
    // Drawn at random: no stranger guesses it.
    let nonce = 0x9E37_79B9_u32.wrapping_mul(me.0).wrapping_add(0x85EB_CA6B_u32.wrapping_mul(boot - 1));
    let mind = Mind::new(me, Life { boot, nonce }, MindConfig::default()).expect("the default is sound");
    let mind = mind.signed_by(Arc::new(Signer(me)));
    let Some(disk) = disk else { return mind };
    let records = disk.iter().map(|(key, value)| (key.as_slice(), value.as_slice()));
    let setup = LearningSetup {
        config: LearningConfig::default(),
        space: space(),
        vocabulary: vocabulary().clone(),
        rng: Box::new(ChaCha8Rng::seed_from_u64(u64::from(nonce))),
        memory: Some(RobotMemory::read(records).expect("it reads what it wrote")),
        rules: OwnRules::default(),
    };
    mind.learning(setup).expect("a sound setup")
}

impl Robot {
    /// A member of the swarm, which was never started before.
    pub fn new(me: RobotId, learns: bool) -> Self {
        let disk = learns.then(Records::new);
        let mind = mind(me, 1, disk.as_ref());
        let refusals = mind.refusals().clone();
        let mut robot = Self { mind, refusals, boot: 1, disk, full: false };
        robot.handle(Duration::ZERO, Input::Learned(Arc::new(ByFirst)));
        robot
    }

    /// Ends it, and starts it again with what is on its disk, or with an empty one. It has no classifier yet.
    pub fn restart(&mut self, keeps_disk: bool) {
        self.boot += 1;
        self.disk.iter_mut().filter(|_| !keeps_disk).for_each(Records::clear);
        let mind = mind(self.mind.me(), self.boot, self.disk.as_ref());
        // A disk tells that its robot has lived before, also where nothing was taught.
        self.mind = if keeps_disk { mind.started_again() } else { mind };
        self.refusals = self.mind.refusals().clone();
    }

    /// The mind.
    pub fn mind(&self) -> &Mind {
        &self.mind
    }

    /// Whether it had to forget samples.
    pub fn forgot(&self) -> bool {
        self.full
    }

    /// Lets it take in one input, and writes to its disk what it wants remembered.
    ///
    /// # Panics
    /// If it wants more done than one input is worth, or says what others could not read or would convict it of, or forgets what it refused.
    pub fn handle(&mut self, now: Duration, input: Input) -> Vec<Output> {
        TAKEN_IN.fetch_add(1, Ordering::Relaxed);
        let mut outputs = self.mind.handle(now, input);
        assert!(outputs.len() <= MOST_OUTPUTS, "{} outputs for one input", outputs.len());
        for output in &outputs {
            if let Output::Broadcast(envelope) | Output::Tell(_, envelope) = output {
                let written = envelope.encode();
                assert!(written.len() <= MAX_MESSAGE);
                assert_eq!(gestalt_protocol::Envelope::decode(&written).as_ref(), Ok(envelope));
            }
            if let Some(decision) = given(output) {
                assert!(!is_refuted(decision), "an honest robot is taken for a liar: {decision:?}");
            }
        }
        let refusals = self.mind.refusals();
        for ((refusal, before), (_, after)) in self.refusals.iter().zip(refusals.iter()) {
            assert!(after >= before, "{refusal:?} was counted {before} times, and now {after}");
        }
        self.refusals = refusals.clone();
        self.full |= self.mind.training_set().is_some_and(|set| set.len() >= set.capacity());
        let written = outputs.iter().filter_map(|output| self.write(output)).max();
        if let Some(revision) = written {
            outputs.extend(self.handle(now, Input::Remembered(revision)));
        }
        outputs
    }

    /// What it wants remembered is on its disk at once, all of it.
    fn write(&mut self, output: &Output) -> Option<u64> {
        let Output::Remember { revision, changes } = output else { return None };
        let disk = self.disk.as_mut()?;
        for RecordChange { key, value } in changes {
            match value {
                Some(value) => drop(disk.insert(key.clone(), value.clone())),
                None => drop(disk.remove(key)),
            }
        }
        Some(*revision)
    }

    /// Says so if a table is larger than it may be, or holds a vote that its author never signed.
    ///
    /// # Panics
    /// If so.
    pub fn check(&self) {
        let signed = |envelope: gestalt_protocol::Envelope| {
            let by = envelope.signature.expect("in a sealed swarm votes are signed");
            assert!(roster().check(&envelope.statement(), &by).is_ok(), "a vote of nobody's: {envelope:?}");
        };
        if let Some(ballot) = self.mind.ballot() {
            assert!(ballot.len() <= MAX_ROBOTS);
            ballot.lacking(&Default::default()).for_each(|held| signed(held.into()));
        }
        if let Some(held) = self.mind.held() {
            held.certificate.held_votes().for_each(|held| signed(held.into()));
        }
        if let (Some(set), Some(learned)) = (self.mind.training_set(), self.mind.learned()) {
            assert!(set.len() <= set.capacity() && learned.lessons <= MAX_LESSONS);
            assert!(
                set.seen().series_count() <= MAX_SERIES && learned.aside <= LearningConfig::default().aside
            );
        }
    }
}
