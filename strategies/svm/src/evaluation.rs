//! How good a classifier is on samples it has not seen.

use gestalt_protocol::ClassId;
use serde::Serialize;

/// Bins of the calibration error over the confidence, each 1/15 wide.
pub const CALIBRATION_BINS: usize = 15;

/// A proportion with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Proportion {
    /// The observed proportion, `0.0..=1.0`.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

impl Proportion {
    /// The proportion of `successes` in `trials`, with the score interval of E. B. Wilson, "Probable inference,
    /// the law of succession, and statistical inference", JASA 22 (1927). `None` where nothing was tried.
    #[must_use]
    pub fn wilson(successes: u64, trials: u64) -> Option<Self> {
        // The 97.5 % quantile of the normal distribution.
        const Z: f64 = 1.959_963_984_540_054;
        if trials == 0 {
            return None;
        }
        let n = trials as f64;
        let p = successes as f64 / n;
        let scale = 1.0 / (1.0 + Z * Z / n);
        let centre = scale * (p + Z * Z / (2.0 * n));
        let half = scale * Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
        Some(Self { value: p, low: (centre - half).clamp(0.0, p), high: (centre + half).clamp(p, 1.0) })
    }
}

/// The outcomes of a classifier on labelled samples, collected one by one.
#[derive(Clone, Debug, PartialEq)]
pub struct Evaluation {
    /// Row: true class; column: class judged most probable.
    confusion: Vec<Vec<u64>>,
    bins: [Bin; CALIBRATION_BINS],
    loss: f64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Bin {
    count: u64,
    right: u64,
    confidence: f64,
}

impl Evaluation {
    /// No outcome yet, over so many classes.
    #[must_use]
    pub fn new(classes: usize) -> Self {
        Self {
            confusion: vec![vec![0; classes]; classes],
            bins: [Bin::default(); CALIBRATION_BINS],
            loss: 0.0,
        }
    }

    /// Adds one outcome: the true class and the probability the classifier gave to each. Where two classes are
    /// equally probable the smaller is taken as the answer.
    ///
    /// # Panics
    /// When `truth` is no class of this evaluation or `probabilities` has not one value per class.
    pub fn record(&mut self, truth: ClassId, probabilities: &[f64]) {
        assert_eq!(probabilities.len(), self.confusion.len(), "one probability per class");
        let mut answer = 0;
        for (class, probability) in probabilities.iter().enumerate() {
            if *probability > probabilities[answer] {
                answer = class;
            }
        }
        let confidence = probabilities[answer];
        self.confusion[truth.index()][answer] += 1;
        let bin = ((confidence * CALIBRATION_BINS as f64) as usize).min(CALIBRATION_BINS - 1);
        let bin = &mut self.bins[bin];
        bin.count += 1;
        bin.right += u64::from(answer == truth.index());
        bin.confidence += confidence;
        self.loss -= probabilities[truth.index()].max(1e-12).ln();
    }

    /// Takes in the outcomes of another evaluation over the same classes.
    ///
    /// # Panics
    /// When it is over another number of classes.
    pub fn append(&mut self, other: &Self) {
        assert_eq!(other.confusion.len(), self.confusion.len(), "the same classes");
        for (count, more) in self.confusion.iter_mut().flatten().zip(other.confusion.iter().flatten()) {
            *count += more;
        }
        for (bin, more) in self.bins.iter_mut().zip(&other.bins) {
            bin.count += more.count;
            bin.right += more.right;
            bin.confidence += more.confidence;
        }
        self.loss += other.loss;
    }

    /// Outcomes so far.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.confusion.iter().flatten().sum()
    }

    /// How often a sample of class `truth` was judged to be `answer`, for all pairs: row `truth`, column `answer`.
    #[must_use]
    pub fn confusion(&self) -> &[Vec<u64>] {
        &self.confusion
    }

    /// The part judged right; `None` before the first outcome.
    #[must_use]
    pub fn accuracy(&self) -> Option<Proportion> {
        let right = (0..self.confusion.len()).map(|class| self.confusion[class][class]).sum();
        Proportion::wilson(right, self.count())
    }

    /// Of the samples of this class, the part judged to be of it; `None` where there were none.
    #[must_use]
    pub fn recall(&self, class: ClassId) -> Option<Proportion> {
        let row = &self.confusion[class.index()];
        Proportion::wilson(row[class.index()], row.iter().sum())
    }

