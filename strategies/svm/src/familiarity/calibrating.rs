//! From distances to a likelihood ratio.

use super::Score;
use super::scatter::Scores;

/// How many numbers tell: an offset, the distance, the lead and the margin.
pub(super) const TERMS: usize = 4;

/// What is believed of them before anything is known, and how firmly: a normal prior. Without a discriminant there is no margin.
const PRIOR: [f64; TERMS] = [-0.2, 2.0, -2.0, 0.0];
const SPREAD: [f64; TERMS] = [1.0, 1.0, 1.0, 1.0];
/// The same with a margin. What is far from all is unknown, however surely it is one of them if it is any: no gesture that is left out may unteach that.
const PRIOR_WITH_MARGIN: [f64; TERMS] = [0.5, 1.5, -1.0, -0.5];
const SPREAD_WITH_MARGIN: [f64; TERMS] = [1.0, 0.4, 1.0, 0.3];

/// The lead where only one class is there to be near to: that at which it says nothing.
const NO_LEAD: f64 = 0.3;

/// A view of what is known, as it is expected to be before any was left out: as far from its class as its class scatters.
const EXPECTED: (Score, f64) = (Score { distance: 0.0, lead: None, margin: None }, 1.0);

/// The margin where there is none: that of a view that is known, but not for sure.
const NO_MARGIN: f64 = 1.0;

/// What a margin is worth, and beyond what none is worth more: logarithms of the discriminant promise more than they keep.
const WORTH: f64 = 0.25;
const GREATEST: f64 = 4.0;

/// No more showings than this count, of the known and of the unknown: what is left out is not quite what will be shown.
const MOST: f64 = 60.0;

/// The logarithm of P(x | unknown) / P(x | known) by these weights, unbounded.
pub(super) fn log_ratio(weights: &[f64; TERMS], score: Score) -> f64 {
    terms(score).iter().zip(weights).map(|(x, w)| x * w).sum()
}

fn terms(score: Score) -> [f64; TERMS] {
    let margin = score.margin.map_or(NO_MARGIN, |margin| (WORTH * margin).clamp(0.0, GREATEST));
    [1.0, score.distance.clamp(-5.0, 5.0), score.lead.unwrap_or(NO_LEAD), margin]
}

/// How distances are read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Calibrated {
    /// The weights that tell what was left out as unknown, or lies between gestures, from what was left out as known.
    pub any: [f64; TERMS],
    /// Those that tell what was left out as unknown alone.
    pub gesture: [f64; TERMS],
    /// How far they may be believed either way: −ln P for what is unknown to look known at all, after so many showings that might have, and the other way round.
    pub bounds: [f64; 2],
}

impl Calibrated {
    /// By what was left out as known and as unknown; and by what lies between gestures, where there are margins.
    pub fn by(known: &[(Score, f64)], unknown: &[(Score, f64)], between: Option<&Scores>) -> Self {
        let known = &*[known, &[EXPECTED]].concat();
        let bounds = [(1.0 + total(unknown)).ln(), (1.0 + total(known)).ln()];
        let by_margin = between.is_some();
        let gesture = calibrate(known, unknown, &[], by_margin);
        let any = between.map_or(gesture, |between| calibrate(known, unknown, between, by_margin));
        Self { any, gesture, bounds }
    }
}

fn total(scores: &[(Score, f64)]) -> f64 {
    scores.iter().map(|(_, weight)| weight).sum()
}

/// Logistic regression with both sides weighing alike, so that its logit is a likelihood ratio; Newton's method.
fn calibrate(
    known: &[(Score, f64)],
    unknown: &[(Score, f64)],
    between: &[(Score, f64)],
    by_margin: bool,
) -> [f64; TERMS] {
    let (of_known, of_unknown, of_between) = (total(known), total(unknown), total(between));
    let each = of_known.min(of_unknown).min(MOST);
    let (prior, spread) = if by_margin { (PRIOR_WITH_MARGIN, SPREAD_WITH_MARGIN) } else { (PRIOR, SPREAD) };
    let mut weights = prior;
    if each <= 0.0 {
        return weights;
    }
    // Other gestures weigh twice as much as what is none.
    let (gestures, none) = if of_between > 0.0 { (each / 1.5, each / 3.0) } else { (each, 0.0) };
    let sides = [
        (known, 0.0, each / of_known),
        (unknown, 1.0, gestures / of_unknown),
        (between, 1.0, none / f64::max(of_between, 1e-9)),
    ];
    // Where there is no margin it has no weight.
    let terms_used = if by_margin { TERMS } else { TERMS - 1 };
    for _ in 0..20 {
        let mut gradient = [0.0; TERMS];
        let mut hessian = [[0.0; TERMS]; TERMS];
        for k in 0..TERMS {
            gradient[k] = (prior[k] - weights[k]) / (spread[k] * spread[k]);
            hessian[k][k] = 1.0 / (spread[k] * spread[k]);
        }
        for (scores, target, share) in sides {
            for (score, weight) in scores {
                let x = terms(*score);
                let p = 1.0 / (1.0 + (-log_ratio(&weights, *score)).exp());
                let weight = weight * share;
                for j in 0..terms_used {
                    gradient[j] += weight * (target - p) * x[j];
                    for k in 0..terms_used {
                        hessian[j][k] += weight * p * (1.0 - p) * x[j] * x[k];
                    }
                }
            }
        }
        let step = solve(hessian, gradient);
        // Farther it need not go at once: the logit is convex, and the prior holds it.
        let longest = step.iter().fold(0.0_f64, |longest, s| longest.max(s.abs()));
        let scale = if longest > 1.0 { 1.0 / longest } else { 1.0 };
        weights.iter_mut().zip(step).for_each(|(weight, step)| *weight += scale * step);
        if longest < 1e-9 {
            break;
        }
    }
    weights
}

/// Solves equations of a positive definite matrix, by Gauss.
fn solve(mut a: [[f64; TERMS]; TERMS], mut b: [f64; TERMS]) -> [f64; TERMS] {
    for k in 0..TERMS {
        for row in k + 1..TERMS {
            let factor = a[row][k] / a[k][k];
            let pivot = a[k];
            a[row].iter_mut().zip(pivot).skip(k).for_each(|(value, of_pivot)| *value -= factor * of_pivot);
            b[row] -= factor * b[k];
        }
    }
    for k in (0..TERMS).rev() {
        let rest: f64 = (k + 1..TERMS).map(|column| a[k][column] * b[column]).sum();
        b[k] = (b[k] - rest) / a[k][k];
    }
    b
}
