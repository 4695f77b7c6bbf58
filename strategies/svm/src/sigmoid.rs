//! From the decision value of one pair to a probability.

use serde::{Deserialize, Serialize};

/// P(first class of the pair | decision value f) = 1 / (1 + exp(a·f + b)).
///
/// J. Platt, "Probabilistic outputs for support vector machines" (1999). Fit it on decision values of samples
/// that the machine has **not** been trained on: those of training samples are pushed to the margin, and a
/// sigmoid through them promises more than the machine keeps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Sigmoid {
    pub a: f64,
    pub b: f64,
}

impl Sigmoid {
    /// The probability of the first class, `0.0..=1.0`.
    #[must_use]
    pub fn probability(self, decision: f64) -> f64 {
        let t = self.a * decision + self.b;
        // The form that cannot overflow, on either side.
        if t >= 0.0 { (-t).exp() / (1.0 + (-t).exp()) } else { 1.0 / (1.0 + t.exp()) }
    }

    /// Maximum-likelihood fit to decision values and whether each belongs to the first class, with Platt's
    /// targets (n₊+1)/(n₊+2) and 1/(n₋+2) in place of 1 and 0, which keep it finite on separable values.
    ///
    /// The machine's two margins, +1 and −1, count as one more sample each: with very few held-out values,
    /// chance could otherwise turn the sigmoid over.
    ///
    /// Newton's method with backtracking: H.-T. Lin, C.-J. Lin, R. C. Weng, "A note on Platt's probabilistic
    /// outputs for support vector machines", Machine Learning 68 (2007).
    #[cfg(feature = "offline")]
    pub fn fit(held_out: &[(f64, bool)]) -> Self {
        let (positive, negative) = sizes(held_out);
        Self { a: 0.0, b: ((negative + 2.0) / (positive + 2.0)).ln() }.climb(held_out, 0.0)
    }

    /// The same fit where b is taken to be about 0, give or take the logarithm of the ratio of the class sizes.
    ///
    /// A machine says 0 where both classes are as likely, but leans to the larger one. Of classes of one size, b
    /// could tell little but the chance that dealt the samples: it would move the border between them with each
    /// sample that comes or goes.
    pub fn fit_at_border(held_out: &[(f64, bool)]) -> Self {
        /// Least deviation of b, so that its inverse is finite.
        const LEAST: f64 = 1e-3;
        let (positive, negative) = sizes(held_out);
        let deviation = ((negative + 2.0) / (positive + 2.0)).ln();
        Self { a: 0.0, b: 0.0 }.climb(held_out, 1.0 / deviation.powi(2).max(LEAST * LEAST))
    }

    /// The fit from a start on, with a normal prior of mean 0 and this precision on b.
    fn climb(self, held_out: &[(f64, bool)], precision: f64) -> Self {
        const MAX_ITERATIONS: usize = 100;
        const MIN_STEP: f64 = 1e-10;
        const RIDGE: f64 = 1e-12;
        const TOLERANCE: f64 = 1e-5;

        let mut values = held_out.to_vec();
        values.extend([(1.0, true), (-1.0, false)]);
        let (positive, negative) = sizes(&values);
        let high = (positive + 1.0) / (positive + 2.0);
        let low = 1.0 / (negative + 2.0);
        let target = |first: bool| if first { high } else { low };
        let loss = |a: f64, b: f64| -> f64 {
            let of_samples: f64 = values
                .iter()
                .map(|&(f, first)| {
                    let (t, z) = (target(first), a * f + b);
                    if z >= 0.0 { t * z + (-z).exp().ln_1p() } else { (t - 1.0) * z + z.exp().ln_1p() }
                })
                .sum();
            of_samples + 0.5 * precision * b * b
        };

        let Self { mut a, mut b } = self;
        let mut best = loss(a, b);
        for _ in 0..MAX_ITERATIONS {
            let (mut h11, mut h22, mut h21, mut g1, mut g2) =
                (RIDGE, RIDGE + precision, 0.0, 0.0, precision * b);
            for &(f, first) in &values {
                let p = Self { a, b }.probability(f);
                let (d1, d2) = (target(first) - p, p * (1.0 - p));
                h11 += f * f * d2;
                h22 += d2;
                h21 += f * d2;
                g1 += f * d1;
                g2 += d1;
            }
            if g1.abs() < TOLERANCE && g2.abs() < TOLERANCE {
                break;
            }
            let determinant = h11 * h22 - h21 * h21;
            let (da, db) = (-(h22 * g1 - h21 * g2) / determinant, -(h11 * g2 - h21 * g1) / determinant);
            let slope = g1 * da + g2 * db;
            let mut step = 1.0;
            let improved = loop {
                let (next_a, next_b) = (a + step * da, b + step * db);
                let next = loss(next_a, next_b);
                if next < best + 1e-4 * step * slope {
                    (a, b, best) = (next_a, next_b, next);
                    break true;
                }
                step /= 2.0;
                if step < MIN_STEP {
                    break false;
                }
            };
            if !improved {
                break;
            }
        }
        Self { a, b }
    }
}

