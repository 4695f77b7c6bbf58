//! From the evidence of many robots to one distribution over the gestures.
//!
//! All sums run in the order given (a ballot gives [`RobotId`](gestalt_protocol::RobotId) order) in `f64`, and ties
//! go to the smaller class, so that robots of one kind with the same votes get the same bits. Robots of different kinds may
//! differ in the last ones: exponentials and logarithms are those of the platform.

use gestalt_protocol::{ClassId, FusionRule, Pool};

use crate::alike::{sharpness, strength, voices};

/// What a set of votes amounts to.
#[derive(Clone, Debug, PartialEq)]
pub struct Fusion {
    /// The fused probability of each class, each in `0.0..=1.0`, summing to 1.
    pub probabilities: Vec<f64>,
    /// The place of the likeliest class; of equals the smaller.
    pub top: ClassId,
    /// By how much the top class leads the second, in units of the most that one robot can add to that lead
    /// (`2c` of the sum for the log pools, one vote for majority, one probability for the mean). A margin above `f` stands
    /// whatever `f` of the robots said.
    pub margin: f64,
}

impl Fusion {
    /// The probability of the likeliest class.
    ///
    /// # Panics
    /// If [`top`](Self::top) is the place of no class.
    #[must_use]
    pub fn greatest(&self) -> f64 {
        self.probabilities[self.top.index()]
    }

    /// Whether it is over so many classes, and every value is one that a decision may carry.
    pub(crate) fn is_sound(&self, classes: usize) -> bool {
        self.probabilities.len() == classes
            && self.probabilities.iter().all(|p| (0.0..=1.0).contains(p))
            && self.top.index() < classes
            && self.margin >= 0.0
    }
}

/// Fuses one row of centred log-evidence per robot, each of `classes` values, after clipping it to ±`clip`.
///
/// With ℓ the clipped evidence of a robot, p its softmax and H the entropy, the total of class k is
/// - majority: the number of robots with arg max ℓ = k; P is the share of the robots that have one. Who finds two classes equally likely
///   abstains;
/// - mean of probabilities: Σ p(k); P is the mean (the linear opinion pool);
/// - log pool: Σ ℓ(k); P is the softmax (Genest & Zidek 1986, external Bayes, equal weights of 1);
/// - confidence-weighted: Σ (1 − H(p) / ln K) ℓ(k); P is the softmax;
/// - correlated pool: Σ ℓ(k); P is the softmax of β times that, with the β of [`CorrelatedPool`](crate::CorrelatedPool) before any round was confirmed.
///
/// `None` when there is no row, when all abstain, and for a rule that is not Gestalt's own. A row of another length is a mistake of the caller; its excess or lack is ignored.
pub fn fuse<'a>(
    rule: FusionRule,
    clip: f64,
    classes: usize,
    rows: impl IntoIterator<Item = &'a [f32]>,
) -> Option<Fusion> {
    if rule == FusionRule::CorrelatedPool {
        let rows: Vec<&[f32]> = rows.into_iter().collect();
        return fuse_correlated(Pool::PRIOR, clip, classes, &rows);
    }
    let mut totals = vec![0.0; classes];
    let mut row = vec![0.0; classes];
    let mut robots = 0.0;
    for evidence in rows {
        robots += f64::from(u8::from(part_into(&mut row, rule, clip, evidence)?));
        totals.iter_mut().zip(&row).for_each(|(total, part)| *total += part);
    }
    if robots == 0.0 || classes < 2 {
        return None;
    }

    let one_robot = match rule {
        FusionRule::Majority | FusionRule::MeanProbability => 1.0,
        FusionRule::LogPool | FusionRule::ConfidenceWeighted => 2.0 * clip,
        FusionRule::CorrelatedPool | FusionRule::Other(_) => return None,
    };
    let mut probabilities = totals.clone();
    match rule {
        FusionRule::Majority | FusionRule::MeanProbability => {
            probabilities.iter_mut().for_each(|p| *p /= robots);
        }
        FusionRule::LogPool | FusionRule::ConfidenceWeighted => softmax(&mut probabilities),
        FusionRule::CorrelatedPool | FusionRule::Other(_) => return None,
    }
    Some(summed_up(probabilities, &totals, one_robot))
}

/// The correlated pool by these parameters.
pub(crate) fn fuse_correlated(pool: Pool, clip: f64, classes: usize, rows: &[&[f32]]) -> Option<Fusion> {
    if rows.is_empty() || classes < 2 {
        return None;
    }
    let mut totals = vec![0.0; classes];
    let mut row = vec![0.0; classes];
    let mut strengths = Vec::with_capacity(rows.len());
    for evidence in rows {
        clip_into(&mut row, evidence, clip);
        totals.iter_mut().zip(&row).for_each(|(total, part)| *total += part);
        strengths.push(strength(&row));
    }
    let sharpness = sharpness(pool, voices(strengths.into_iter()));
    let mut probabilities: Vec<f64> = totals.iter().map(|total| sharpness * total).collect();
    softmax(&mut probabilities);
    Some(summed_up(probabilities, &totals, 2.0 * clip))
}

