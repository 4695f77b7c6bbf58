//! The calibration of machines by the decision values of samples that they have not seen.

use crate::calibration::Calibration;
use crate::machine::pairs;
use crate::sigmoid::Sigmoid;

/// Held-out samples that are all judged right would ask for an infinite exponent.
const SHARPEST: f64 = 3.0;

impl Calibration {
    /// Fits to the decision values of samples that the machines have not seen, with their true classes.
    pub fn fit(decisions: &[Vec<f64>], truths: &[usize], classes: usize) -> Self {
        let sigmoids = pairs(classes).enumerate().map(|(pair, (i, j))| {
            let of_pair = decisions.iter().zip(truths).filter(|(_, truth)| **truth == i || **truth == j);
            Sigmoid::fit(&of_pair.map(|(row, truth)| (row[pair], *truth == i)).collect::<Vec<_>>())
        });
        let mut calibration = Self { sigmoids: sigmoids.collect(), sharpness: 1.0 };
        let logs: Vec<Vec<f64>> = decisions
            .iter()
            .map(|row| calibration.probabilities(row, classes).iter().map(|p| p.ln()).collect())
            .collect();
        calibration.sharpness = sharpness(&logs, truths);
        calibration
    }
}

/// The s that makes the true classes most likely under P(k) ∝ exp(s·log pₖ). The log-likelihood is concave in s,
/// so its slope is bisected.
fn sharpness(logs: &[Vec<f64>], truths: &[usize]) -> f64 {
    let slope = |s: f64| -> f64 {
        let of_sample = logs.iter().zip(truths).map(|(logs, &truth)| {
            let greatest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let (mut sum, mut mean) = (0.0, 0.0);
            for log in logs {
                let weight = (s * (log - greatest)).exp();
                sum += weight;
                mean += weight * log;
            }
            logs[truth] - mean / sum
        });
        of_sample.sum()
    };
    let (mut low, mut high) = (1.0 / SHARPEST, SHARPEST);
    for _ in 0..30 {
        // Halving the ratio, not the difference: 1/2 and 2 are as far from 1.
        let middle = (low * high).sqrt();
        if slope(middle) > 0.0 { low = middle } else { high = middle }
    }
    (low * high).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn confidence_is_raised_to_what_is_right() {
        // Says 60 % each time, and is right in 9 of 10: 0.6^s / (0.6^s + 0.4^s) = 0.9.
        let logs: Vec<Vec<f64>> = (0..10).map(|_| vec![0.6_f64.ln(), 0.4_f64.ln()]).collect();
        let truths: Vec<usize> = (0..10).map(|i| usize::from(i == 0)).collect();
        let expected = 9.0_f64.ln() / 1.5_f64.ln();
        assert!(expected > SHARPEST, "{expected}");
        assert!((sharpness(&logs, &truths) - SHARPEST).abs() < 1e-6, "as far as it goes");

        let truths: Vec<usize> = (0..10).map(|i| usize::from(i < 3)).collect();
        let expected = (7.0_f64 / 3.0).ln() / 1.5_f64.ln();
        assert!((sharpness(&logs, &truths) - expected).abs() < 1e-6, "{expected}");
    }

    #[test]
    fn sharpening_keeps_the_order_and_the_sum() {
        let sigmoids = vec![Sigmoid { a: -1.0, b: 0.0 }; 3];
        let decisions = [0.5, 1.5, 0.3];
        let plain = Calibration { sigmoids: sigmoids.clone(), sharpness: 1.0 }.probabilities(&decisions, 3);
        let sharp = Calibration { sigmoids, sharpness: 2.0 }.probabilities(&decisions, 3);
        assert!(sharp[0] > plain[0] && sharp[0] > sharp[1] && sharp[1] > sharp[2], "{plain:?} {sharp:?}");
        assert!((sharp.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }
}
