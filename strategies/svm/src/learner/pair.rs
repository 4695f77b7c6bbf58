//! What a learner knows of one pair of classes.

use super::few::LeftOut;
use super::samples::{KernelMatrix, Place};
use super::solution::{PASSING, Solution, TOLERANCE};
use crate::head::{Losses, blended};
use crate::sigmoid::Sigmoid;

/// The machine of two classes, and its calibration.
#[derive(Debug)]
pub(super) struct Pair {
    pub classes: [usize; 2],
    pub solution: Solution,
    pub sigmoid: Sigmoid,
    /// What was lost over samples of either class, by its part in the odds beside the head for few showings.
    pub losses: [Losses; 2],
    /// Samples that came or went since the calibration.
    pub changes: usize,
}

impl Pair {
    pub fn new(classes: [usize; 2]) -> Self {
        let sigmoid = Sigmoid::fit_at_border(&[]);
        Self { classes, solution: Solution::default(), sigmoid, losses: [Losses::default(); 2], changes: 0 }
    }

    /// Takes in the sample that now stands at the end of its class.
    pub fn insert(&mut self, samples: &KernelMatrix, place: Place) {
        let Some(side) = self.side(place) else { return };
        self.solution.insert(side, || row(samples, self.classes, place));
        self.changes += 1;
    }

    /// Takes out a sample that still stands in its place.
    pub fn remove(&mut self, samples: &KernelMatrix, place: Place) {
        let Some(side) = self.side(place) else { return };
        self.solution.remove(side, place.position, || row(samples, self.classes, place));
        self.changes += 1;
    }

    /// Brings the machine up to date.
    pub fn solve(&mut self, samples: &KernelMatrix, cost: f64) {
        if self.is_empty(samples) {
            self.solution.clear();
            return;
        }
        let classes = self.classes;
        self.solution.solve((cost, TOLERANCE), &rows(samples, classes), |_, _| false);
    }

    /// Fits the sigmoid to what machines say of samples that they have not seen, and weighs the machine against the head for few showings by what both
    /// say of those. `folds` by class, of `count` folds; `left_out` is what the head says, by class.
    pub fn calibrate(
        &mut self,
        samples: &KernelMatrix,
        cost: f64,
        (folds, count): (&[Vec<usize>], usize),
        left_out: &[Vec<LeftOut>],
    ) {
        let sides = self.held_out(samples, cost, folds, count);
        let values = sides.iter().zip([true, false]);
        let values = values.flat_map(|(values, first)| values.iter().flatten().map(move |f| (*f, first)));
        self.sigmoid = Sigmoid::fit_at_border(&values.collect::<Vec<_>>());
        self.weigh(&sides, left_out);
        self.changes = 0;
    }

    /// What each share would lose over what was held out, by side.
    fn weigh(&mut self, held_out: &[Vec<Option<f64>>; 2], left_out: &[Vec<LeftOut>]) {
        let [first, second] = self.classes;
        self.losses = [Losses::default(); 2];
        for (side, values) in held_out.iter().enumerate() {
            let both = values.iter().zip(left_out.get(self.classes[side]).into_iter().flatten());
            let both = both.filter_map(|(value, left)| Some(((*value)?, left.as_ref()?)));
            for (value, (weight, logs)) in both {
                let machine = self.sigmoid.probability(value);
                let log_odds = logs[first] - logs[second];
                self.losses[side].add(*weight, |share| {
                    let p = blended(machine, log_odds, share);
                    if side == 0 { p } else { 1.0 - p }
                });
            }
        }
    }

    /// For each sample, by class, the decision of a machine that has not seen its fold; none where that leaves a class
    /// without samples.
    fn held_out(
        &self,
        samples: &KernelMatrix,
        cost: f64,
        folds: &[Vec<usize>],
        count: usize,
    ) -> [Vec<Option<f64>>; 2] {
        let rows = rows(samples, self.classes);
        let folds = self.classes.map(|class| folds[class].as_slice());
        let mut decisions = folds.map(|folds| vec![None; folds.len()]);
        let mut machine = Solution::default();
        for fold in 0..count {
            if folds.iter().any(|folds| folds.iter().all(|of| *of == fold)) {
                continue;
            }
            machine.clone_from(&self.solution);
            machine.solve((cost, PASSING), &rows, |side, position| folds[side][position] == fold);
            for (side, decisions) in decisions.iter_mut().enumerate() {
                for (position, decision) in decisions.iter_mut().enumerate() {
                    if folds[side][position] == fold {
                        *decision = Some(machine.decision(side, position));
                    }
                }
            }
        }
        decisions
    }

