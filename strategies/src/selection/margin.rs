//! What the classifier is least sure of.

use gestalt_rounds::Classify;
use rand::Rng;

use super::contract::Selection;
use crate::sample::{HeldSamples, SetPart, draw};

/// A class K at random among those with personal samples, then
/// arg min over x personal in K of p₁(x) − p₂(x), the probabilities of the classifier's first and second choice. Ties
/// go to the oldest. While there is no classifier, or none that judges coordinates, one of them at random.
///
/// Margin sampling (Scheffer et al. 2001; Settles, "Active learning literature survey", 2009): the samples near a
/// boundary say most about where it runs. Cost: one judgement per personal sample of K and choice; nothing is kept,
/// since the classifier changes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Margin;

impl Selection for Margin {
    fn select(
        &mut self,
        samples: &HeldSamples,
        classifier: Option<&dyn Classify>,
        rng: &mut dyn Rng,
    ) -> Option<u64> {
        let class = samples.draw_personal_class(rng)?;
        let keys = samples.part_keys(SetPart::Personal, class);
        let judged = samples.with_keys(keys).filter_map(|sample| {
            let probabilities = classifier?.probabilities_in_space(&sample.vector)?;
            Some((margin(&probabilities), sample.key))
        });
        // Of equal minima the first is returned: the oldest.
        match judged.min_by(|(a, _), (b, _)| a.total_cmp(b)) {
            Some((_, key)) => Some(key),
            None => draw(keys, rng),
        }
    }
}

/// By how much the first choice leads the second, `0.0..=1.0`.
fn margin(probabilities: &[f64]) -> f64 {
    let (mut first, mut second) = (0.0_f64, 0.0);
    for &p in probabilities {
        if p > first {
            (first, second) = (p, first);
        } else if p > second {
            second = p;
        }
    }
    first - second
}
