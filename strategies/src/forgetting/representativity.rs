//! What stands least for its class.

use std::collections::BTreeMap;

use gestalt_protocol::ClassId;
use rand::Rng;

use super::contract::Forgetting;
use crate::geometry::Cluster;
use crate::sample::{HeldSample, HeldSamples, take_out};

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
        take_out(&mut self.classes, sample.class, |class| {
            class.remove(sample);
            class.is_empty()
        });
    }

    fn victim(&mut self, samples: &HeldSamples, rng: &mut dyn Rng) -> Option<u64> {
        let class = self.classes.get(&samples.draw_largest_class(rng)?)?;
        class.points().farthest_from(&class.centroid()?)
    }
}