    /// The changes since the calibration as a part of the samples.
    pub fn staleness(&self, samples: &KernelMatrix) -> f64 {
        let count: usize = self.classes.iter().map(|class| samples.of(*class).len()).sum();
        self.changes as f64 / count as f64
    }

    /// Takes all its samples for changed since the calibration.
    pub fn grow_stale(&mut self, samples: &KernelMatrix) {
        self.changes = self.classes.iter().map(|class| samples.of(*class).len()).sum();
    }

    /// Whether one of the classes has no samples.
    pub fn is_empty(&self, samples: &KernelMatrix) -> bool {
        self.classes.iter().any(|class| samples.of(*class).is_empty())
    }

    fn side(&self, place: Place) -> Option<usize> {
        self.classes.iter().position(|class| *class == place.class)
    }
}

/// The kernel of the samples of a pair with each other.
fn rows<'a>(samples: &'a KernelMatrix, classes: [usize; 2]) -> impl Fn(usize, usize) -> [&'a [f32]; 2] {
    move |side, position| row(samples, classes, Place { class: classes[side], position })
}

/// The kernel of a sample with those of a pair.
fn row(samples: &KernelMatrix, classes: [usize; 2], place: Place) -> [&[f32]; 2] {
    classes.map(|class| samples.row(place, class))
}

#[cfg(test)]
mod tests {
    use rand::RngExt;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;

    use super::super::folds::folds;
    use super::super::samples::{KernelRow, Key};
    use super::*;

    const COST: f64 = 10.0;

    /// Each sample is a showing of its own.
    fn own(key: Key) -> u64 {
        let Key::Inserted(key) = key else { unreachable!() };
        key
    }

    fn vectors(count: usize, seed: u64) -> Vec<Vec<f32>> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..count).map(|_| (0..5).map(|_| rng.random_range(-1.0..1.0)).collect()).collect()
    }

    /// Classes in turn, a little apart; those of `keep`.
    fn trained(vectors: &[Vec<f32>], keep: impl Fn(u64) -> bool) -> (KernelMatrix, Pair) {
        let (mut samples, mut pair) = (KernelMatrix::new(2, 0.5), Pair::new([0, 1]));
        for (key, vector) in (0..).zip(vectors).filter(|(key, _)| keep(*key)) {
            let class = key as usize % 2;
            let mut vector = vector.clone();
            vector[0] += class as f32;
            let place = samples.insert(Key::Inserted(key), class, vector.into());
            pair.insert(&samples, place);
        }
        pair.solve(&samples, COST);
        (samples, pair)
    }

    #[test]
    fn a_held_out_decision_is_that_of_a_machine_which_never_met_the_sample() {
        let vectors = vectors(80, 1);
        let (samples, pair) = trained(&vectors, |_| true);
        let folds: Vec<Vec<usize>> = [0, 1].map(|class| folds(samples.of(class), 5, own)).to_vec();
        let held_out = pair.held_out(&samples, COST, &folds, 5);
        for fold in 0..5 {
            let fold_of = |key: u64| {
                let place = samples.place(Key::Inserted(key)).unwrap();
                folds[place.class][place.position]
            };
            let (others, alone) = trained(&vectors, |key| fold_of(key) != fold);
            for (key, _) in (0_u64..).zip(&vectors).filter(|(key, _)| fold_of(*key) == fold) {
                let place = samples.place(Key::Inserted(key)).unwrap();
                let kernel = |other: &KernelRow| {
                    let other = samples.place(other.key).unwrap();
                    f64::from(samples.row(place, other.class)[other.position])
                };
                let sum = |class: usize| -> f64 {
                    let weights = alone.solution.weights(class).iter();
                    others.of(class).iter().zip(weights).map(|(other, weight)| weight * kernel(other)).sum()
                };
                let expected = sum(0) + sum(1) - alone.solution.offset();
                let found = held_out[place.class][place.position].unwrap();
                assert!((found - expected).abs() < 1e-2, "{found} for {expected}");
            }
        }
    }
}
