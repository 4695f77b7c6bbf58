//! How far a measured number can be trusted.

use serde::Serialize;

/// The quantile of the standard normal distribution for two-sided 95 %.
const Z: f64 = 1.959_963_984_540_054;

/// A share of trials with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Proportion {
    /// How many trials were hits.
    pub hits: u64,
    /// How many trials there were.
    pub trials: u64,
    /// Their ratio; 0 without trials.
    pub share: f64,
    /// The lower end of the interval.
    pub low: f64,
    /// The upper end of the interval.
    pub high: f64,
}

impl Proportion {
    /// The share with its score interval (Wilson 1927), which holds near 0 and 1 too.
    #[must_use]
    pub fn new(hits: u64, trials: u64) -> Self {
        let measured = gestalt_strategies::Proportion::wilson(hits, trials);
        let (share, low, high) = measured.map_or((0.0, 0.0, 1.0), |p| (p.value, p.low, p.high));
        Self { hits, trials, share, low, high }
    }
}

/// The mean of a few numbers with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Mean {
    /// How many numbers.
    pub n: usize,
    /// Their mean; 0 of none.
    pub mean: f64,
    /// Half the width of the interval; 0 for fewer than two numbers, about which nothing can be said.
    pub half_width: f64,
}

impl Mean {
    /// The mean with its interval by Student's t.
    #[must_use]
    pub fn of(numbers: &[f64]) -> Self {
        let n = numbers.len();
        if n == 0 {
            return Self { n, mean: 0.0, half_width: 0.0 };
        }
        let mean = numbers.iter().sum::<f64>() / n as f64;
        if n == 1 {
            return Self { n, mean, half_width: 0.0 };
        }
        let freedom = (n - 1) as f64;
        let variance = numbers.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / freedom;
        Self { n, mean, half_width: student(freedom) * (variance / n as f64).sqrt() }
    }
}

/// The two-sided 95 % quantile of Student's t: exact for 1 and 2 degrees of freedom, else the expansion in 1/ν
/// (Abramowitz & Stegun 26.7.5), off by less than 1 % from 3 on.
fn student(freedom: f64) -> f64 {
    if freedom < 1.5 {
        return 12.706;
    }
    if freedom < 2.5 {
        return 4.303;
    }
    let (z, v) = (Z, freedom);
    z + (z.powi(3) + z) / (4.0 * v)
        + (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / (96.0 * v * v)
        + (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / (384.0 * v.powi(3))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() < 0.01 * expected.abs().max(0.05), "{found} is not {expected}");
    }

    #[test]
    fn wilson_intervals_are_those_of_the_tables() {
        // R: binom::binom.confint(c(95, 0), c(100, 20), methods = "wilson")
        let p = Proportion::new(95, 100);
        near(p.low, 0.8882);
        near(p.high, 0.9785);
        let none = Proportion::new(0, 20);
        assert_eq!(none.low, 0.0);
        near(none.high, 0.1611);
    }

    #[test]
    fn students_quantiles_are_those_of_the_tables() {
        for (freedom, quantile) in [(1.0, 12.706), (2.0, 4.303), (3.0, 3.182), (9.0, 2.262), (19.0, 2.093)] {
            near(student(freedom), quantile);
        }
    }

    #[test]
    fn one_number_has_no_interval() {
        assert_eq!(Mean::of(&[3.0]), Mean { n: 1, mean: 3.0, half_width: 0.0 });
        let two = Mean::of(&[1.0, 3.0]);
        near(two.mean, 2.0);
        near(two.half_width, 12.706);
    }
}
