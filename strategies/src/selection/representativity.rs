//! What stands best for all that was seen.

use std::collections::BTreeMap;

use gestalt_protocol::ClassId;
use gestalt_rounds::Classify;
use rand::Rng;

use super::contract::Selection;
use crate::geometry::Cluster;
use crate::sample::{HeldSample, HeldSamples, SetPart, take_out};

/// A class K at random among those with personal samples, then
/// arg min over x personal in K of ‖x − f_K‖, f_K the centroid of the personal samples of K. Ties go to the oldest.
///
/// From the source research, where it was the best for sharing. Cost: one pass over K's personal samples per choice;
/// their sum is kept.
#[derive(Clone, Debug, Default)]
pub struct RepresentativitySelection {
    /// The personal samples by class.
    classes: BTreeMap<ClassId, Cluster>,
}

impl Selection for RepresentativitySelection {
    fn inserted(&mut self, sample: &HeldSample) {
        if sample.part == SetPart::Personal {
            self.classes.entry(sample.class).or_default().insert(sample);
        }
    }

    fn removed(&mut self, sample: &HeldSample) {
        if sample.part == SetPart::Personal {
            take_out(&mut self.classes, sample.class, |class| {
                class.remove(sample);
                class.is_empty()
            });
        }
    }

    fn select(&mut self, samples: &HeldSamples, _: Option<&dyn Classify>, rng: &mut dyn Rng) -> Option<u64> {
        let personal = self.classes.get(&samples.draw_personal_class(rng)?)?;
        personal.points().nearest_to(&personal.centroid()?)
    }
}
