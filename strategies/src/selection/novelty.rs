//! What the swarm knows least.

use std::collections::BTreeMap;

use gestalt_protocol::ClassId;
use gestalt_rounds::Classify;
use rand::Rng;

use super::contract::Selection;
use crate::geometry::{ExactSum, Neighbours, narrow};
use crate::sample::{HeldSample, HeldSamples, SetPart, take_out};

/// A class K at random among those with personal samples, then
/// arg max over x personal in K of min over x' in K, shared or external, of ‖x − x'‖: the farthest from its nearest
/// known one. With no common knowledge of K the most representative one, see
/// [`RepresentativitySelection`](super::RepresentativitySelection). Ties go to the oldest.
///
/// From the source research. Cost: a pass over K's personal samples per choice and per common sample that comes, a
/// pass over K's common samples per personal one that comes; when a common sample goes, a pass over the common ones
/// for each personal one it was nearest to, at the next choice of K (among copies of a sample, up to the first).
/// Plainly: personal × common at each choice.
#[derive(Clone, Debug, Default)]
pub struct Novelty {
    classes: BTreeMap<ClassId, Class>,
}

#[derive(Clone, Debug, Default)]
struct Class {
    /// The personal samples seek, the common ones are their neighbours.
    distances: Neighbours,
    /// The sum of the personal ones.
    personal: ExactSum,
}

impl Selection for Novelty {
    fn inserted(&mut self, sample: &HeldSample) {
        let class = self.classes.entry(sample.class).or_default();
        match sample.part {
            SetPart::Personal => {
                class.distances.add_seeker(sample.key, &sample.vector);
                class.personal.add(&sample.vector);
            }
            SetPart::Shared | SetPart::External => class.distances.add_neighbour(sample.key, &sample.vector),
        }
    }

    fn removed(&mut self, sample: &HeldSample) {
        take_out(&mut self.classes, sample.class, |Class { distances, personal }| {
            match sample.part {
                SetPart::Personal => {
                    distances.remove_seeker(sample.key);
                    personal.subtract(&sample.vector);
                }
                SetPart::Shared | SetPart::External => distances.remove_neighbour(sample.key),
            }
            distances.is_empty()
        });
    }

    fn select(&mut self, samples: &HeldSamples, _: Option<&dyn Classify>, rng: &mut dyn Rng) -> Option<u64> {
        let Class { distances, personal } = self.classes.get_mut(&samples.draw_personal_class(rng)?)?;
        if distances.has_neighbours() {
            distances.farthest().map(|pair| pair.seeker)
        } else {
            distances.seekers().nearest_to(&narrow(personal.mean()?))
        }
    }
}
