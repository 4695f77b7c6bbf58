//! The support vector machine of one pair of classes, solved from wherever it stands.
//!
//! Sequential minimal optimisation with the working set selection of LIBSVM: R.-E. Fan, P.-H. Chen, C.-J. Lin,
//! "Working set selection using second order information for training support vector machines", JMLR 6 (2005).
//! Written with signed weights β = y·α: 0 ≤ β ≤ C for the first class, −C ≤ β ≤ 0 for the second, Σβ = 0. The
//! negative gradient of the dual is then the residual y − Σ β·K of each sample, whatever its class.

use super::simd::{Greatest, curvature, partner, shift};

/// LIBSVM's stopping tolerance: how far the residuals of two samples may be apart that could be brought together.
pub(super) const TOLERANCE: f32 = 1e-3;
/// The same for a machine that is asked about what was held out and then let go: a sigmoid is fitted to its decisions, which at usual costs a hundredth of the
/// margin hardly moves, and it takes half the steps.
pub(super) const PASSING: f32 = 1e-2;
/// Residuals are kept in f32, and each step of length δ blurs them by about δ · 10⁻⁷. After steps of this length
/// together they are no longer sure to a tenth of the tolerance, and are computed anew.
const BLURRED: f64 = 1000.0;
/// How often they are computed anew before a solution is taken as it is.
const MOST_REFRESHES: usize = 10;

/// The kernel of a sample of the pair, by class and position, with the samples of the first and the second class.
pub(super) trait Rows<'a>: Fn(usize, usize) -> [&'a [f32]; 2] {}
impl<'a, F: Fn(usize, usize) -> [&'a [f32]; 2]> Rows<'a> for F {}

/// The samples of one class of the pair.
#[derive(Clone, Debug, Default)]
struct Side {
    /// β of each sample.
    weights: Vec<f64>,
    /// y − Σ β·K of each sample.
    residuals: Vec<f32>,
    /// 0 where the weight may rise, −∞ where not.
    rise: Vec<f32>,
    /// 0 where the weight may fall, +∞ where not.
    fall: Vec<f32>,
}

/// A machine, and what is needed to go on from it.
#[derive(Clone, Debug, Default)]
pub(super) struct Solution {
    sides: [Side; 2],
    /// ρ: the decision is Σ β·K − ρ, positive for the first class.
    offset: f64,
    /// The length of all steps since the residuals were computed.
    blur: f64,
    /// Whether any sample may have a weight.
    is_loaded: bool,
}

/// The highest residual whose weight may rise, where it is, and the lowest whose weight may fall.
struct Extremes {
    top: f32,
    up: (usize, usize),
    bottom: f32,
}

/// y of the first and the second class.
const LABELS: [f32; 2] = [1.0, -1.0];

