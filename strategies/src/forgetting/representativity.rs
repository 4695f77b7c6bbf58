//! What stands least for its class.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use gestalt_protocol::ClassId;
use rand::Rng;

use super::contract::Forgetting;
use crate::geometry::Cluster;
use crate::sample::{HeldSample, HeldSamples};

/// Of the class K with the most samples (ties at random), personal, shared and external alike,
/// arg max over x of ‖x − f_K‖, f_K the centroid of all samples of K. Ties go to the oldest.
///
/// From the source research. Cost: one pass over K; its sum is kept.
#[derive(Clone, Debug, Default)]
pub struct RepresentativityForgetting {
    classes: BTreeMap<ClassId, Cluster>,
}

impl Forgetting for RepresentativityForgetting {
    fn inserted(&mut self, sample: &HeldSample) {
        self.classes.entry(sample.class).or_default().insert(sample);
    }

    fn removed(&mut self, sample: &HeldSample) {
        if let Entry::Occupied(mut class) = self.classes.entry(sample.class) {
            class.get_mut().remove(sample);
            if class.get().is_empty() {
                class.remove();
            }
        }
    }

    fn victim(&mut self, samples: &HeldSamples, rng: &mut dyn Rng) -> Option<u64> {
        let class = self.classes.get(&samples.draw_largest_class(rng)?)?;
        class.points().farthest_from(&class.centroid()?)
    }
}
