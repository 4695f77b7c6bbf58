//! Which samples of other robots a robot trains on: not those that contradict what it and the others saw, and of nobody too many.
//!
//! What robots know together stays as it is: every sample is held, counted and passed on, and nobody is shut out. Only what this
//! robot's classifier learns from is chosen here, sample by sample, and anew after each lesson.
//!
//! Each robot is a witness of a sample of another: the nearest sample it has of the same gesture, against the nearest that it has of any
//! other, says whether a gesture of that name lies there; from afar it says nothing. Witnesses count by the part of their own samples
//! that is taken for true, reckoned in turns with what is true (truth discovery). A robot's own samples are the only ones that no liar can
//! touch: it trusts itself more than anybody, and they are never left out. What nobody contradicts is believed: an honest robot that alone
//! sees from its side loses nothing.

mod config;
mod testimony;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};

use gestalt_protocol::{ClassId, RobotId};

pub use config::PoisonDefence;
use testimony::Nearest;

use crate::geometry::Points;
use crate::sample::{HeldSample, HeldSamples, SetPart};

/// The most samples that are judged, and are witnesses: the newest. Older ones stay what they were taken for.
const JUDGED: usize = 2_000;
/// How much a robot counts as a witness for itself; another counts 1 at most.
const SELF: f64 = 1.5;
/// So many samples of an author are taken for true before any is judged, and half a sample for false.
const PRIOR: f64 = 6.0;
/// Nobody's samples are taken for less likely true than this, nor for more likely than that: who agrees again is believed again.
const RATES: (f64, f64) = (0.2, 0.98);
/// What a witness says at most is the logarithm of 1 against this.
const FAINT: f64 = 0.05;
/// A sample is trained on from this probability on that it is true.
const BAR: f64 = 0.5;
/// So many samples of an author and class are no flood.
const LEAST: usize = 5;
/// Times that truth and authors are reckoned from each other.
const STEPS: usize = 5;

/// What a robot makes of the samples of others.
#[derive(Clone, Debug)]
pub(crate) struct Scrutiny {
    config: PoisonDefence,
    me: RobotId,
    /// The squared distance within which samples say something of each other.
    reach: f32,
    /// The part of each author's samples that is taken for true.
    rates: BTreeMap<RobotId, f64>,
    /// External samples that are trained on, by key.
    heeded: BTreeSet<u64>,
}

impl Scrutiny {
    /// In a feature space of that variance, the natural unit of squared distances, with these samples held.
    pub fn new(config: PoisonDefence, me: RobotId, variance: f64, held: &HeldSamples) -> Self {
        let external = held.iter().filter(|sample| sample.part == SetPart::External);
        let heeded = external.map(|sample| sample.key).collect();
        let mut new = Self { config, me, reach: variance as f32, rates: BTreeMap::new(), heeded };
        new.reckon(held);
        new
    }

    /// Whether a sample is trained on: all that this robot made itself, and those of others that pass.
    pub fn is_trained_on(&self, sample: &HeldSample) -> bool {
        sample.part != SetPart::External || self.is_heeded(sample.key)
    }

    fn is_heeded(&self, key: u64) -> bool {
        self.heeded.contains(&key)
    }

    /// A sample is gone.
    pub fn forget(&mut self, key: u64) {
        self.heeded.remove(&key);
    }

    /// Who says so: what has no author is this robot's own.
    fn witness(&self, sample: &HeldSample) -> RobotId {
        sample.author().unwrap_or(self.me)
    }

    /// The part of an author's samples that is taken for true.
    fn rate(&self, author: RobotId) -> f64 {
        self.rates.get(&author).copied().unwrap_or(PRIOR / (PRIOR + 0.5))
    }

    /// How much a witness counts: whoever is right as often as wrong, not at all.
    fn weight(&self, witness: RobotId) -> f64 {
        if witness == self.me { SELF } else { (2.0 * self.rate(witness) - 1.0).max(0.0) }
    }

    /// The probability that a sample of that author is true.
    fn truth(&self, author: RobotId, testimony: impl Iterator<Item = (RobotId, f64)>) -> f64 {
        let (mut sum, mut weights) = (0.0, 1.0);
        for (witness, evidence) in testimony {
            let weight = self.weight(witness);
            sum += weight * evidence;
            weights += weight;
        }
        let rate = self.rate(author);
        let odds = (rate / (1.0 - rate)).ln() + self.config.agreement * sum / weights;
        1.0 / (1.0 + (-odds).exp())
    }

    /// Whether a sample that has just come is trained on.
    pub fn judge(&mut self, held: &HeldSamples, key: u64) -> bool {
        let Some(sample) = held.get(key).filter(|sample| sample.part == SetPart::External) else {
            return true;
        };
        self.heeded.remove(&key);
        let author = self.witness(sample);
        let mut nearest: BTreeMap<RobotId, Nearest> = BTreeMap::new();
        if self.config.agreement > 0.0 {
            for other in held.iter().rev().take(JUDGED) {
                let witness = self.witness(other);
                if witness != author {
                    let squared = squared_distance(&sample.vector, &other.vector);
                    nearest.entry(witness).or_insert(Nearest::NONE).see(squared, other.class, sample.class);
                }
            }
        }
        let testimony = nearest
            .iter()
            .filter_map(|(witness, nearest)| Some((*witness, nearest.evidence(self.reach, FAINT)?)));
        let heeded = self.truth(author, testimony) >= BAR
            && self.count(held, author, sample.class) < self.bound(held, sample.class);
        if heeded {
            self.heeded.insert(key);
        }
        heeded
    }