/// A fusion of these probabilities and totals, to the lead of which one robot adds so much at most.
fn summed_up(probabilities: Vec<f64>, totals: &[f64], one_robot: f64) -> Fusion {
    // The top is that of the probabilities, which the certificate shows: totals a rounding apart may be equal there.
    let top = top_of(&probabilities);
    let second = totals
        .iter()
        .enumerate()
        .filter(|(k, _)| *k != top.index())
        .map(|(_, total)| *total)
        .fold(f64::NEG_INFINITY, f64::max);
    let margin = ((totals[top.index()] - second) / one_robot).max(0.0);
    Fusion { probabilities, top, margin }
}

/// What one robot's row counts in [`fuse`], `0.0..=1.0`: its certainty in a confidence-weighted pool, nothing where it abstains, else 1.
#[must_use]
pub fn weight(rule: FusionRule, clip: f64, evidence: &[f32]) -> f64 {
    let mut row = vec![0.0; evidence.len()];
    match rule {
        FusionRule::Majority => {
            part_into(&mut row, rule, clip, evidence).map_or(0.0, |counts| f64::from(u8::from(counts)))
        }
        FusionRule::ConfidenceWeighted => {
            clip_into(&mut row, evidence, clip);
            certainty(&mut row)
        }
        FusionRule::MeanProbability
        | FusionRule::LogPool
        | FusionRule::CorrelatedPool
        | FusionRule::Other(_) => 1.0,
    }
}

/// What one robot's evidence adds to the total of each class, and whether the robot counts at all: it abstains from a majority where it
/// finds two classes equally likely. `None` for a rule that is not Gestalt's own.
pub(crate) fn part_into(row: &mut [f64], rule: FusionRule, clip: f64, evidence: &[f32]) -> Option<bool> {
    clip_into(row, evidence, clip);
    match rule {
        FusionRule::Majority => {
            let choice = choice(row);
            row.fill(0.0);
            match choice.and_then(|class| row.get_mut(class.index())) {
                Some(part) => *part = 1.0,
                None => return Some(false),
            }
        }
        FusionRule::MeanProbability => softmax(row),
        FusionRule::LogPool | FusionRule::CorrelatedPool => {}
        FusionRule::ConfidenceWeighted => {
            let certainty = certainty(&mut row.to_vec());
            row.iter_mut().for_each(|part| *part *= certainty);
        }
        FusionRule::Other(_) => return None,
    }
    Some(true)
}

/// The class that is likelier than all others, if there is one.
fn choice(row: &[f64]) -> Option<ClassId> {
    let top = top_of(row);
    let greatest = row.get(top.index())?;
    (row.iter().filter(|value| *value >= greatest).count() == 1).then_some(top)
}

/// The index of the greatest value; of equals the smaller index.
pub(crate) fn top_of<T: Copy + PartialOrd>(values: &[T]) -> ClassId {
    let mut top = 0;
    for (k, value) in values.iter().enumerate() {
        if *value > values[top] {
            top = k;
        }
    }
    // A vote carries at most MAX_CLASSES = 64 values.
    ClassId(top as u32)
}

pub(crate) fn clip_into(row: &mut [f64], evidence: &[f32], clip: f64) {
    row.fill(0.0);
    for (value, said) in row.iter_mut().zip(evidence) {
        *value = f64::from(*said).min(clip).max(-clip);
    }
}

pub(crate) fn softmax(row: &mut [f64]) {
    let greatest = row.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    row.iter_mut().for_each(|value| *value = (*value - greatest).exp());
    let sum: f64 = row.iter().sum();
    row.iter_mut().for_each(|value| *value /= sum);
}

