//! How far a measured number can be trusted.

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Means of equal numbers lie nearer to each other than this, and those that differ do not.
const ALIKE: f64 = 1e-9;

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

    /// The share over seeds, of the hits and trials of each. Trials of one seed may depend on each other, as rounds do in which robots learn: of as
    /// many independent ones as the scatter of the seeds lets there be (a jackknife of their ratio) it is the score interval, with Student's t.
    /// Of a single seed it is that of [`Proportion::new`].
    #[must_use]
    pub fn over_seeds(seeds: impl IntoIterator<Item = (u64, u64)>) -> Self {
        let seeds: Vec<(u64, u64)> = seeds.into_iter().filter(|(_, trials)| *trials > 0).collect();
        let (hits, trials) = seeds.iter().fold((0, 0), |(h, t), (hits, trials)| (h + hits, t + trials));
        let all = Self::new(hits, trials);
        if seeds.len() < 2 {
            return all;
        }
        let without = seeds.iter().map(|(h, t)| (hits - h) as f64 / (trials - t) as f64).collect::<Vec<_>>();
        let t = student((seeds.len() - 1) as f64);
        let (low, high) = score_interval(all.share, trials as f64, jackknifed(&without), t);
        Self { low, high, ..all }
    }
}

/// The score interval of a share of so many trials, or of fewer, as many as would scatter as was found.
fn score_interval(share: f64, trials: f64, found: f64, t: f64) -> (f64, f64) {
    let expected = share * (1.0 - share) / trials;
    let n = if found > expected { trials * expected / found } else { trials };
    let z = t.powi(2) / n;
    let centre = (share + z / 2.0) / (1.0 + z);
    let half = (z * (share * (1.0 - share) + z / 4.0)).sqrt() / (1.0 + z);
    ((centre - half).max(0.0), (centre + half).min(1.0))
}

/// The variance of what was measured of several seeds, from the same measured without each of them (Quenouille 1956, Tukey 1958).
fn jackknifed(without: &[f64]) -> f64 {
    let n = without.len() as f64;
    let mean = without.iter().sum::<f64>() / n;
    without.iter().map(|one| (one - mean).powi(2)).sum::<f64>() * (n - 1.0) / n
}

/// The mean of a few numbers with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Mean {
    /// How many numbers.
    pub n: usize,
    /// Their mean; 0 of none, which means nothing.
    pub mean: f64,
    /// Half the width of the interval; 0 for fewer than two numbers, about which nothing can be said.
    pub half_width: f64,
}

impl Mean {
    /// The mean of such of these means as are of anything: a run in which nothing was decided says nothing about how
    /// long decisions take.
    #[must_use]
    pub fn of_means(means: impl IntoIterator<Item = Self>) -> Self {
        let measured = means.into_iter().filter(|mean| mean.n > 0).map(|mean| mean.mean);
        Self::of(&measured.collect::<Vec<_>>())
    }

    /// The mean of such of these shares as are of any trials.
    #[must_use]
    pub fn of_shares(shares: impl IntoIterator<Item = Proportion>) -> Self {
        let measured = shares.into_iter().filter(|share| share.trials > 0).map(|share| share.share);
        Self::of(&measured.collect::<Vec<_>>())
    }

    /// The mean and its interval with so many decimals, for a table; of a single number there is no interval, and of none a dash.
    #[must_use]
    pub fn decimals(self, decimals: usize) -> String {
        self.written(format!("{:.decimals$}", self.mean), 1.0, decimals)
    }

    /// The same of shares, in percent.
    #[must_use]
    pub fn percent(self) -> String {
        self.written(format!("{:.1}", 100.0 * self.mean), 100.0, 1)
    }

    /// The same of differences of shares, in points. Where none differs from another there is no interval: their scatter says nothing.
    #[must_use]
    pub fn points(self) -> String {
        let mean = format!("{:+.1}", 100.0 * self.mean);
        match self {
            Self { n: 2.., half_width, .. } if half_width < ALIKE => format!("{mean} in each"),
            _ => self.written(mean, 100.0, 1),
        }
    }

    /// The interval of the mean of shares of that many trials each, which stays within 0 and 1 and has a width where all are alike: the score interval with
    /// Student's t, of as many independent trials as the scatter of the shares lets there be. Of a single share it has none.
    #[must_use]
    pub fn interval_of(self, trials: usize) -> (f64, f64) {
        if self.n < 2 {
            return (self.mean, self.mean);
        }
        let t = student((self.n - 1) as f64);
        let (all, found) = ((self.n * trials.max(1)) as f64, (self.half_width / t).powi(2));
        score_interval(self.mean, all, found, t)
    }

    /// The mean of shares of that many trials each, in percent, with that interval.
    #[must_use]
    pub fn percent_of(self, trials: usize) -> String {
        if self.n < 2 {
            return self.percent();
        }
        let (low, high) = self.interval_of(trials);
        format!("{:.1} [{:.1}, {:.1}]", 100.0 * self.mean, 100.0 * low, 100.0 * high)
    }

    /// What was measured of several seeds together, with its interval by a jackknife, from the same measured without each of them.
    pub(super) fn by_jackknife(all: f64, without: &[f64]) -> Self {
        let n = without.len();
        let half_width = if n < 2 { 0.0 } else { student((n - 1) as f64) * jackknifed(without).sqrt() };
        Self { n, mean: all, half_width }
    }

