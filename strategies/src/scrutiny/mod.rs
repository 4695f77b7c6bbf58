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

mod claim;
mod config;
mod testimony;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};

use gestalt_protocol::{ClassId, RobotId};

pub(crate) use claim::Claim;
pub use config::PoisonDefence;
use testimony::Nearest;

use crate::geometry::Points;

/// The most samples that are judged, and are witnesses: the newest. Older ones stay what they were taken for.
pub(crate) const JUDGED: usize = 2_000;
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
    /// The samples of others that are not trained on, by key.
    left_out: BTreeSet<u64>,
    /// What was said since it was reckoned concerns more than the samples that came.
    is_due: bool,
}

impl Scrutiny {
    /// In a feature space of that variance, the natural unit of squared distances.
    pub fn new(config: PoisonDefence, me: RobotId, variance: f64) -> Self {
        Self {
            config,
            me,
            reach: variance as f32,
            rates: BTreeMap::new(),
            left_out: BTreeSet::new(),
            is_due: true,
        }
    }

    /// Whether a sample is not trained on.
    pub fn leaves_out(&self, key: u64) -> bool {
        self.left_out.contains(&key)
    }

    /// A sample is gone.
    pub fn forget(&mut self, key: u64) {
        self.left_out.remove(&key);
    }

    /// What is held shows another gesture, or more is known of it.
    pub fn doubt(&mut self) {
        self.is_due = true;
    }

    /// Whether all is to be judged anew.
    pub fn is_due(&self) -> bool {
        self.is_due
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

    /// Judges a sample that has just come, or shows another gesture now, among those that are judged, the newest first. If it is none of these, it
    /// stays what it was taken for.
    pub fn judge(&mut self, held: &[Claim<'_>], key: u64) {
        let Some(claim) = held.iter().find(|claim| claim.key == key && claim.is_of_others) else { return };
        // Until it is found true, it counts for nothing.
        self.left_out.insert(key);
        let testimony = self.testimony(held, &[claim]).into_iter().flatten();
        if self.truth(claim.author, testimony) >= BAR
            && self.count(held, claim) < self.bound(held, claim.class)
        {
            self.left_out.remove(&key);
        }
    }

    /// How many samples of the same author and class are trained on.
    fn count(&self, held: &[Claim<'_>], claim: &Claim<'_>) -> usize {
        let alike = held.iter().filter(|other| (other.author, other.class) == (claim.author, claim.class));
        alike.filter(|other| !self.leaves_out(other.key)).count()
    }

    /// The most samples of a class that are trained on of one author.
    fn bound(&self, held: &[Claim<'_>], class: ClassId) -> usize {
        if self.config.influence == 0.0 {
            return usize::MAX;
        }
        let mut counts: BTreeMap<RobotId, usize> = BTreeMap::from([(self.me, 0)]);
        for claim in held {
            let count = counts.entry(claim.author).or_default();
            *count += usize::from(claim.class == class && !self.leaves_out(claim.key));
        }
        let mut counts: Vec<usize> = counts.into_values().collect();
        counts.sort_unstable();
        let middle = counts.get(counts.len() / 2).copied().unwrap_or(0);
        LEAST.max((self.config.influence * middle as f64).ceil() as usize)
    }

    /// Judges these samples anew, the newest first; gives those that are to be trained on from now on, or no longer.
    pub fn reckon(&mut self, held: &[Claim<'_>]) -> Vec<u64> {
        self.is_due = false;
        let others: Vec<&Claim<'_>> = held.iter().rev().filter(|claim| claim.is_of_others).collect();
        let testimony = self.testimony(held, &others);
        let truths = self.truths(&others, &testimony);

        let before = self.left_out.clone();
        let mut order: Vec<usize> = Vec::new();
        for (i, claim) in others.iter().enumerate() {
            if truths[i] >= BAR {
                self.left_out.remove(&claim.key);
                order.push(i);
            } else {
                self.left_out.insert(claim.key);
            }
        }
        if self.config.influence > 0.0 {
            let classes: BTreeSet<ClassId> = held.iter().map(|claim| claim.class).collect();
            let bounds: BTreeMap<ClassId, usize> =
                classes.into_iter().map(|class| (class, self.bound(held, class))).collect();
            order.sort_by(|a, b| truths[*b].total_cmp(&truths[*a]).then(others[*b].key.cmp(&others[*a].key)));
            let mut counts: BTreeMap<(RobotId, ClassId), usize> = BTreeMap::new();
            for claim in order.into_iter().map(|i| others[i]) {
                let count = counts.entry((claim.author, claim.class)).or_default();
                *count += 1;
                if bounds.get(&claim.class).is_some_and(|bound| *count > *bound) {
                    self.left_out.insert(claim.key);
                }
            }
        }
        before.symmetric_difference(&self.left_out).copied().collect()
    }

    /// What each witness says of each of these samples of others.
    fn testimony(&self, held: &[Claim<'_>], others: &[&Claim<'_>]) -> Vec<Vec<(RobotId, f64)>> {
        let mut points = Points::default();
        others.iter().for_each(|claim| points.push(claim.key, claim.vector));
        let mut witnesses: Vec<RobotId> = held.iter().map(|claim| claim.author).collect();
        witnesses.sort_unstable();
        witnesses.dedup();
        let slot = |robot: RobotId| witnesses.binary_search(&robot).unwrap_or(0);
        let slots: Vec<usize> = others.iter().map(|claim| slot(claim.author)).collect();
        let n = witnesses.len();
        let mut nearest = vec![Nearest::NONE; others.len() * n];
        if self.config.agreement > 0.0 {
            for claim in held {
                let of = slot(claim.author);
                points.measure(claim.vector, |place, squared| {
                    if slots[place] != of {
                        nearest[place * n + of].see(squared, claim.class, others[place].class);
                    }
                });
            }
        }
        let said = |row: &[Nearest]| {
            let said = witnesses.iter().zip(row);
            said.filter_map(|(witness, nearest)| Some((*witness, nearest.evidence(self.reach, FAINT)?)))
                .collect()
        };
        nearest.chunks(n.max(1)).map(said).collect()
    }

    /// Reckons how likely each sample is true, and each author's samples are, in turns.
    fn truths(&mut self, others: &[&Claim<'_>], testimony: &[Vec<(RobotId, f64)>]) -> Vec<f64> {
        self.rates.clear();
        let mut truths = vec![0.0; others.len()];
        for _ in 0..STEPS {
            let mut sums: BTreeMap<RobotId, (f64, f64)> = BTreeMap::new();
            for ((truth, claim), said) in truths.iter_mut().zip(others).zip(testimony) {
                *truth = self.truth(claim.author, said.iter().copied());
                let (sum, count) = sums.entry(claim.author).or_default();
                *sum += *truth;
                *count += 1.0;
            }
            let rate = |sum: f64, count: f64| (PRIOR + sum) / (PRIOR + 0.5 + count);
            self.rates = sums
                .into_iter()
                .map(|(author, (sum, count))| (author, rate(sum, count).clamp(RATES.0, RATES.1)))
                .collect();
        }
        truths
    }
}