    /// How many samples of an author and class are trained on.
    fn count(&self, held: &HeldSamples, author: RobotId, class: ClassId) -> usize {
        let keys = held.part_keys(SetPart::External, class);
        held.with_keys(keys).filter(|s| s.author() == Some(author) && self.is_heeded(s.key)).count()
    }

    /// The most samples of a class that are trained on of one author.
    fn bound(&self, held: &HeldSamples, class: ClassId) -> usize {
        if self.config.influence == 0.0 {
            return usize::MAX;
        }
        let mut counts: BTreeMap<RobotId, usize> = held.authors().map(|(author, _)| (author, 0)).collect();
        counts.insert(self.me, 0);
        for sample in held.with_keys(held.class_keys(class)) {
            if self.is_trained_on(sample) {
                *counts.entry(self.witness(sample)).or_default() += 1;
            }
        }
        let mut counts: Vec<usize> = counts.into_values().collect();
        counts.sort_unstable();
        let middle = counts.get(counts.len() / 2).copied().unwrap_or(0);
        LEAST.max((self.config.influence * middle as f64).ceil() as usize)
    }

    /// Judges all samples anew; gives those that are to be trained on from now on, or no longer.
    pub fn reckon(&mut self, held: &HeldSamples) -> Vec<(u64, bool)> {
        let mut points = Points::default();
        let mut newest: Vec<&HeldSample> = held.iter().rev().take(JUDGED).collect();
        newest.reverse();
        let external: Vec<&HeldSample> =
            newest.iter().copied().filter(|s| s.part == SetPart::External).collect();
        external.iter().for_each(|sample| points.push(sample.key, &sample.vector));
        let mut witnesses: Vec<RobotId> = newest.iter().map(|sample| self.witness(sample)).collect();
        witnesses.sort_unstable();
        witnesses.dedup();
        let slot = |robot: RobotId| witnesses.binary_search(&robot).unwrap_or(0);
        let slots: Vec<usize> = external.iter().map(|s| slot(self.witness(s))).collect();
        let n = witnesses.len();
        let mut nearest = vec![Nearest::NONE; external.len() * n];
        if self.config.agreement > 0.0 {
            for other in &newest {
                let of = slot(self.witness(other));
                points.measure(&other.vector, |place, squared| {
                    if slots[place] != of {
                        nearest[place * n + of].see(squared, other.class, external[place].class);
                    }
                });
            }
        }
        let testimony: Vec<Vec<(RobotId, f64)>> = nearest
            .chunks(n.max(1))
            .map(|row| {
                let said = witnesses.iter().zip(row);
                said.filter_map(|(witness, nearest)| Some((*witness, nearest.evidence(self.reach, FAINT)?)))
                    .collect()
            })
            .collect();
        self.rates.clear();
        let mut truths = vec![0.0; external.len()];
        for _ in 0..STEPS {
            for ((truth, sample), said) in truths.iter_mut().zip(&external).zip(&testimony) {
                *truth = self.truth(self.witness(sample), said.iter().copied());
            }
            let mut sums: BTreeMap<RobotId, (f64, f64)> = BTreeMap::new();
            for (truth, sample) in truths.iter().zip(&external) {
                let (sum, count) = sums.entry(self.witness(sample)).or_default();
                *sum += truth;
                *count += 1.0;
            }
            self.rates = sums
                .into_iter()
                .map(|(author, (sum, count))| {
                    (author, ((PRIOR + sum) / (PRIOR + 0.5 + count)).clamp(RATES.0, RATES.1))
                })
                .collect();
        }
        let before = std::mem::take(&mut self.heeded);
        let mut order: Vec<usize> = (0..external.len()).filter(|i| truths[*i] >= BAR).collect();
        let first = newest.first().map_or(0, |sample| sample.key);
        self.heeded = before.range(..first).copied().collect();
        self.heeded.extend(order.iter().map(|i| external[*i].key));
        if self.config.influence > 0.0 {
            let bounds: BTreeMap<ClassId, usize> =
                held.classes().map(|class| (class, self.bound(held, class))).collect();
            order.sort_by(|a, b| {
                truths[*b].total_cmp(&truths[*a]).then(external[*b].key.cmp(&external[*a].key))
            });
            let mut counts: BTreeMap<(RobotId, ClassId), usize> = BTreeMap::new();
            for i in order {
                let count = counts.entry((self.witness(external[i]), external[i].class)).or_default();
                *count += 1;
                if bounds.get(&external[i].class).is_some_and(|bound| *count > *bound) {
                    self.heeded.remove(&external[i].key);
                }
            }
        }
        let changed: Vec<u64> = before.symmetric_difference(&self.heeded).copied().collect();
        changed
            .into_iter()
            .filter(|key| held.get(*key).is_some())
            .map(|key| (key, self.is_heeded(key)))
            .collect()
    }

    /// Of each other robot: how many of its samples are held, and how many of these are trained on.
    pub fn heeded(&self, held: &HeldSamples) -> Vec<(RobotId, usize, usize)> {
        let mut heeded: BTreeMap<RobotId, usize> = BTreeMap::new();
        for sample in self.heeded.iter().filter_map(|key| held.get(*key)) {
            *heeded.entry(self.witness(sample)).or_default() += 1;
        }
        held.authors().map(|(author, n)| (author, n, heeded.get(&author).copied().unwrap_or(0))).collect()
    }
}

fn squared_distance(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}
