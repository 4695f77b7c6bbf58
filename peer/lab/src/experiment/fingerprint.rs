//! What this program's eyes see and what its minds make of it, in figures.

use std::time::Duration;

use gestalt_vision::perception::{FeatureSet, HandConfig, Perception};
use gestalt_vision::source::SourceError;
use gestalt_vision::source::rendered::{LabelledFrame, TrainingFrames};

use super::error::ExperimentError;
use super::program::Program;
use crate::emulation::{self, Group, LinkModel, Order, Scenario, Teaching, Trace, View};
use crate::shape::NetworkShape;

/// Frames that the eyes are tried on: each gesture by three people and all cameras.
const FRAMES: usize = 18;

/// This program with the eyes for these features: looks at a few rendered hands and lets a small swarm learn, which takes a fraction of a second.
///
/// # Errors
/// Hands that cannot be rendered or seen, or a swarm that cannot be emulated.
pub fn this_program(features: FeatureSet) -> Result<Program, ExperimentError> {
    Ok(Program { version: env!("CARGO_PKG_VERSION").to_owned(), eyes: eyes(features)?, minds: minds()? })
}

fn eyes(features: FeatureSet) -> Result<u32, ExperimentError> {
    let mut perception = Perception::new(features, HandConfig::default())?;
    let mut seen = crc32fast::Hasher::new();
    seen.update(features.name().as_bytes());
    for frame in frames(features) {
        match perception.observe(&frame?.image) {
            Ok(observation) => {
                seen.update(&observation.quality.to_le_bytes());
                observation.features.iter().for_each(|value| seen.update(&value.to_le_bytes()));
            }
            Err(_) => seen.update(b"no hand"),
        }
    }
    Ok(seen.finalize())
}

/// Hands that these eyes can see.
fn frames(features: FeatureSet) -> impl Iterator<Item = Result<LabelledFrame, SourceError>> {
    TrainingFrames::new(Vec::new(), features.glove(), 60.0, 1).take(FRAMES)
}

fn minds() -> Result<u32, ExperimentError> {
    let view = View { fps: 2.0, signal: 2.0, persistence: 0.5, likeness: 0.0 };
    let scenario = Scenario {
        robots: vec![Group {
            name: "robot".to_owned(),
            count: 4,
            view: Some(view),
            lies: None,
            poison: None,
        }],
        topology: NetworkShape::Ring,
        link: LinkModel { loss: 0.1, ..LinkModel::default() },
        classes: 3,
        rounds: 6,
        order: Order::InTurn,
        interval: Duration::from_secs(7),
        mind: Default::default(),
        learning: Some(Teaching::default()),
        faults: Vec::new(),
        churn: None,
        compare: Vec::new(),
        seeds: 1,
    };
    let mut trace = Vec::new();
    // Writing to memory cannot fail.
    let _ = emulation::run_traced(&scenario, 1, Trace::to(&mut trace))?;
    Ok(crc32fast::hash(&trace))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_is_like_itself_and_sees_and_learns() {
        let this = this_program(FeatureSet::Shape).unwrap();
        assert_eq!(this, this_program(FeatureSet::Shape).unwrap());
        assert_ne!(this.eyes, this_program(FeatureSet::Embedding).unwrap().eyes);
        // Were no hand seen or nothing learned, every program would look like every other.
        for features in FeatureSet::ALL {
            let mut perception = Perception::new(features, HandConfig::default()).unwrap();
            let seen = frames(features)
                .filter(|frame| perception.observe(&frame.as_ref().unwrap().image).is_ok())
                .count();
            assert!(seen > FRAMES / 2, "{seen} of {FRAMES}");
        }
    }
}