impl Solution {
    /// Takes in a sample at the end of a class, with weight 0.
    pub fn insert<'a>(&mut self, side: usize, row: impl FnOnce() -> [&'a [f32]; 2]) {
        let sum = if self.is_loaded { self.sum(row()) } else { 0.0 };
        let residual = f64::from(LABELS[side]) - sum;
        let side = &mut self.sides[side];
        side.weights.push(0.0);
        side.residuals.push(residual as f32);
    }

    /// Takes out a sample; the last of its class takes its place. The weights may no longer sum to 0 then.
    pub fn remove<'a>(&mut self, side: usize, position: usize, row: impl FnOnce() -> [&'a [f32]; 2]) {
        self.release(side, position, row);
        let side = &mut self.sides[side];
        side.weights.swap_remove(position);
        side.residuals.swap_remove(position);
    }

    /// Forgets all weights.
    pub fn clear(&mut self) {
        for (side, label) in self.sides.iter_mut().zip(LABELS) {
            side.weights.fill(0.0);
            side.residuals.fill(label);
        }
        (self.offset, self.blur, self.is_loaded) = (0.0, 0.0, false);
    }

    pub fn weights(&self, side: usize) -> &[f64] {
        &self.sides[side].weights
    }

    pub fn offset(&self) -> f64 {
        self.offset
    }

    /// What the machine says of one of its samples.
    pub fn decision(&self, side: usize, position: usize) -> f64 {
        f64::from(LABELS[side] - self.sides[side].residuals[position]) - self.offset
    }

    /// Solves the problem at that cost, up to the tolerance, for samples that are not held out; those have no weight. Both classes
    /// need such a sample.
    pub fn solve<'a>(
        &mut self,
        (cost, tolerance): (f64, f32),
        rows: &impl Rows<'a>,
        held_out: impl Fn(usize, usize) -> bool,
    ) {
        for side in 0..2 {
            for position in 0..self.sides[side].weights.len() {
                if held_out(side, position) {
                    self.release(side, position, || rows(side, position));
                }
            }
        }
        self.set_bounds(cost, held_out);
        self.balance(cost, rows);
        for _ in 0..MOST_REFRESHES {
            if self.blur > BLURRED {
                self.refresh(rows);
            }
            self.descend((cost, tolerance), rows);
            if self.blur <= BLURRED {
                break;
            }
        }
        self.set_offset();
    }

    /// Takes the weight off a sample.
    fn release<'a>(&mut self, side: usize, position: usize, row: impl FnOnce() -> [&'a [f32]; 2]) {
        let weight = std::mem::take(&mut self.sides[side].weights[position]);
        if weight != 0.0 {
            self.spread(weight, row());
        }
    }

    /// Adds `amount`·K to the residuals: what a weight that falls by so much does to them.
    fn spread(&mut self, amount: f64, row: [&[f32]; 2]) {
        for (side, row) in self.sides.iter_mut().zip(row) {
            for (residual, k) in side.residuals.iter_mut().zip(row) {
                *residual += amount as f32 * k;
            }
        }
        self.blur += amount.abs();
    }

    /// Σ β·K over all samples.
    fn sum(&self, row: [&[f32]; 2]) -> f64 {
        let of_side = |(side, row): (&Side, &[f32])| -> f64 {
            side.weights.iter().zip(row).map(|(&weight, &k)| weight * f64::from(k)).sum()
        };
        self.sides.iter().zip(row).map(of_side).sum()
    }

    /// Computes the residuals anew, in f64.
    fn refresh<'a>(&mut self, rows: &impl Rows<'a>) {
        let mut exact: [Vec<f64>; 2] =
            [0, 1].map(|side| vec![f64::from(LABELS[side]); self.sides[side].weights.len()]);
        for (side, of_side) in self.sides.iter().enumerate() {
            for (position, &weight) in of_side.weights.iter().enumerate().filter(|(_, w)| **w != 0.0) {
                for (exact, row) in exact.iter_mut().zip(rows(side, position)) {
                    for (exact, &k) in exact.iter_mut().zip(row) {
                        *exact -= weight * f64::from(k);
                    }
                }
            }
        }
        for (side, exact) in self.sides.iter_mut().zip(exact) {
            side.residuals.clear();
            side.residuals.extend(exact.into_iter().map(|residual| residual as f32));
        }
        self.blur = 0.0;
    }

    fn set_bounds(&mut self, cost: f64, held_out: impl Fn(usize, usize) -> bool) {
        for (index, side) in self.sides.iter_mut().enumerate() {
            let Side { weights, rise, fall, .. } = side;
            rise.clear();
            fall.clear();
            for (position, &weight) in weights.iter().enumerate() {
                let out = held_out(index, position);
                let (may_rise, may_fall) = movable(index, weight, cost);
                rise.push(if may_rise && !out { 0.0 } else { f32::NEG_INFINITY });
                fall.push(if may_fall && !out { 0.0 } else { f32::INFINITY });
            }
        }
    }

    /// Makes the weights sum to 0 again: moves those that want it most.
    fn balance<'a>(&mut self, cost: f64, rows: &impl Rows<'a>) {
        let mut excess: f64 = self.sides.iter().flat_map(|side| &side.weights).sum();
        while excess.abs() > 1e-12 * cost {
            let (side, position) = if excess > 0.0 { self.lowest() } else { self.highest() };
            let weight = self.sides[side].weights[position];
            let room = if excess > 0.0 { weight - least(side, cost) } else { most(side, cost) - weight };
            if room <= 0.0 {
                break;
            }
            let amount = if room <= excess.abs() { room } else { excess.abs() };
            let fall = amount.copysign(excess);
            self.spread(fall, rows(side, position));
            self.set(side, position, weight - fall, cost);
            excess -= fall;
        }
    }

    /// Takes steps until no two residuals are apart that could be brought together.
    fn descend<'a>(&mut self, (cost, tolerance): (f64, f32), rows: &impl Rows<'a>) {
        let samples = self.sides.iter().map(|side| side.weights.len()).sum::<usize>();
        // A bound on time; what is reached by then is where the next call goes on.
        let most_steps = 100 * samples.max(1000);
        // Nothing moves yet: any row will do.
        let any = rows(0, 0);
        let mut extremes = self.shift(0.0, any, any);
        for _ in 0..most_steps {
            let Extremes { top, up: (up_side, up), bottom } = extremes;
            // Also ends here where nothing may rise, or nothing may fall.
            if top - bottom <= tolerance || !(top - bottom).is_finite() {
                break;
            }
            let row_up = rows(up_side, up);
            let [first, second] = [0, 1].map(|index| {
                let side = &self.sides[index];
                partner(top, &side.residuals, &side.fall, row_up[index])
            });
            let (down_side, down) =
                if second.value > first.value { (1, second.index) } else { (0, first.index) };
            let gap = top - self.sides[down_side].residuals[down];
            let step = f64::from(gap / curvature(row_up[down_side][down]));

            let rising = self.sides[up_side].weights[up];
            let falling = self.sides[down_side].weights[down];
            let (above, below) = (most(up_side, cost) - rising, falling - least(down_side, cost));
            let step = step.min(above).min(below);
            // At a bound exactly, not within rounding of it.
            self.set(up_side, up, if step == above { most(up_side, cost) } else { rising + step }, cost);
            self.set(
                down_side,
                down,
                if step == below { least(down_side, cost) } else { falling - step },
                cost,
            );
            extremes = self.shift(step as f32, row_up, rows(down_side, down));
            self.blur += step;
        }
    }

    /// Subtracts `step`·(up − down) from the residuals.
    fn shift(&mut self, step: f32, up: [&[f32]; 2], down: [&[f32]; 2]) -> Extremes {
        let [(first, lowest), (second, other)] = [0, 1].map(|index| {
            let Side { residuals, rise, fall, .. } = &mut self.sides[index];
            shift(step, residuals, (up[index], down[index]), (rise, fall))
        });
        let (side, Greatest { value, index }) =
            if second.value > first.value { (1, second) } else { (0, first) };
        Extremes { top: value, up: (side, index), bottom: lowest.min(other) }
    }

    fn highest(&self) -> (usize, usize) {
        let value = |side: &Side, at: usize| side.residuals[at] + side.rise[at];
        self.extreme(|a, b| a > b, value)
    }

    fn lowest(&self) -> (usize, usize) {
        let value = |side: &Side, at: usize| side.residuals[at] + side.fall[at];
        self.extreme(|a, b| a < b, value)
    }

    fn extreme(
        &self,
        beats: impl Fn(f32, f32) -> bool,
        value: impl Fn(&Side, usize) -> f32,
    ) -> (usize, usize) {
        let mut best: Option<(f32, (usize, usize))> = None;
        for (index, side) in self.sides.iter().enumerate() {
            for at in 0..side.residuals.len() {
                let value = value(side, at);
                if best.is_none_or(|(so_far, _)| beats(value, so_far)) {
                    best = Some((value, (index, at)));
                }
            }
        }
        best.map_or((0, 0), |(_, place)| place)
    }

    fn set(&mut self, side: usize, position: usize, weight: f64, cost: f64) {
        let (may_rise, may_fall) = movable(side, weight, cost);
        self.is_loaded = true;
        let side = &mut self.sides[side];
        side.weights[position] = weight;
        side.rise[position] = if may_rise { 0.0 } else { f32::NEG_INFINITY };
        side.fall[position] = if may_fall { 0.0 } else { f32::INFINITY };
    }

    /// The residuals of samples on the margin are all −ρ; where there are none, it lies between what the others
    /// allow.
    fn set_offset(&mut self) {
        let (mut sum, mut count) = (0.0, 0.0);
        let (mut top, mut bottom) = (f32::NEG_INFINITY, f32::INFINITY);
        for side in &self.sides {
            for ((&residual, &rise), &fall) in side.residuals.iter().zip(&side.rise).zip(&side.fall) {
                if rise == 0.0 && fall == 0.0 {
                    sum += f64::from(residual);
                    count += 1.0;
                }
                top = top.max(residual + rise);
                bottom = bottom.min(residual + fall);
            }
        }
        self.offset = -if count > 0.0 { sum / count } else { (f64::from(top) + f64::from(bottom)) / 2.0 };
    }
}

