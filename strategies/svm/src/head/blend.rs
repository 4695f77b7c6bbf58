//! Two heads at once, each for what it is better at.

use std::sync::Arc;

use super::{Discriminant, Head, margin_of};
use crate::machine::pairs;

/// A class of fewer showings is answered for by the head for few alone: no showing can be held out to tell which head is better.
pub(crate) const YOUNG: usize = 2;

/// Odds are kept this far from certainty, so that coupling is well posed.
const LEAST: f64 = 1e-7;

/// The parts that a machine may have in the odds of its pair: two heads err differently, so both together are often better than either.
const SHARES: [f64; 7] = [0.0, 0.15, 0.3, 0.45, 0.6, 0.8, 1.0];

/// No more showings of a class than this tell which head is better: what was held out is not quite what will be shown.
const MOST: f64 = 8.0;

/// The head for few showings.
#[derive(Clone, Debug)]
pub(crate) enum Few {
    Discriminant(Discriminant),
    /// A researcher's.
    Own(Arc<dyn Head>),
}

impl PartialEq for Few {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Discriminant(one), Self::Discriminant(other)) => one == other,
            (Self::Own(one), Self::Own(other)) => Arc::ptr_eq(one, other),
            _ => false,
        }
    }
}

impl Few {
    pub fn head(&self) -> &dyn Head {
        match self {
            Self::Discriminant(discriminant) => discriminant,
            Self::Own(head) => &**head,
        }
    }
}

/// The head for few showings beside the machines, and the machines' part in each pair.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Blend {
    pub few: Few,
    /// Of each pair of classes met, in the order used everywhere: 1 where the machine answers alone, 0 where the head does.
    pub shares: Vec<f64>,
}

impl Blend {
    /// What the pairs of these classes say of a view, given what their machines say and the logarithms of the head.
    pub fn odds(&self, logs: &[f64], met: &[usize], machines: &[f64]) -> Vec<f64> {
        let log = |class: usize| logs.get(class).copied().unwrap_or(f64::NEG_INFINITY);
        pairs(met.len())
            .zip(machines)
            .zip(&self.shares)
            .map(|(((i, j), machine), share)| blended(*machine, log(met[i]) - log(met[j]), *share))
            .collect()
    }

    /// The margin between the two likeliest classes, as a plain discriminant finds it; `None` where the head is another.
    pub fn margin(&self, logs: &[f64]) -> Option<f64> {
        match &self.few {
            Few::Discriminant(discriminant) => {
                margin_of(logs).map(|margin| margin / discriminant.sharpness())
            }
            Few::Own(_) => None,
        }
    }
}

/// The probability of the first of two classes by a machine and by a head that gives the logarithm of its odds.
pub(crate) fn blended(machine: f64, log_odds: f64, share: f64) -> f64 {
    // A head that knows neither class, or that is no head, has no say.
    if share >= 1.0 || log_odds.is_nan() {
        return machine;
    }
    let machine = machine.clamp(LEAST, 1.0 - LEAST);
    let log_odds = log_odds.clamp(-50.0, 50.0);
    let log = share * (machine / (1.0 - machine)).ln() + (1.0 - share) * log_odds;
    1.0 / (1.0 + (-log).exp())
}

/// What each share of a machine lost over what neither head had met.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Losses {
    of_shares: [f64; SHARES.len()],
    weight: f64,
}

impl Losses {
    /// Counts a sample: the probability of what it showed by share.
    pub fn add(&mut self, weight: f64, probability: impl Fn(f64) -> f64) {
        for (loss, share) in self.of_shares.iter_mut().zip(SHARES) {
            *loss -= weight * probability(share).max(LEAST).ln();
        }
        self.weight += weight;
    }

    /// The share that loses little over all of these, where `each` showing was counted so many times: the mean of what is likely, so that one showing more
    /// or less moves it a little, not from one end to the other.
    pub fn share<'a>(all: impl Iterator<Item = &'a Self>, each: usize) -> f64 {
        let mut sum = Self::default();
        for losses in all {
            sum.of_shares.iter_mut().zip(losses.of_shares).for_each(|(sum, loss)| *sum += loss);
            sum.weight += losses.weight;
        }
        let known = sum.weight / each.max(1) as f64;
        let worth = f64::min(known, MOST) / f64::max(sum.weight, 1e-9);
        let least = sum.of_shares.iter().copied().fold(f64::INFINITY, f64::min);
        let weights = sum.of_shares.map(|loss| (worth * (least - loss) * each as f64).exp());
        let mean: f64 = weights.iter().zip(SHARES).map(|(weight, share)| weight * share).sum();
        mean / weights.iter().sum::<f64>()
    }
}
