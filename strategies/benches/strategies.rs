//! What sharing and forgetting cost, beside the plain formulas: `cargo bench -p gestalt-strategies --bench strategies`.
//!
//! All samples are of one class, the worst case, and have 40 components.

#[path = "../tests/plain/mod.rs"]
mod plain;

use divan::{Bencher, black_box};
use gestalt_protocol::{ClassId, RobotId, RoundId, SampleId};
use gestalt_strategies::sample::{HeldSamples, SetPart};
use gestalt_strategies::{
    Classify, ClassifyError, Forgetting, ForgettingRule, Selection, SelectionRule, TrainingSet, Vocabulary,
};
use plain::{PlainForgetting, PlainSelection};
use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

const SIZES: [usize; 3] = [100, 1_000, 10_000];
const COMPONENTS: usize = 40;
const CLASS: ClassId = ClassId(0);
const ROUND: RoundId = RoundId { counter: 1, opener: RobotId(1), life: 0 };

fn main() {
    divan::main();
}

fn vector(rng: &mut ChaCha8Rng) -> Vec<f32> {
    (0..COMPONENTS).map(|_| rng.random_range(-1.0..1.0)).collect()
}

/// Forgets the oldest common sample, so that as many stay personal and common as were.
#[derive(Debug)]
struct OldestCommon;

impl Forgetting for OldestCommon {
    fn victim(&mut self, samples: &HeldSamples, _: &mut dyn Rng) -> Option<u64> {
        let parts = [SetPart::Shared, SetPart::External];
        parts.iter().filter_map(|part| samples.part_keys(*part, CLASS).first().copied()).min()
    }
}

/// About as much work for a judgement as a machine with 50 support vectors has.
#[derive(Debug)]
struct Judge {
    vocabulary: Vocabulary,
    centres: Vec<Vec<f32>>,
}

impl Classify for Judge {
    fn vocabulary(&self) -> &Vocabulary {
        &self.vocabulary
    }

    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        let square =
            |centre: &Vec<f32>| centre.iter().zip(features).map(|(c, x)| (c - x).powi(2)).sum::<f32>();
        let decision: f32 = self.centres.iter().map(|centre| (-0.05 * square(centre)).exp()).sum();
        let p = f64::from(decision) / self.centres.len() as f64;
        Ok(vec![p, 1.0 - p])
    }

    fn probabilities_in_space(&self, coordinates: &[f32]) -> Option<Vec<f64>> {
        self.probabilities(coordinates).ok()
    }
}

/// One sample comes, one goes, one is chosen and shared, with half of `size` samples personal and half common.
fn share(bencher: Bencher, selection: Box<dyn Selection>, size: usize) {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut set = TrainingSet::new(RobotId(0), size, selection, Box::new(OldestCommon));
    for number in 1..=size as u32 / 2 {
        let id = SampleId { author: RobotId(1), life: 0, number };
        set.receive(id, CLASS, ROUND, vector(&mut rng), &mut rng);
    }
    while set.len() < size {
        set.keep(CLASS, ROUND, vector(&mut rng), &mut rng);
    }
    let judge = Judge {
        vocabulary: Vocabulary::new(["fist", "palm"]).expect("two different labels"),
        centres: (0..50).map(|_| vector(&mut rng)).collect(),
    };
    bencher.bench_local(|| {
        set.keep(CLASS, ROUND, vector(&mut rng), &mut rng);
        black_box(set.share(1, Some(&judge), &|vector| vector.to_vec(), &mut rng))
    });
}

/// One sample comes, one is chosen and goes.
fn forget(bencher: Bencher, forgetting: Box<dyn Forgetting>, size: usize) {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut set = TrainingSet::new(RobotId(0), size, SelectionRule::Random.build(), forgetting);
    while set.len() < size {
        set.keep(CLASS, ROUND, vector(&mut rng), &mut rng);
    }
    bencher.bench_local(|| black_box(set.keep(CLASS, ROUND, vector(&mut rng), &mut rng)));
}

macro_rules! selection {
    ($($name:ident: $rule:expr;)*) => {$(
        #[divan::bench(args = SIZES)]
        fn $name(bencher: Bencher, size: usize) {
            share(bencher, $rule.build(), size);
        }
    )*};
}

macro_rules! forgetting {
    ($($name:ident: $rule:expr;)*) => {$(
        #[divan::bench(args = SIZES)]
        fn $name(bencher: Bencher, size: usize) {
            forget(bencher, $rule.build(), size);
        }
    )*};
}

mod selection {
    use super::*;

    selection! {
        random: SelectionRule::Random;
        novelty: SelectionRule::Novelty;
        representativity: SelectionRule::Representativity;
        herding: SelectionRule::Herding;
        k_center: SelectionRule::KCenter;
        margin: SelectionRule::Margin;
    }

    /// The yardstick: personal × common distances at each choice.
    #[divan::bench(args = SIZES, sample_count = 5, sample_size = 1)]
    fn novelty_plainly(bencher: Bencher, size: usize) {
        share(bencher, Box::new(PlainSelection(SelectionRule::Novelty)), size);
    }
}

mod forgetting {
    use super::*;

    forgetting! {
        fifo: ForgettingRule::Fifo;
        random: ForgettingRule::Random;
        redundancy: ForgettingRule::Redundancy;
        representativity: ForgettingRule::Representativity;
        reservoir: ForgettingRule::Reservoir;
        class_balanced_reservoir: ForgettingRule::ClassBalancedReservoir;
        herding: ForgettingRule::Herding;
    }

    /// The yardstick: the distances of all pairs each time.
    #[divan::bench(args = SIZES, sample_count = 5, sample_size = 1)]
    fn redundancy_plainly(bencher: Bencher, size: usize) {
        forget(bencher, Box::new(PlainForgetting::new(ForgettingRule::Redundancy)), size);
    }
}