/// 1 − H(softmax) / ln K: 0 for "no idea", 1 for "certain". The row is used up.
fn certainty(row: &mut [f64]) -> f64 {
    softmax(row);
    let entropy: f64 = row.iter().filter(|p| **p > 0.0).map(|p| -p * p.ln()).sum();
    (1.0 - entropy / (row.len() as f64).ln()).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const RULES: [FusionRule; 5] = FusionRule::ALL;

    fn fused(rule: FusionRule, rows: &[&[f32]]) -> Fusion {
        fuse(rule, 6.0, rows[0].len(), rows.iter().copied()).unwrap()
    }

    fn close(found: &[f64], expected: &[f64]) {
        assert_eq!(found.len(), expected.len());
        for (a, b) in found.iter().zip(expected) {
            assert!((a - b).abs() < 1e-6, "{found:?} is not {expected:?}");
        }
    }

    /// ln 2 for one class against two: the softmax of (ln 2, 0, 0) is (1/2, 1/4, 1/4).
    const HALF: [f32; 3] = [std::f32::consts::LN_2, 0.0, 0.0];
    const OTHER: [f32; 3] = [0.0, std::f32::consts::LN_2, 0.0];

    #[test]
    fn majority_counts_each_robot_once_for_its_top_class() {
        let fusion = fused(FusionRule::Majority, &[&HALF, &HALF, &[0.0, 6.0, -6.0]]);
        close(&fusion.probabilities, &[2.0 / 3.0, 1.0 / 3.0, 0.0]);
        assert_eq!((fusion.top, fusion.margin), (ClassId(0), 1.0));
    }

    #[test]
    fn who_finds_two_classes_equally_likely_abstains_from_a_majority() {
        let tied: [f32; 3] = [1.0, 1.0, -2.0];
        // Beyond the clip too.
        let clipped: [f32; 3] = [-9.0, 7.0, 8.0];
        let fusion = fused(FusionRule::Majority, &[&tied, &clipped, &[0.0; 3], &OTHER]);
        close(&fusion.probabilities, &[0.0, 1.0, 0.0]);
        assert_eq!((fusion.top, fusion.margin), (ClassId(1), 1.0));
        assert_eq!([&tied, &OTHER].map(|row| weight(FusionRule::Majority, 6.0, row)), [0.0, 1.0]);
        assert_eq!(fuse(FusionRule::Majority, 6.0, 3, [&tied[..], &[0.0; 3]]), None, "all abstain");
    }

    #[test]
    fn the_mean_averages_probabilities() {
        let fusion = fused(FusionRule::MeanProbability, &[&HALF, &HALF, &OTHER]);
        close(&fusion.probabilities, &[5.0 / 12.0, 4.0 / 12.0, 3.0 / 12.0]);
        close(&[fusion.margin], &[0.25]);
    }

    #[test]
    fn the_log_pool_multiplies_odds() {
        let fusion = fused(FusionRule::LogPool, &[&HALF, &HALF, &OTHER]);
        close(&fusion.probabilities, &[4.0 / 7.0, 2.0 / 7.0, 1.0 / 7.0]);
        close(&[fusion.margin], &[std::f64::consts::LN_2 / 12.0]);
    }

    #[test]
    fn the_confident_weigh_more_and_the_clueless_nothing() {
        // H(1/2, 1/4, 1/4) = 1.5 ln 2, so the certainty of HALF is 1 − 1.5 ln 2 / ln 3.
        let certainty = 1.0 - 1.5 * 2f64.ln() / 3f64.ln();
        close(&[weight(FusionRule::ConfidenceWeighted, 6.0, &HALF)], &[certainty]);
        close(&[weight(FusionRule::ConfidenceWeighted, 6.0, &[0.0; 3])], &[0.0]);
        let fusion = fused(FusionRule::ConfidenceWeighted, &[&HALF, &[0.0; 3]]);
        let odds = 2f64.powf(certainty);
        close(&fusion.probabilities, &[odds / (odds + 2.0), 1.0 / (odds + 2.0), 1.0 / (odds + 2.0)]);
    }

    #[test]
    fn of_equals_the_smaller_class_wins_with_no_margin() {
        for rule in RULES {
            let fusion = fused(rule, &[&OTHER, &HALF]);
            assert_eq!((fusion.top, fusion.margin), (ClassId(0), 0.0), "{rule:?}");
        }
    }

    #[test]
    fn one_loud_robot_weighs_no_more_than_the_clip() {
        for rule in RULES {
            let loud = fused(rule, &[&[1e30, -1e30, 0.0], &OTHER]);
            let clipped = fused(rule, &[&[6.0, -6.0, 0.0], &OTHER]);
            assert_eq!(loud, clipped, "{rule:?}");
            assert!(loud.margin <= 1.0);
        }
    }

    #[test]
    fn a_margin_above_f_stands_whatever_f_robots_say() {
        for rule in RULES {
            let honest: [f32; 3] = [5.0, -5.0, -5.0];
            let rows: Vec<&[f32]> = vec![&honest; 4];
            let fusion = fused(rule, &rows);
            assert!(fusion.margin > 1.0, "{rule:?}: {}", fusion.margin);
            let mut lied = rows.clone();
            lied.push(&[-1e9, 1e9, -1e9]);
            assert_eq!(fused(rule, &lied).top, ClassId(0), "{rule:?}");
        }
    }

    #[test]
    fn no_votes_are_no_opinion() {
        assert_eq!(fuse(FusionRule::LogPool, 6.0, 3, []), None);
    }

    proptest::proptest! {
        #[test]
        fn every_rule_gives_a_distribution(
            rows in proptest::collection::vec(proptest::collection::vec(-1e6f32..1e6, 5), 1..20)
        ) {
            for rule in RULES {
                let fused = fuse(rule, 6.0, 5, rows.iter().map(Vec::as_slice));
                let abstain = || rule == FusionRule::Majority && rows.iter().all(|row| weight(rule, 6.0, row) == 0.0);
                proptest::prop_assert!(fused.is_some() || abstain());
                let Some(fusion) = fused else { continue };
                let sum: f64 = fusion.probabilities.iter().sum();
                proptest::prop_assert!((sum - 1.0).abs() < 1e-9);
                proptest::prop_assert!(fusion.probabilities.iter().all(|p| (0.0..=1.0).contains(p)));
                proptest::prop_assert!(fusion.margin >= 0.0);
                proptest::prop_assert_eq!(fusion.top, top_of(&fusion.probabilities));
            }
        }
    }
}
