//! Any order of operations on a training set, and what a host stores of it.

use std::collections::{BTreeMap, BTreeSet};

use gestalt_protocol::{ClassId, RobotId, RoundId, SampleId, SampleSeries};
use gestalt_strategies::{
    Classify, ClassifyError, ForgettingRule, HeldSample, SampleReceipt, SeenSamples, SelectionRule,
    SetChange, TrainingSet, Vocabulary,
};
use proptest::prelude::*;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

pub const ME: RobotId = RobotId(0);

/// Under which it shares.
pub const OWN: SampleSeries = SampleSeries { author: ME, life: 0 };

pub fn generator(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

pub fn round(counter: u32) -> RoundId {
    RoundId { counter, opener: RobotId(1), life: 0 }
}

/// The life that others share in, and this robot shared in before: the one it is in is 0.
const LIFE: u32 = 7;

pub fn id(author: u32, number: u32) -> SampleId {
    SampleId { author: RobotId(author), life: LIFE, number }
}

pub fn as_is(vector: &[f32]) -> Vec<f32> {
    vector.to_vec()
}

/// What travels in a coarse encoding: whole numbers.
pub fn rounded(vector: &[f32]) -> Vec<f32> {
    vector.iter().map(|x| x.round()).collect()
}

pub fn set(capacity: usize, selection: SelectionRule, forgetting: ForgettingRule) -> TrainingSet {
    TrainingSet::new(ME, capacity, selection.build(), forgetting.build())
}

/// Three classes at three points of the plane.
#[derive(Debug)]
pub struct Judge(Vocabulary);

impl Classify for Judge {
    fn vocabulary(&self) -> &Vocabulary {
        &self.0
    }

    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        let weights = [(-1.0, 0.0), (1.0, 0.0), (0.5, 1.5)].map(|(x, y)| {
            1.0 / (0.5 + f64::from(features[0] - x).powi(2) + f64::from(features[1] - y).powi(2))
        });
        Ok(weights.iter().map(|w| w / weights.iter().sum::<f64>()).collect())
    }

    fn probabilities_in_space(&self, coordinates: &[f32]) -> Option<Vec<f64>> {
        self.probabilities(coordinates).ok()
    }
}

/// What a host stores of a training set, from nothing but its changes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Store {
    pub samples: BTreeMap<u64, HeldSample>,
    pub seen: BTreeSet<SampleId>,
    pub last_key: u64,
    pub last_number: u32,
}

impl Store {
    pub fn apply(&mut self, set: &TrainingSet, changes: &[SetChange]) {
        for change in changes {
            match change {
                SetChange::Added(key) => {
                    self.last_key = self.last_key.max(*key);
                    // One that went at once has its own entry further on.
                    if let Some(sample) = set.get(*key) {
                        self.note(sample.id);
                        self.samples.insert(*key, sample.clone());
                    }
                }
                SetChange::Removed(sample) => {
                    self.note(sample.id);
                    self.samples.remove(&sample.key);
                }
                SetChange::Seen(series) => {
                    self.seen.retain(|id| id.series() != *series);
                    self.seen.extend(set.seen().beyond(*series, &[]));
                }
                SetChange::Relabelled(key, _) => {
                    self.samples.insert(*key, set.get(*key).unwrap().clone());
                }
                SetChange::Shared(key, id) => {
                    self.note(Some(*id));
                    self.samples.insert(*key, set.get(*key).unwrap().clone());
                }
            }
        }
    }

    fn note(&mut self, id: Option<SampleId>) {
        if let Some(id) = id {
            self.seen.insert(id);
            if id.series() == OWN {
                self.last_number = self.last_number.max(id.number);
            }
        }
    }

    pub fn seen(&self) -> SeenSamples {
        let mut seen = SeenSamples::default();
        for id in &self.seen {
            seen.insert(*id).unwrap();
        }
        seen
    }

    pub fn restore_into(&self, set: &mut TrainingSet) {
        let samples = self.samples.values().cloned().collect();
        set.restore(samples, self.seen(), self.last_key + 1).unwrap();
    }
}

#[derive(Clone, Debug)]
pub enum Operation {
    Keep { class: u8, round: u32, vector: Vec<f32> },
    Receive { author: u32, number: u32, class: u8, round: u32, vector: Vec<f32> },
    Share { n: usize, judged: bool },
    Relabel { round: u32, class: u8 },
    Retract { round: u32 },
    TakeBack { author: u32, number: u32, class: u8, round: u32, vector: Vec<f32> },
    Restart,
}

pub fn operations(length: usize) -> impl Strategy<Value = Vec<Operation>> {
    // Few distinct coordinates, so that many distances are equal; halves, so that sending changes some.
    let vector = || prop::collection::vec((-2..4_i8).prop_map(|x| f32::from(x) / 2.0), 2);
    let operation = prop_oneof![
        6 => (0..3_u8, 0..6_u32, vector())
            .prop_map(|(class, round, vector)| Operation::Keep { class, round, vector }),
        6 => (1..4_u32, 1..40_u32, 0..3_u8, 0..6_u32, vector())
            .prop_map(|(author, number, class, round, vector)| {
                Operation::Receive { author, number, class, round, vector }
            }),
        3 => (0..4_usize, any::<bool>()).prop_map(|(n, judged)| Operation::Share { n, judged }),
        1 => (0..6_u32, 0..3_u8).prop_map(|(round, class)| Operation::Relabel { round, class }),
        1 => (0..6_u32).prop_map(|round| Operation::Retract { round }),
        1 => (0..4_u32, 1..40_u32, 0..3_u8, 0..6_u32, vector())
            .prop_map(|(author, number, class, round, vector)| {
                Operation::TakeBack { author, number, class, round, vector }
            }),
        1 => Just(Operation::Restart),
    ];
    prop::collection::vec(operation, 1..length)
}

pub fn rules() -> impl Strategy<Value = (SelectionRule, ForgettingRule)> {
    (prop::sample::select(&SelectionRule::ALL), prop::sample::select(&ForgettingRule::ALL))
}

/// Carries an operation out; the changes, and whether a receipt was new.
pub fn run(set: &mut TrainingSet, operation: &Operation, rng: &mut ChaCha8Rng) -> (Vec<SetChange>, bool) {
    let changes = match operation.clone() {
        Operation::Keep { class, round: r, vector } => set.keep(ClassId(class.into()), round(r), vector, rng),
        Operation::Receive { author, number, class, round: r, vector } => {
            match set.receive(id(author, number), ClassId(class.into()), round(r), vector, rng) {
                SampleReceipt::New(changes) => return (changes, true),
                SampleReceipt::Known => Vec::new(),
                SampleReceipt::Refused(error) => panic!("{error}"),
            }
        }
        Operation::Share { n, judged } => {
            let judge = Judge(Vocabulary::new(["fist", "palm", "point"]).unwrap());
            set.share(n, judged.then_some(&judge as &dyn Classify), &rounded, rng)
        }
        Operation::Relabel { round: r, class } => set.relabel(round(r), ClassId(class.into())),
        Operation::Retract { round: r } => set.retract(round(r)),
        Operation::TakeBack { author, number, class, round: r, vector } => {
            set.take_back(id(author, number), ClassId(class.into()), round(r), vector.into(), rng)
        }
        Operation::Restart => Vec::new(),
    };
    (changes, false)
}