    /// Of the samples judged to be of this class, the part that are; `None` where none was.
    #[must_use]
    pub fn precision(&self, class: ClassId) -> Option<Proportion> {
        let column = self.confusion.iter().map(|row| row[class.index()]);
        Proportion::wilson(self.confusion[class.index()][class.index()], column.sum())
    }

    /// Expected calibration error, `0.0..=1.0`: the mean gap between confidence and accuracy over 15 equal bins of
    /// the confidence, weighted by their counts. C. Guo et al., "On calibration of modern neural networks" (2017).
    /// `None` before the first outcome.
    #[must_use]
    pub fn calibration_error(&self) -> Option<f64> {
        let gaps = self.bins.iter().map(|bin| (bin.right as f64 - bin.confidence).abs());
        (self.count() > 0).then(|| gaps.sum::<f64>() / self.count() as f64)
    }

    /// Mean −ln P(true class), in nats; `None` before the first outcome.
    #[must_use]
    pub fn log_loss(&self) -> Option<f64> {
        (self.count() > 0).then(|| self.loss / self.count() as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_is_wilsons() {
        // R: prop.test(81, 263, correct = FALSE)$conf.int, and binom::binom.wilson(0, 10), (10, 10).
        for (successes, trials, low, high) in
            [(81, 263, 0.255_3, 0.366_2), (0, 10, 0.0, 0.277_5), (10, 10, 0.722_5, 1.0)]
        {
            let p = Proportion::wilson(successes, trials).unwrap();
            assert!((p.low - low).abs() < 1e-4 && (p.high - high).abs() < 1e-4, "{p:?}");
        }
        assert_eq!(Proportion::wilson(0, 0), None);
    }

    fn evaluation() -> Evaluation {
        let mut e = Evaluation::new(3);
        e.record(ClassId(0), &[0.9, 0.1, 0.0]);
        e.record(ClassId(0), &[0.2, 0.7, 0.1]);
        e.record(ClassId(1), &[0.1, 0.8, 0.1]);
        e.record(ClassId(1), &[0.05, 0.9, 0.05]);
        e
    }

    #[test]
    fn rows_are_the_truth_and_columns_the_answer() {
        let e = evaluation();
        assert_eq!(e.confusion(), [[1, 1, 0], [0, 2, 0], [0, 0, 0]]);
        assert_eq!(e.accuracy().unwrap().value, 0.75);
        assert_eq!(e.recall(ClassId(0)).unwrap().value, 0.5);
        assert_eq!(e.precision(ClassId(1)).unwrap().value, 2.0 / 3.0);
        assert_eq!((e.recall(ClassId(2)), e.precision(ClassId(2))), (None, None));
    }

    #[test]
    fn two_evaluations_together_are_one_of_all_their_outcomes() {
        let mut both = evaluation();
        let mut other = Evaluation::new(3);
        let outcomes = [(2, [0.1, 0.2, 0.7]), (0, [0.3, 0.6, 0.1])];
        let mut all = evaluation();
        for (truth, probabilities) in outcomes {
            other.record(ClassId(truth), &probabilities);
            all.record(ClassId(truth), &probabilities);
        }
        both.append(&other);
        assert_eq!((both.confusion(), both.count()), (all.confusion(), 6));
        assert_eq!(both.accuracy(), all.accuracy());
        let close = |a: Option<f64>, b: Option<f64>| (a.unwrap() - b.unwrap()).abs() < 1e-12;
        assert!(close(both.calibration_error(), all.calibration_error()));
        assert!(close(both.log_loss(), all.log_loss()));
    }

    #[test]
    fn calibration_error_is_the_weighted_gap_per_bin() {
        // Bins of 1/15: {.9, .9} two right of 1.8; {.7} wrong; {.8} right of .8.
        let expected = (0.2 + 0.7 + 0.2) / 4.0;
        assert!((evaluation().calibration_error().unwrap() - expected).abs() < 1e-12);
    }

    #[test]
    fn certainty_that_is_right_has_no_error_and_no_loss() {
        let mut e = Evaluation::new(2);
        e.record(ClassId(1), &[0.0, 1.0]);
        assert_eq!((e.calibration_error(), e.log_loss()), (Some(0.0), Some(0.0)));
    }
}
