//! The features that tell most about the class, by what knowing them spares.

use gestalt_protocol::ClassId;
use serde::{Deserialize, Serialize};

/// By which measure features are ranked.
///
/// J. R. Quinlan, "Induction of decision trees", Machine Learning 1 (1986). A feature is cut into ten bins of equal
/// frequency; equal values stay together. H is the entropy in bits, over the samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ranking {
    /// H(class) − H(class | bin).
    InformationGain,
    /// That gain / H(bin). As Quinlan advises, features of at least average gain come before all others: a feature
    /// that is almost constant has next to no H(bin) to divide by.
    GainRatio,
}

/// How many bins a feature is cut into.
const BINS: usize = 10;

/// What one feature tells.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Score {
    gain: f64,
    ratio: f64,
}

/// The indices of the `keep` best features of these samples, best first; equal ones in their own order. All rows are
/// of one length.
pub(crate) fn best(samples: &[(&[f32], ClassId)], ranking: Ranking, keep: usize) -> Vec<u32> {
    let width = samples.first().map_or(0, |(features, _)| features.len());
    let scores: Vec<Score> = (0..width).map(|feature| score(samples, feature)).collect();
    let average = scores.iter().map(|score| score.gain).sum::<f64>() / width.max(1) as f64;
    let rank = |score: &Score| match ranking {
        Ranking::InformationGain => (true, score.gain),
        // A hair below the average is rounding.
        Ranking::GainRatio => (score.gain >= average - 1e-12, score.ratio),
    };
    let mut order: Vec<u32> = (0..width as u32).collect();
    order.sort_by(|a, b| {
        let (a, b) = (rank(&scores[*a as usize]), rank(&scores[*b as usize]));
        b.0.cmp(&a.0).then(b.1.total_cmp(&a.1))
    });
    order.truncate(keep.max(1));
    order
}

fn score(samples: &[(&[f32], ClassId)], feature: usize) -> Score {
    let mut values: Vec<(f32, ClassId)> =
        samples.iter().map(|(features, class)| (features[feature], *class)).collect();
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let classes = samples.iter().map(|(_, class)| class.index() + 1).max().unwrap_or(0);
    let mut counts = vec![vec![0_u32; classes]; BINS];
    let mut bin = 0;
    for (place, (value, class)) in values.iter().enumerate() {
        if place == 0 || *value != values[place - 1].0 {
            bin = place * BINS / values.len();
        }
        counts[bin][class.index()] += 1;
    }
    let in_bin: Vec<u32> = counts.iter().map(|bin| bin.iter().sum()).collect();
    let of_class: Vec<u32> = (0..classes).map(|class| counts.iter().map(|bin| bin[class]).sum()).collect();
    let total = values.len().max(1) as f64;
    let left: f64 = counts.iter().zip(&in_bin).map(|(bin, n)| f64::from(*n) / total * entropy(bin)).sum();
    let gain = (entropy(&of_class) - left).max(0.0);
    let split = entropy(&in_bin);
    Score { gain, ratio: if split > 0.0 { gain / split } else { 0.0 } }
}

/// −Σ p log₂ p of the shares that these counts are.
fn entropy(counts: &[u32]) -> f64 {
    let total: f64 = counts.iter().map(|n| f64::from(*n)).sum();
    let shares = counts.iter().filter(|n| **n > 0).map(|n| f64::from(*n) / total);
    -shares.map(|p| p * p.log2()).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten samples, five of each of two classes; each feature is a column.
    fn samples(columns: &[[f32; 10]]) -> Vec<(Vec<f32>, ClassId)> {
        (0..10).map(|i| (columns.iter().map(|column| column[i]).collect(), ClassId((i / 5) as u32))).collect()
    }

    fn of(columns: &[[f32; 10]], feature: usize) -> Score {
        let samples = samples(columns);
        let samples: Vec<(&[f32], ClassId)> =
            samples.iter().map(|(f, class)| (f.as_slice(), *class)).collect();
        score(&samples, feature)
    }

    fn ranked(columns: &[[f32; 10]], ranking: Ranking) -> Vec<u32> {
        let samples = samples(columns);
        let samples: Vec<(&[f32], ClassId)> =
            samples.iter().map(|(f, class)| (f.as_slice(), *class)).collect();
        best(&samples, ranking, columns.len())
    }

    /// Says everything, in two values.
    const HALVES: [f32; 10] = [0., 0., 0., 0., 0., 1., 1., 1., 1., 1.];
    /// Says everything too, in ten values.
    const STEPS: [f32; 10] = [0., 1., 2., 3., 4., 5., 6., 7., 8., 9.];
    /// Tells one sample from the rest.
    const ONE: [f32; 10] = [1., 0., 0., 0., 0., 0., 0., 0., 0., 0.];
    const NOTHING: [f32; 10] = [7.; 10];
    /// Four of five right on one side, four of five on the other.
    const MOSTLY: [f32; 10] = [0., 0., 0., 0., 1., 0., 1., 1., 1., 1.];

    #[test]
    fn gain_and_ratio_are_those_computed_by_hand() {
        let near = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        // One bit of class, all of it told; H(bin) = 1 for two halves, log2 10 for ten bins of one.
        near(of(&[HALVES], 0).gain, 1.0);
        near(of(&[HALVES], 0).ratio, 1.0);
        near(of(&[STEPS], 0).gain, 1.0);
        near(of(&[STEPS], 0).ratio, 1.0 / 10.0_f64.log2());
        // 1 − .9 · H(4/9, 5/9) = 1 − .9 · .9910761; H(.1, .9) = .4689956.
        near(of(&[ONE], 0).gain, 0.108_031_5);
        near(of(&[ONE], 0).ratio, 0.108_031_5 / 0.468_995_6);
        // 1 − H(.2, .8) = 1 − .7219281, over H(.5, .5) = 1.
        near(of(&[MOSTLY], 0).gain, 0.278_071_9);
        assert_eq!(of(&[NOTHING], 0), Score { gain: 0.0, ratio: 0.0 });
    }

    #[test]
    fn the_ratio_prefers_few_values_where_the_gain_does_not_care() {
        let columns = [NOTHING, MOSTLY, STEPS, HALVES];
        assert_eq!(ranked(&columns, Ranking::InformationGain), [2, 3, 1, 0]);
        // MOSTLY is below the average gain of .57, so it stays behind STEPS; among the others the ratio decides.
        assert_eq!(ranked(&columns, Ranking::GainRatio), [3, 2, 1, 0]);
    }
}
