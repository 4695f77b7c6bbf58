//! From distances to a likelihood ratio.

use super::Score;

/// What is believed of offset, distance and lead before anything is known, and how firmly: a normal prior.
const PRIOR: [f64; 3] = [-0.2, 2.0, -2.0];
const SPREAD: [f64; 3] = [1.0, 1.0, 1.0];

/// The lead where only one class is there to be near to: that at which it says nothing.
const NO_LEAD: f64 = 0.3;

/// A view of what is known, as it is expected to be before any was left out: as far from its class as its class scatters.
const EXPECTED: (Score, f64) = (Score { distance: 0.0, lead: None }, 1.0);

/// No more showings than this count, of the known and of the unknown: what is left out is not quite what will be shown.
const MOST: f64 = 60.0;

/// The logarithm of P(x | unknown) / P(x | known) by these weights, unbounded.
pub(super) fn log_ratio(weights: &[f64; 3], score: Score) -> f64 {
    terms(score).iter().zip(weights).map(|(x, w)| x * w).sum()
}

fn terms(score: Score) -> [f64; 3] {
    [1.0, score.distance.clamp(-5.0, 5.0), score.lead.unwrap_or(NO_LEAD)]
}

/// The weights that tell what was left out as unknown from what was left out as known, and how far they may be believed either way: −ln P for what
/// is unknown to look known at all, after so many showings that might have, and the other way round.
///
/// Logistic regression with both sides weighing alike, so that its logit is a likelihood ratio; Newton's method.
pub(super) fn calibrate(known: &[(Score, f64)], unknown: &[(Score, f64)]) -> ([f64; 3], [f64; 2]) {
    let total = |scores: &[(Score, f64)]| scores.iter().map(|(_, weight)| weight).sum::<f64>();
    let known = &*[known, &[EXPECTED]].concat();
    let (of_known, of_unknown) = (total(known), total(unknown));
    let bounds = [(1.0 + of_unknown).ln(), (1.0 + of_known).ln()];
    let each = of_known.min(of_unknown).min(MOST);
    let mut weights = PRIOR;
    if each <= 0.0 {
        return (weights, bounds);
    }
    let sides = [(known, 0.0, each / of_known), (unknown, 1.0, each / of_unknown)];
    for _ in 0..20 {
        let mut gradient = [0.0; 3];
        let mut hessian = [[0.0; 3]; 3];
        for k in 0..3 {
            gradient[k] = (PRIOR[k] - weights[k]) / (SPREAD[k] * SPREAD[k]);
            hessian[k][k] = 1.0 / (SPREAD[k] * SPREAD[k]);
        }
        for (scores, target, share) in sides {
            for (score, weight) in scores {
                let x = terms(*score);
                let p = 1.0 / (1.0 + (-log_ratio(&weights, *score)).exp());
                let weight = weight * share;
                for j in 0..3 {
                    gradient[j] += weight * (target - p) * x[j];
                    for k in 0..3 {
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
    (weights, bounds)
}

/// Solves three equations of a positive definite matrix, by Gauss.
fn solve(mut a: [[f64; 3]; 3], mut b: [f64; 3]) -> [f64; 3] {
    for k in 0..3 {
        for row in k + 1..3 {
            let factor = a[row][k] / a[k][k];
            let pivot = a[k];
            a[row].iter_mut().zip(pivot).skip(k).for_each(|(value, of_pivot)| *value -= factor * of_pivot);
            b[row] -= factor * b[k];
        }
    }
    for k in (0..3).rev() {
        let rest: f64 = (k + 1..3).map(|column| a[k][column] * b[column]).sum();
        b[k] = (b[k] - rest) / a[k][k];
    }
    b
}