    fn written(self, mean: String, scale: f64, decimals: usize) -> String {
        match self.n {
            0 => "–".to_owned(),
            1 => mean,
            _ => format!("{mean} ± {:.decimals$}", scale * self.half_width),
        }
    }

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

/// The two-sided 95 % quantile of Student's t, for one degree of freedom or more.
fn student(freedom: f64) -> f64 {
    let t = StudentsT::new(0.0, 1.0, freedom).expect("the degrees of freedom are above 0");
    t.inverse_cdf(0.975)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() < 0.01 * expected.abs().max(0.05), "{found} is not {expected}");
    }

    #[test]
    fn of_one_number_no_interval_is_shown() {
        let shown = |numbers: &[f64]| {
            let mean = Mean::of(numbers);
            [mean.decimals(2), mean.percent(), mean.points()]
        };
        assert_eq!(shown(&[0.5]), ["0.50", "50.0", "+50.0"]);
        assert_eq!(shown(&[0.25, 0.75]), ["0.50 ± 3.18", "50.0 ± 317.7", "+50.0 ± 317.7"]);
        assert_eq!(shown(&[]), ["–"; 3]);
        assert_eq!(Mean::of(&[0.5, 0.5]).points(), "+50.0 in each");
        // Whose mean, in numbers of 64 bits, is none of them.
        assert_eq!(Mean::of(&[0.1; 3]).points(), "+10.0 in each");
        let shares = [Proportion::new(0, 0), Proportion::new(1, 2)];
        assert_eq!(Mean::of_shares(shares), Mean::of(&[0.5]));
    }

    #[test]
    fn shares_that_are_all_alike_are_no_certainty_and_none_is_beyond_0_and_100() {
        let of = |shares: &[f64], trials| Mean::of(shares).percent_of(trials);
        // As many trials in each seed: what `over_seeds` says of hits and trials.
        let all = Proportion::over_seeds([(60, 60); 20]);
        assert_eq!(of(&[1.0; 20], 60), format!("100.0 [{:.1}, 100.0]", 100.0 * all.low));
        let Proportion { low, high, .. } = Proportion::over_seeds([(8, 10); 5]);
        assert_eq!(of(&[0.8; 5], 10), format!("80.0 [{:.1}, {:.1}]", 100.0 * low, 100.0 * high));
        let Proportion { low, high, .. } = Proportion::over_seeds([(10, 10), (9, 10), (10, 10), (4, 10)]);
        assert_eq!(of(&[1.0, 0.9, 1.0, 0.4], 10), format!("82.5 [{:.1}, {:.1}]", 100.0 * low, 100.0 * high));
        assert_eq!([of(&[0.5], 10), of(&[], 10)], ["50.0", "–"]);
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
    fn a_share_over_seeds_is_as_sure_as_seeds_are_alike() {
        // All seeds alike: rounds are independent, and it is Wilson's interval with the t of five seeds in place of 1.96.
        let alike = Proportion::over_seeds([(8, 10); 5]);
        assert_eq!((alike.hits, alike.trials, alike.share), (40, 50, 0.8));
        // z = 2.776445: (p + z²/2n ± z √(p(1 − p)/n + z²/4n²)) / (1 + z²/n)
        near(alike.low, 0.6083);
        near(alike.high, 0.9115);
        // All rounds of a seed come to the same: there are as many trials as seeds.
        let whole = Proportion::over_seeds([(10, 10), (10, 10), (10, 10), (10, 10), (0, 10)]);
        assert_eq!(whole.share, alike.share);
        assert!(whole.high - whole.low > 2.0 * (alike.high - alike.low), "{whole:?}");
        let Proportion { low, high, .. } = Proportion::over_seeds([(20, 20); 20]);
        assert_eq!(high, 1.0);
        near(low, 0.9892);
        assert_eq!(Proportion::over_seeds([(8, 10), (0, 0)]), Proportion::new(8, 10));
        assert_eq!(Proportion::over_seeds([]), Proportion::new(0, 0));
    }

    #[test]
    fn a_jackknife_of_means_is_students_interval() {
        let numbers = [0.3, 0.5, 0.1, 0.7];
        let without = [1.3 / 3.0, 1.1 / 3.0, 1.5 / 3.0, 0.9 / 3.0];
        let (found, expected) = (Mean::by_jackknife(0.4, &without), Mean::of(&numbers));
        assert!((found.half_width - expected.half_width).abs() < 1e-9, "{found:?}");
        assert_eq!(Mean::by_jackknife(0.4, &[0.0]).half_width, 0.0);
    }

    #[test]
    fn students_quantiles_are_those_of_the_tables() {
        // R: qt(.975, c(1, 2, 3, 9, 19, 99))
        for (freedom, quantile) in [
            (1.0, 12.706205),
            (2.0, 4.302653),
            (3.0, 3.182446),
            (9.0, 2.262157),
            (19.0, 2.093024),
            (99.0, 1.984217),
        ] {
            let found = student(freedom);
            assert!((found - quantile).abs() < 1e-5, "{freedom}: {found} is not {quantile}");
        }
    }

    #[test]
    fn what_was_not_measured_is_no_zero() {
        let means = [Mean::of(&[4.0]), Mean::of(&[]), Mean::of(&[5.0, 7.0])];
        let all = Mean::of_means(means);
        assert_eq!((all.n, all.mean), (2, 5.0));
        assert_eq!(Mean::of_means([Mean::of(&[])]).n, 0);
    }

    #[test]
    fn one_number_has_no_interval() {
        assert_eq!(Mean::of(&[3.0]), Mean { n: 1, mean: 3.0, half_width: 0.0 });
        let two = Mean::of(&[1.0, 3.0]);
        near(two.mean, 2.0);
        near(two.half_width, 12.706);
    }
}
