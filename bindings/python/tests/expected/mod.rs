//! What Rust finds, for Python to find as well: probabilities bit for bit, what rules choose, and what a swarm decides.

mod emulated;

use std::path::Path;

use gestalt_mind::ModelFile;
use gestalt_protocol::{ClassId, RobotId, RoundId};
use gestalt_strategies::{Classify, ForgettingRule, SelectionRule, SetChange, TrainingSet};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

const MODEL: &[u8] = include_bytes!("../../../../peer/vision/models/rendered.gestalt");

/// How many random sets are chosen from.
const SETS: usize = 1000;

pub fn write(path: &Path) {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let expected = json!({
        "judged": (0..50).map(|_| judged(&mut rng)).collect::<Vec<_>>(),
        "emulated": emulated::swarms(),
        "sets": (0..SETS).map(|n| set(n, &mut rng)).collect::<Vec<_>>(),
    });
    std::fs::write(path, expected.to_string()).expect("a file");
}

/// Random features, and what the model that comes with Gestalt makes of them: both as bits.
fn judged(rng: &mut impl Rng) -> Value {
    let classifier = ModelFile::decode(MODEL).expect("a model").classifier;
    let features: Vec<f32> =
        (0..classifier.space().features()).map(|_| rng.random_range(-3.0..3.0)).collect();
    let probabilities = classifier.probabilities(&features).expect("features of the right number");
    json!({
        "features": features.iter().map(|x| x.to_bits()).collect::<Vec<_>>(),
        "probabilities": probabilities.iter().map(|p| p.to_bits()).collect::<Vec<_>>(),
    })
}

/// A set that samples are put into, shared from and forgotten of, by rules that take turns.
fn set(n: usize, rng: &mut impl Rng) -> Value {
    let selection = SelectionRule::ALL[n % SelectionRule::ALL.len()];
    let forgetting = ForgettingRule::ALL[n % ForgettingRule::ALL.len()];
    let (seed, capacity) = (rng.random::<u32>(), rng.random_range(3..12_usize));
    let mut chance = ChaCha8Rng::seed_from_u64(u64::from(seed));
    let mut samples = TrainingSet::new(RobotId(1), capacity, selection.build(), forgetting.build());
    let mut steps = Vec::new();
    for step in 0..rng.random_range(5..25_u32) {
        let class = rng.random_range(0..3_u8);
        // Small whole numbers: distances tie.
        let vector: Vec<f32> = (0..2).map(|_| rng.random_range(0..5_u8).into()).collect();
        let round = RoundId { counter: step + 1, opener: RobotId(1), life: 0 };
        let forgotten = samples.keep(ClassId(class.into()), round, vector.clone(), &mut chance);
        let forgotten: Vec<u64> = forgotten
            .iter()
            .filter_map(|change| match change {
                SetChange::Removed(sample) => Some(sample.key),
                _ => None,
            })
            .collect();
        let count = usize::from(step % 3 == 2) * 2;
        let shared = samples.share(count, None, &<[f32]>::to_vec, &mut chance);
        let shared: Vec<u64> = shared
            .iter()
            .filter_map(|change| match change {
                SetChange::Shared(key, _) => Some(*key),
                _ => None,
            })
            .collect();
        steps.push(json!({"class": class, "vector": vector, "forgotten": forgotten, "count": count, "shared": shared}));
    }
    json!({
        "selection": selection.name(), "forgetting": forgetting.name(), "seed": seed, "capacity": capacity, "steps": steps,
    })
}
