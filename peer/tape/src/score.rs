//! How a way to count fares over a run, against what people said and against what happened.

use gestalt_protocol::ClassId;
use gestalt_svm::Proportion;
use serde::Serialize;

use crate::run::Truth;
use crate::what_if::Outcome;

/// The 97.5 % quantile of the normal distribution.
const Z: f64 = 1.959_963_984_540_054;

/// How a way to count fares.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Score {
    /// Rounds of which something was announced.
    pub rounds: u64,
    /// How many of them are decided.
    pub decided: u64,
    /// How many of them end as they did.
    pub agrees: u64,
    /// Rounds of which people said enough to judge it.
    pub known: u64,
    /// How many of these are decided rightly,
    pub right: u64,
    /// how many wrongly,
    pub wrong: u64,
    /// and how many not at all.
    pub undecided: u64,
    /// Rounds of which what happened can be judged too.
    pub paired: u64,
    /// Of these, right where it was not right before,
    pub better: u64,
    /// and not right where it was.
    pub worse: u64,
}

/// A difference of two proportions over the same rounds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PairedDifference {
    /// By how much the accuracy is higher than what happened, `-1.0..=1.0`.
    pub value: f64,
    /// The lower end of its 95 % interval.
    pub low: f64,
    /// The upper end.
    pub high: f64,
    /// How likely at least so uneven a split of the rounds that differ is by chance: McNemar's exact test, two-sided.
    pub p: f64,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Verdict {
    Right,
    Wrong,
    Undecided,
}

/// What people said of it, for as much as it says of that class.
fn judge(truth: Option<Truth>, class: Option<ClassId>) -> Option<Verdict> {
    match (truth?, class) {
        (_, None) => Some(Verdict::Undecided),
        (Truth::Is(is), Some(class)) if is == class => Some(Verdict::Right),
        (Truth::Is(_), Some(_)) => Some(Verdict::Wrong),
        (Truth::IsNot(not), Some(class)) if not == class => Some(Verdict::Wrong),
        (Truth::IsNot(_), Some(_)) => None,
    }
}

impl Score {
    /// Over these rounds.
    #[must_use]
    pub fn of(outcomes: &[Outcome]) -> Self {
        let mut score = Self::default();
        for outcome in outcomes {
            score.rounds += 1;
            score.decided += u64::from(outcome.would.is_some());
            score.agrees += u64::from(outcome.would == outcome.happened);
            let Some(would) = judge(outcome.truth, outcome.would) else { continue };
            score.known += 1;
            match would {
                Verdict::Right => score.right += 1,
                Verdict::Wrong => score.wrong += 1,
                Verdict::Undecided => score.undecided += 1,
            }
            let Some(happened) = judge(outcome.truth, outcome.happened) else { continue };
            let (would, happened) = (would == Verdict::Right, happened == Verdict::Right);
            score.paired += 1;
            score.better += u64::from(would && !happened);
            score.worse += u64::from(happened && !would);
        }
        score
    }

    /// The share of the rounds that people judged which is decided rightly.
    #[must_use]
    pub fn accuracy(&self) -> Option<Proportion> {
        Proportion::wilson(self.right, self.known)
    }

    /// The share of all rounds that is decided at all.
    #[must_use]
    pub fn decisiveness(&self) -> Option<Proportion> {
        Proportion::wilson(self.decided, self.rounds)
    }

    /// The share of all rounds that ends as it did.
    #[must_use]
    pub fn agreement(&self) -> Option<Proportion> {
        Proportion::wilson(self.agrees, self.rounds)
    }

    /// By how much it is better than what happened, round by round. The interval is that of A. Agresti and Y. Min, "Simple improved
    /// confidence intervals for comparing matched proportions", Statistics in Medicine 24 (2005): Wald's, with half a round added to
    /// each of the four cells. `None` where there is no round to compare.
    #[must_use]
    pub fn difference(&self) -> Option<PairedDifference> {
        if self.paired == 0 {
            return None;
        }
        let n = self.paired as f64 + 2.0;
        let (better, worse) = (self.better as f64 + 0.5, self.worse as f64 + 0.5);
        let centre = (better - worse) / n;
        let half = Z * (better + worse - (better - worse).powi(2) / n).sqrt() / n;
        let value = (self.better as f64 - self.worse as f64) / self.paired as f64;
        let (low, high) = ((centre - half).clamp(-1.0, value), (centre + half).clamp(value, 1.0));
        Some(PairedDifference { value, low, high, p: mcnemar(self.better, self.worse) })
    }
}

/// McNemar's exact test: of `a + b` rounds that differ, each side gets one with probability ½. Two-sided, `0.0..=1.0`.
fn mcnemar(a: u64, b: u64) -> f64 {
    let n = a + b;
    let mut log_term = -(n as f64) * std::f64::consts::LN_2;
    let mut tail = 0.0;
    for k in 0..=a.min(b) {
        tail += log_term.exp();
        log_term += ((n - k) as f64).ln() - ((k + 1) as f64).ln();
    }
    (2.0 * tail).min(1.0)
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::{RobotId, RoundId};

    use super::*;

    fn close(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-9, "{found} is not {expected}");
    }

    #[test]
    fn the_test_is_mcnemars() {
        // R: binom.test(c(1, 9))$p.value, c(0, 5), c(12, 8), c(300, 900).
        for ((a, b), p) in
            [((1, 9), 0.021484375), ((0, 5), 0.0625), ((12, 8), 0.503444671630859), ((0, 0), 1.0)]
        {
            close(mcnemar(a, b), p);
            close(mcnemar(b, a), p);
        }
        assert!(mcnemar(300, 900) < 1e-60 && mcnemar(1000, 1000) <= 1.0);
    }

    #[test]
    fn each_round_is_judged_by_what_was_said_of_it_and_by_nothing_else() {
        let round = RoundId { counter: 1, opener: RobotId(1), life: 0 };
        let outcome = |truth, happened: Option<u32>, would: Option<u32>| Outcome {
            round,
            truth,
            happened: happened.map(ClassId),
            would: would.map(ClassId),
        };
        let (is, not) = (Some(Truth::Is(ClassId(3))), Some(Truth::IsNot(ClassId(3))));
        let score = Score::of(&[
            outcome(is, Some(3), Some(3)),
            outcome(is, Some(2), Some(3)),
            outcome(is, Some(3), None),
            outcome(not, Some(3), Some(3)),
            outcome(not, Some(3), Some(1)),
            outcome(None, Some(1), None),
        ]);
        let expected = Score {
            rounds: 6,
            decided: 4,
            agrees: 2,
            known: 4,
            right: 2,
            wrong: 1,
            undecided: 1,
            paired: 4,
            better: 1,
            worse: 1,
        };
        assert_eq!(score, expected);
        let difference = score.difference().unwrap();
        close(difference.value, 0.0);
        // (1.5 − 1.5) / 6 ± 1.96 √3 / 6.
        close(difference.high, Z * 3f64.sqrt() / 6.0);
        close(difference.p, 1.0);
        assert_eq!(Score::of(&[]).difference(), None);
    }
}
