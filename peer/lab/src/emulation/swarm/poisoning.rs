//! What poisoners say in place of what they share.

use std::collections::BTreeMap;

use gestalt_protocol::{Batches, Envelope, HeldBatch, Message, SampleId, Samples, SharedSample};
use gestalt_strategies::{HeldSample, Mind, SetPart, decode_vector};
use rand_chacha::ChaCha8Rng;

use super::Swarm;
use super::seed::{self, stream};
use crate::emulation::poison::{Poison, round_of};

/// A robot that poisons.
pub(super) struct Poisoner {
    pub strategy: Poison,
    pub rng: ChaCha8Rng,
    /// What it said under each name: it says the same again when it is asked.
    pub told: BTreeMap<SampleId, SharedSample>,
}

impl Poisoner {
    pub fn new(strategy: Poison, seed: u64, robot: u32) -> Self {
        Self { strategy, rng: stream(seed, seed::poison(robot)), told: BTreeMap::new() }
    }
}

impl Swarm<'_> {
    /// What that robot says in place of this, if it poisons: nothing, or as many messages.
    pub(super) fn poisoned(&mut self, i: usize, envelope: Envelope) -> Vec<Envelope> {
        let Some(mut poisoner) = self.robots[i].poison.take() else { return vec![envelope] };
        let me = self.robots[i].id;
        let said = match envelope.message {
            Message::Samples(samples) => {
                let Envelope { author, stamp, signature, .. } = envelope;
                let rate = poisoner.strategy.rate();
                let batches = (0..rate).filter_map(|copy| {
                    let samples = self.poison_all(i, &mut poisoner, &samples, copy)?;
                    Some(Envelope { author, stamp, message: Message::Samples(samples), signature })
                });
                batches.collect()
            }
            Message::Batches(batches) => {
                let mut told = Vec::new();
                for batch in batches.batches {
                    let HeldBatch { robot, stamp, signature, .. } = batch;
                    if robot != me {
                        told.push(batch);
                    } else if let Some(samples) = self.poison_all(i, &mut poisoner, &batch.samples, 0) {
                        told.push(HeldBatch { robot, stamp, samples, signature });
                    }
                }
                vec![Envelope { message: Message::Batches(Batches { batches: told }), ..envelope }]
            }
            _ => vec![envelope],
        };
        self.robots[i].poison = Some(poisoner);
        said
    }

    /// What it says of a batch of its own, or nothing. Copies beyond the first are samples of lives that it never had.
    fn poison_all(&self, i: usize, poisoner: &mut Poisoner, samples: &Samples, copy: u32) -> Option<Samples> {
        if poisoner.strategy == Poison::Silent {
            return None;
        }
        let poisoned = samples.samples.iter().map(|sample| {
            let id = SampleId { life: sample.id.life ^ copy, ..sample.id };
            let said = poisoner
                .told
                .get(&id)
                .cloned()
                .or_else(|| Some(SharedSample { id, ..self.poison_one(i, poisoner, sample)? }));
            let said = said.unwrap_or_else(|| SharedSample { id, ..sample.clone() });
            poisoner.told.entry(id).or_insert(said).clone()
        });
        Some(Samples { space: samples.space, samples: poisoned.collect() })
    }

    fn poison_one(&self, i: usize, poisoner: &mut Poisoner, sample: &SharedSample) -> Option<SharedSample> {
        let (school, teaching) = (self.school.as_ref()?, self.scenario.learning.as_ref()?);
        let known = self.robots[i].mind.as_ref().and_then(Mind::training_set)?;
        let truth = HeldSample {
            key: u64::MAX,
            part: SetPart::Shared,
            id: Some(sample.id),
            class: sample.class,
            round: sample.round,
            vector: decode_vector(&sample.vector, school.space()).ok()?.into(),
        };
        let showings = self.record.showings.len() as u32;
        let of = (self.scenario.classes, showings);
        let (vector, class) = poisoner.strategy.of(&truth, known, of, &mut poisoner.rng)?;
        let round = if class == sample.class { sample.round } else { round_of(known, class)? };
        let vector = teaching.robots.precision.encode(&vector, school.space());
        Some(SharedSample { id: sample.id, class, round, vector })
    }
}
