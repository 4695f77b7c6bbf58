//! What keeps the mean of what was shared at the mean of what was seen.

use std::collections::BTreeMap;

use gestalt_protocol::ClassId;
use gestalt_rounds::Classify;
use rand::Rng;

use super::contract::Selection;
use crate::geometry::{Cluster, ExactSum, narrow};
use crate::sample::{HeldSample, HeldSamples, SetPart, take_out};

/// A class K at random among those with personal samples, then
/// arg min over x personal in K of ‖μ − (S + x) / (k + 1)‖: μ the mean of the own samples of K (personal and
/// shared), S the sum of the k shared ones. That is the x nearest to (k + 1) μ − S. Ties go to the oldest.
///
/// Herding (Welling, "Herding dynamical weights to learn", ICML 2009), as iCaRL chooses exemplars (Rebuffi et al.,
/// CVPR 2017). The first pick is the most representative one, the next ones make up for what it lacked. Cost: one
/// pass over K's personal samples per choice; the sums are kept.
#[derive(Clone, Debug, Default)]
pub struct HerdingSelection {
    classes: BTreeMap<ClassId, Own>,
}

#[derive(Clone, Debug, Default)]
struct Own {
    personal: Cluster,
    shared: ExactSum,
}

impl Selection for HerdingSelection {
    fn inserted(&mut self, sample: &HeldSample) {
        let class = self.classes.entry(sample.class);
        match sample.part {
            SetPart::Personal => class.or_default().personal.insert(sample),
            SetPart::Shared => class.or_default().shared.add(&sample.vector),
            SetPart::External => {}
        }
    }

    fn removed(&mut self, sample: &HeldSample) {
        take_out(&mut self.classes, sample.class, |Own { personal, shared }| {
            match sample.part {
                SetPart::Personal => personal.remove(sample),
                SetPart::Shared => shared.subtract(&sample.vector),
                SetPart::External => {}
            }
            personal.is_empty() && shared.count() == 0.0
        });
    }

    fn select(&mut self, samples: &HeldSamples, _: Option<&dyn Classify>, rng: &mut dyn Rng) -> Option<u64> {
        let Own { personal, shared } = self.classes.get(&samples.draw_personal_class(rng)?)?;
        let (k, count) = (shared.count(), shared.count() + personal.sum().count());
        let target = (0..personal.points().dimension())
            .map(|j| {
                let mean = (shared.total(j) + personal.sum().total(j)) / count;
                (k + 1.0) * mean - shared.total(j)
            })
            .collect();
        personal.points().nearest_to(&narrow(target))
    }
}
