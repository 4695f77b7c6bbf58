//! What a classifier, the fusion rules and a small swarm answer, in full precision: one number a line.
//!
//! Built for different processors, this program shows by how much robots of different kinds differ; `tests/targets.rs` compares them.

use std::error::Error;
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{ClassId, Decision, FusionRule, RobotId};
use gestalt_strategies::{
    Classifier, Classify, Components, FeatureSpace, Input, Learner, LearnerOptions, Life, Mind, MindConfig,
    Observation, Output, ScalingMethod, Vocabulary, fusion,
};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const CLASSES: usize = 4;
const FEATURES: usize = 8;
const ROBOTS: usize = 4;

/// Features of a class, which overlaps with others.
fn features(class: usize, rng: &mut impl Rng) -> Vec<f32> {
    let noise = |rng: &mut _| (0..12).map(|_| RngExt::random_range(rng, -0.5_f32..0.5)).sum::<f32>();
    (0..FEATURES).map(|k| 0.7 * noise(rng) + if k % CLASSES == class { 1.0 } else { 0.0 }).collect()
}

fn taught(rng: &mut ChaCha8Rng) -> Result<Arc<Classifier>, Box<dyn Error>> {
    let rows: Vec<Vec<f32>> = (0..200).map(|n| features(n % CLASSES, rng)).collect();
    let views = rows.iter().map(Vec::as_slice);
    let space = FeatureSpace::fit("answers", views, ScalingMethod::PerComponent, Components::Count(5), rng);
    let vocabulary = Vocabulary::new(["0", "1", "2", "3"])?;
    let mut learner = Learner::new(Arc::new(space), vocabulary, LearnerOptions::default())?;
    for (n, row) in rows.iter().enumerate() {
        let vector = learner.space().project(row)?;
        learner.insert(n as u64, ClassId((n % CLASSES) as u32), &vector)?;
    }
    Ok(learner.learn()?)
}

/// Robots with that classifier, that see a gesture each half second: all decisions that they hold, one after the other.
fn decided(classifier: &Arc<Classifier>, rng: &mut ChaCha8Rng) -> Result<Vec<Decision>, Box<dyn Error>> {
    let ids = (1..=ROBOTS as u32).map(RobotId);
    let mut minds = Vec::new();
    for id in ids.clone() {
        let mut mind = Mind::new(id, Life { boot: 1, nonce: id.0 }, MindConfig::default())?;
        mind.handle(Duration::ZERO, Input::Learned(classifier.clone()));
        mind.handle(Duration::ZERO, Input::Alive(Arc::new(ids.clone().collect())));
        minds.push(mind);
    }
    let mut held = Vec::new();
    let mut inbox: Vec<(usize, Input)> = Vec::new();
    for step in 0..1200_u64 {
        let now = Duration::from_millis(10 * step);
        if step % 300 == 0 {
            inbox.push((0, Input::Open));
        }
        for robot in 0..ROBOTS {
            if step % 50 == 10 {
                let features = features((step / 300) as usize, rng);
                inbox.push((robot, Input::Observed(Observation { features, quality: 1.0 })));
            }
            inbox.push((robot, Input::Tick));
        }
        for (robot, input) in std::mem::take(&mut inbox) {
            for output in minds[robot].handle(now, input) {
                match output {
                    Output::Broadcast(said) => {
                        let others = (0..ROBOTS).filter(|other| *other != robot);
                        inbox.extend(others.map(|other| (other, Input::Received(said.clone()))));
                    }
                    Output::Hold(decision) => held.push(decision),
                    _ => {}
                }
            }
        }
    }
    Ok(held)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let classifier = taught(&mut rng)?;
    let mut rows = Vec::new();
    for n in 0..200 {
        let probabilities = classifier.probabilities(&features(n % CLASSES, &mut rng))?;
        probabilities.iter().for_each(|p| println!("classifier {p:e}"));
        rows.push(probabilities.iter().map(|p| p.max(1e-6).ln() as f32).collect::<Vec<f32>>());
    }
    for rule in FusionRule::ALL {
        for votes in rows.chunks(ROBOTS) {
            let fused = fusion::fuse(rule, 6.0, CLASSES, votes.iter().map(Vec::as_slice));
            fused.iter().flat_map(|fused| &fused.probabilities).for_each(|p| println!("{rule} {p:e}"));
        }
    }
    for decision in decided(&classifier, &mut rng)? {
        let class = decision.class.map_or("none".to_owned(), |class| class.to_string());
        println!("decision:{}:{}:{class} {:e}", decision.round, decision.author, decision.confidence);
    }
    Ok(())
}
