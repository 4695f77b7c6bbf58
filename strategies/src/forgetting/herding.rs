//! What can go without moving the mean away from that of all that came.

use std::collections::BTreeMap;

use gestalt_protocol::ClassId;
use rand::Rng;

use super::contract::Forgetting;
use crate::geometry::{Cluster, ExactSum, narrow};
use crate::sample::{HeldSample, HeldSamples, take_out};

/// Of the class K with the most samples (ties at random)
/// arg min over x of ‖μ − (S − x) / (m − 1)‖: μ the mean of all samples of K that came since there is one of K, S the sum of the m held.
/// That is the x nearest to S − (m − 1) μ. Ties go to the oldest.
///
/// Herding (Welling 2009; iCaRL, Rebuffi et al. 2017) turned round: exemplars are dropped instead of chosen, one at
/// a time. μ is kept from what the set is told, without what was retracted: after a restart, it begins with what is
/// held. Cost: one pass over K; the sums are kept.
#[derive(Clone, Debug, Default)]
pub struct HerdingForgetting {
    classes: BTreeMap<ClassId, Class>,
}

#[derive(Clone, Debug, Default)]
struct Class {
    came: ExactSum,
    held: Cluster,
}

impl Forgetting for HerdingForgetting {
    fn inserted(&mut self, sample: &HeldSample) {
        let class = self.classes.entry(sample.class).or_default();
        class.came.add(&sample.vector);
        class.held.insert(sample);
    }

    fn removed(&mut self, sample: &HeldSample) {
        if let Some(Class { came, .. }) = self.classes.get_mut(&sample.class) {
            came.subtract(&sample.vector);
        }
        self.forgotten(sample);
    }

    fn forgotten(&mut self, sample: &HeldSample) {
        take_out(&mut self.classes, sample.class, |Class { held, .. }| {
            held.remove(sample);
            held.is_empty()
        });
    }

    fn replaced(&mut self, before: &HeldSample, after: &HeldSample) {
        // The other way round a class of one sample would be forgotten.
        self.inserted(after);
        self.removed(before);
    }

    fn victim(&mut self, samples: &HeldSamples, rng: &mut dyn Rng) -> Option<u64> {
        let Class { came, held } = self.classes.get(&samples.draw_largest_class(rng)?)?;
        let others = held.sum().count() - 1.0;
        let target = (0..).zip(came.mean()?).map(|(j, mean)| held.sum().total(j) - others * mean).collect();
        held.points().nearest_to(&narrow(target))
    }
}
