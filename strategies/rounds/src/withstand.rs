//! What a fused opinion is worth when some of those who voted may have lied.

use gestalt_protocol::{FusionRule, Pool};

use crate::alike::sharpness;
use crate::fusion::{Fusion, part_into};

/// The least probability that the top class of a fusion keeps, whichever `liars` of its votes are left out; 0 where another class may
/// lead then.
///
/// All of Gestalt's rules add up one part a(k) of each robot. Let d be a robot's a(top) − a(k), and D the sum of all d but the f greatest: the
/// lead over class k that is sure.
/// - log pools: 1 / (1 + Σ exp(−D)), over all k but the top;
/// - correlated pool: the same of β D, with the β of as many equal voices as are left, which is the least it can be: its likeness is what
///   is believed before any round was confirmed, so that nobody who lies can move it;
/// - majority, mean of probabilities: the sum of all a(top) but the f greatest, shared by the robots but f. Who abstains from a majority is none
///   of them.
///
/// So where at most f lie, the honest votes among them alone give the top class that much: nothing is decided that they would not
/// decide. The trimmed sums are those of robust statistics, here cut on the one side that favours the decision.
pub(crate) fn least(rule: FusionRule, clip: f64, votes: &[&[f32]], fusion: &Fusion, liars: usize) -> f64 {
    let (classes, top) = (fusion.probabilities.len(), fusion.top.index());
    let mut part = vec![0.0; classes];
    // One vote after the other.
    let mut all = Vec::with_capacity(votes.len() * classes);
    for evidence in votes {
        match part_into(&mut part, rule, clip, evidence) {
            Some(true) => all.extend_from_slice(&part),
            Some(false) => {}
            None => return 0.0,
        }
    }
    let parts = all.chunks_exact(classes.max(1));
    let sharpness = match rule {
        FusionRule::CorrelatedPool => sharpness(Pool::PRIOR, parts.len().saturating_sub(liars) as f64),
        _ => 1.0,
    };
    let mut against = 0.0;
    for rival in (0..classes).filter(|class| *class != top) {
        let lead = all_but_greatest(parts.clone().map(|part| part[top] - part[rival]), liars);
        // Also where too few are left, or what they say is no number.
        if !lead.is_some_and(|lead| lead > 0.0) {
            return 0.0;
        }
        against += lead.map_or(0.0, |lead| (-sharpness * lead).exp());
    }
    match rule {
        FusionRule::LogPool | FusionRule::ConfidenceWeighted | FusionRule::CorrelatedPool => {
            1.0 / (1.0 + against)
        }
        FusionRule::Majority | FusionRule::MeanProbability => {
            let robots = parts.len();
            let sure = all_but_greatest(parts.map(|part| part[top]), liars);
            sure.map_or(0.0, |sure| sure / (robots - liars) as f64)
        }
        FusionRule::Other(_) => 0.0,
    }
}

/// The sum of all values but the greatest so many; `None` when none is left.
fn all_but_greatest(values: impl Iterator<Item = f64>, without: usize) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let left = values.len().checked_sub(without).filter(|left| *left > 0)?;
    Some(values[..left].iter().sum())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::fusion::fuse;

    const CLIP: f64 = 6.0;

    fn fused(rule: FusionRule, votes: &[&[f32]]) -> Option<Fusion> {
        fuse(rule, CLIP, 4, votes.iter().copied())
    }

    #[test]
    fn what_is_left_is_what_the_others_say() {
        let (sure, unsure): ([f32; 3], [f32; 3]) = ([6.0, -3.0, -3.0], [std::f32::consts::LN_2, 0.0, 0.0]);
        let votes: Vec<&[f32]> = vec![&sure, &unsure, &unsure];
        let fusion = fuse(FusionRule::LogPool, CLIP, 3, votes.iter().copied()).unwrap();
        let left = least(FusionRule::LogPool, CLIP, &votes, &fusion, 1);
        assert!((left - 4.0 / 6.0).abs() < 1e-6, "twice (ln 2, 0, 0) is (4, 1, 1) : 6, not {left}");
        let mean = fuse(FusionRule::MeanProbability, CLIP, 3, votes.iter().copied()).unwrap();
        let left = least(FusionRule::MeanProbability, CLIP, &votes, &mean, 1);
        assert!((left - 0.5).abs() < 1e-6, "the mean of twice 1/2, not {left}");
    }

    #[test]
    fn where_no_vote_is_left_nothing_is_sure() {
        for rule in FusionRule::ALL {
            let votes: Vec<&[f32]> = vec![&[6.0, -2.0, -2.0, -2.0]; 2];
            let fusion = fused(rule, &votes).unwrap();
            assert_eq!(least(rule, CLIP, &votes, &fusion, 2), 0.0, "{rule}");
            assert_eq!(least(rule, CLIP, &votes, &fusion, 3), 0.0, "{rule}");
        }
    }

    fn rows(robots: std::ops::Range<usize>) -> impl Strategy<Value = Vec<Vec<f32>>> {
        prop::collection::vec(prop::collection::vec(-8.0f32..8.0, 4), robots)
    }

    proptest! {
        #[test]
        fn whatever_liars_add_honest_votes_alone_give_as_much(
            honest in rows(1..8), lies in rows(0..4)
        ) {
            for rule in FusionRule::ALL {
                let honest: Vec<&[f32]> = honest.iter().map(Vec::as_slice).collect();
                let all: Vec<&[f32]> = honest.iter().copied().chain(lies.iter().map(Vec::as_slice)).collect();
                let Some(fusion) = fused(rule, &all) else { continue };
                let least = least(rule, CLIP, &all, &fusion, lies.len());
                let Some(alone) = fused(rule, &honest) else {
                    prop_assert_eq!(least, 0.0);
                    continue;
                };
                prop_assert!(alone.probabilities[fusion.top.index()] >= least - 1e-9, "{rule}: {least}");
                prop_assert!(least == 0.0 || alone.top == fusion.top, "{rule}: {alone:?}");
            }
        }
    }
}
