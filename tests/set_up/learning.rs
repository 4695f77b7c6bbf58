//! Robots that learn, in a feature space without pictures.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use gestalt_link::RobotLearning;
use gestalt_protocol::ClassId;
use gestalt_strategies::{
    Classify, Components, FeatureSpace, LearningConfig, MindConfig, Observation, ScalingMethod,
};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use crate::Fixed;

/// How many raw features there are, and how many coordinates in the space.
const FEATURES: usize = 12;
const COMPONENTS: usize = 8;

/// What a frame of that gesture shows: its own corner of the space, and some chance. Those after the first six lie between two of them.
#[must_use]
pub fn gesture(class: ClassId, rng: &mut impl Rng) -> Observation {
    let (class, beyond) = (class.index() % 6, class.index() / 6);
    let features = (0..FEATURES).map(|i| {
        let chance = (rng.next_u32() >> 8) as f32 / (1 << 24) as f32;
        let high = if i < 6 { i % 6 == class } else { i % 6 == (class + beyond) % 6 };
        if high { 2.0 + chance } else { chance }
    });
    Observation { features: features.collect(), quality: 1.0 }
}

/// What robot `id` sees of what lies between two gestures: each robot is nearer another one of them, and every third torn.
#[must_use]
pub fn between(id: u32, [one, other]: [ClassId; 2], rng: &mut impl Rng) -> Observation {
    let share = [0.75, 0.25, 0.5][id as usize % 3];
    let (one, other) = (gesture(one, rng), gesture(other, rng));
    let mixed = one.features.iter().zip(&other.features).map(|(a, b)| share * a + (1.0 - share) * b);
    Observation { features: mixed.collect(), quality: 1.0 }
}

/// The feature space of all learning robots here.
///
/// # Panics
/// Never: the observations are of one length.
#[must_use]
pub fn space() -> Arc<FeatureSpace> {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let rows: Vec<Vec<f32>> = (0..120).map(|i| gesture(ClassId(i % 6), &mut rng).features).collect();
    let rows = rows.iter().map(Vec::as_slice);
    let keep = Components::Count(COMPONENTS);
    Arc::new(FeatureSpace::fit("test", rows, ScalingMethod::PerComponent, keep, &mut rng))
}

/// How a robot learns that keeps `keep` observations of each round and shares the part `fraction` of them.
#[must_use]
pub fn learning(keep: usize, fraction: f64, memory: Option<PathBuf>) -> RobotLearning {
    let config = LearningConfig {
        keep,
        spacing: Duration::from_millis(20),
        share_fraction: fraction,
        share_bytes: None,
        ..LearningConfig::default()
    };
    RobotLearning {
        config,
        space: space(),
        vocabulary: Fixed::default().vocabulary().clone(),
        base: None,
        memory,
        seed: 1,
        rules: gestalt_strategies::OwnRules::default(),
    }
}

/// Short rounds: robots that know no gesture yet would wait for nothing.
#[must_use]
pub fn short_rounds() -> MindConfig {
    MindConfig {
        patience: Duration::from_millis(300),
        deadline: Duration::from_millis(1200),
        ..MindConfig::default()
    }
}