fn least(side: usize, cost: f64) -> f64 {
    if side == 0 { 0.0 } else { -cost }
}

fn most(side: usize, cost: f64) -> f64 {
    if side == 0 { cost } else { 0.0 }
}

/// Whether a weight may rise, and fall.
fn movable(side: usize, weight: f64, cost: f64) -> (bool, bool) {
    (weight < most(side, cost), weight > least(side, cost))
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::super::samples::{KernelMatrix, Key};
    use super::super::tests::{generator, vector};
    use super::*;

    /// How far a solution is from the optimum: the gap between residuals that could be brought together, in f64 from
    /// the vectors; and whether all weights are allowed.
    fn violation(solution: &Solution, samples: &KernelMatrix, gamma: f64, cost: f64) -> f64 {
        let all: Vec<(usize, &[f32], f64)> = (0..2)
            .flat_map(|side| {
                let weights = solution.weights(side).iter();
                samples
                    .of(side)
                    .iter()
                    .zip(weights)
                    .map(move |(sample, weight)| (side, &sample.vector[..], *weight))
            })
            .collect();
        let sum: f64 = all.iter().map(|(_, _, weight)| weight).sum();
        assert!(sum.abs() < 1e-6 * cost, "weights sum to {sum}");
        let (mut top, mut bottom) = (f64::NEG_INFINITY, f64::INFINITY);
        for (side, x, weight) in &all {
            let (low, high) = if *side == 0 { (0.0, cost) } else { (-cost, 0.0) };
            assert!((low..=high).contains(weight), "{weight} of class {side}");
            let kernel = |y: &[f32]| -> f64 {
                (-gamma * x.iter().zip(y).map(|(x, y)| f64::from(x - y).powi(2)).sum::<f64>()).exp()
            };
            let decision: f64 = all.iter().map(|(_, y, weight)| weight * kernel(y)).sum();
            let residual = if *side == 0 { 1.0 } else { -1.0 } - decision;
            top = if *weight < high { top.max(residual) } else { top };
            bottom = if *weight > low { bottom.min(residual) } else { bottom };
        }
        top - bottom
    }

    #[test]
    fn whatever_came_and_went_the_solution_is_optimal() {
        let gamma = 0.4;
        for (seed, cost) in [(1, 0.1), (2, 10.0), (3, 10.0), (4, 1e4)] {
            let mut rng = generator(seed);
            let mut samples = KernelMatrix::new(2, gamma);
            let mut solution = Solution::default();
            let mut next = 0;
            for round in 0..30 {
                for _ in 0..rng.random_range(1..8_u64) {
                    let side = rng.random_range(0..2_u64) as usize;
                    let count = samples.of(side).len();
                    if count > 3 && rng.random_bool(0.3) {
                        let position = rng.random_range(0..count as u64) as usize;
                        let place = super::super::samples::Place { class: side, position };
                        let row = || [0, 1].map(|class| samples.row(place, class));
                        solution.remove(side, position, row);
                        samples.remove(place);
                    } else {
                        // Some are in one place, with different classes.
                        let x = if next % 5 == 4 { vec![0.5; 5] } else { vector(side, &mut rng) };
                        let place = samples.insert(Key::Inserted(next), side, x.into());
                        let row = || [0, 1].map(|class| samples.row(place, class));
                        solution.insert(side, row);
                        next += 1;
                    }
                }
                if samples.of(0).is_empty() || samples.of(1).is_empty() {
                    continue;
                }
                let rows = |side: usize, position: usize| -> [&[f32]; 2] {
                    let place = super::super::samples::Place { class: side, position };
                    [0, 1].map(|class| samples.row(place, class))
                };
                solution.solve((cost, TOLERANCE), &rows, |_, _| false);
                let violation = violation(&solution, &samples, f64::from(gamma), cost);
                // Little more than the tolerance, also where great weights blur the residuals.
                assert!(violation < 1.03e-3, "C = {cost}, round {round}: {violation}");
            }
        }
    }
}