/// How many values are of the first class, and of the second.
fn sizes(values: &[(f64, bool)]) -> (f64, f64) {
    let positive = values.iter().filter(|(_, first)| *first).count() as f64;
    (positive, values.len() as f64 - positive)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_finds_the_sigmoid_that_labels_were_drawn_from() {
        // 2,000 values on a grid; at each, the expected part of 20 labels is positive.
        let truth = Sigmoid { a: -1.5, b: 0.5 };
        let values: Vec<(f64, bool)> = (0..100)
            .flat_map(|i| {
                let f = f64::from(i) / 12.5 - 4.0;
                let positive = (truth.probability(f) * 20.0).round() as i32;
                (0..20).map(move |label| (f, label < positive))
            })
            .collect();
        let fitted = Sigmoid::fit(&values);
        assert!((fitted.a - truth.a).abs() < 0.1 && (fitted.b - truth.b).abs() < 0.1, "{fitted:?}");
    }

    #[test]
    fn separable_values_stay_short_of_certainty() {
        let values: Vec<(f64, bool)> = (0..20).map(|i| (f64::from(i % 2) * 4.0 - 2.0, i % 2 == 1)).collect();
        let p = Sigmoid::fit(&values).probability(2.0);
        assert!((0.85..0.99).contains(&p), "{p}");
    }

    #[test]
    fn a_few_unlucky_values_do_not_turn_it_over() {
        let fitted = Sigmoid::fit(&[(-0.1, true), (-0.2, true), (0.1, false), (0.2, false)]);
        assert!(fitted.probability(1.0) > fitted.probability(-1.0), "{fitted:?}");
    }

    #[test]
    fn extreme_values_do_not_overflow() {
        let sigmoid = Sigmoid { a: -1e12, b: 0.0 };
        assert_eq!((sigmoid.probability(1e12), sigmoid.probability(-1e12)), (1.0, 0.0));
    }

    #[test]
    fn the_border_moves_for_classes_of_different_size_only() {
        // Each class about its margin, but a third of the first on the other side.
        let value = |i: usize, first: bool| {
            let noise = (i % 7) as f64 / 7.0;
            if first && !i.is_multiple_of(3) { 0.5 + noise } else { -0.5 - noise }
        };
        let of = |first: usize, second: usize| -> Vec<(f64, bool)> {
            let first = (0..first).map(|i| (value(i, true), true));
            first.chain((0..second).map(|i| (value(i, false), false))).collect()
        };
        let (equal, unequal) = (of(60, 60), of(60, 20));
        assert!(Sigmoid::fit_at_border(&equal).b.abs() < 1e-3, "{:?}", Sigmoid::fit_at_border(&equal));
        assert!(Sigmoid::fit(&equal).b.abs() > 0.2, "{:?}", Sigmoid::fit(&equal));
        let (border, free) = (Sigmoid::fit_at_border(&unequal), Sigmoid::fit(&unequal));
        assert!(border.b / free.b > 0.5, "{border:?} and {free:?}");
    }
}
