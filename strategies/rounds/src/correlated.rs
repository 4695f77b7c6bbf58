//! The pool that knows how alike its robots are.

use gestalt_protocol::{FusionRule, Pool};

use crate::fuse::Fuse;
use crate::fusion::{self, Fusion};

/// The correlated pool with parameters of its own: those of [`Pool::PRIOR`] are [`FusionRule::CorrelatedPool`] itself.
///
/// Robots that look at one hand err together: the same person, the same light, classifiers learned from the same samples. So their evidence
/// must not be multiplied by their number. With ρ the likeness of two robots, n equal voices are worth n / (1 + (n − 1) ρ) independent ones,
/// the design effect of cluster sampling (Kish 1965); and T is what a single robot overstates (Guo et al. 2017):
///
/// P(k) ∝ exp(β Σ ℓ(k)), β = 1 / (T (1 + (n − 1) ρ)), n = (Σ s)² / Σ s²
///
/// with s the strength of a robot's voice, the length of its clipped and centred evidence: who has nothing to say makes nobody repeat it.
/// Which class is likeliest does not depend on ρ or T, only how likely it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CorrelatedPool(pub Pool);

impl Fuse for CorrelatedPool {
    fn rule(&self) -> FusionRule {
        FusionRule::CorrelatedPool
    }

    fn fuse(&self, clip: f64, classes: usize, votes: &[&[f32]]) -> Option<Fusion> {
        fusion::fuse_correlated(self.0, clip, classes, votes)
    }

    fn withstands(&self, clip: f64, votes: &[&[f32]], fusion: &Fusion, liars: u32) -> f64 {
        // Where liars are expected its parameters are those believed beforehand.
        self.rule().withstands(clip, votes, fusion, liars)
    }

    fn pool(&self) -> Option<Pool> {
        Some(self.0)
    }

    fn with(&self, pool: Pool) -> Option<Box<dyn Fuse>> {
        Some(Box::new(Self(pool)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fused(pool: Pool, rows: &[&[f32]]) -> Fusion {
        CorrelatedPool(pool).fuse(6.0, 3, rows).unwrap()
    }

    #[test]
    fn robots_that_are_one_witness_are_as_sure_as_one() {
        let pool = Pool { likeness: 1.0, temperature: 1.0, rounds: 9 };
        let row: &[f32] = &[2.0, -1.0, -1.0];
        let (one, ten) = (fused(pool, &[row]), fused(pool, &[row; 10]));
        assert!((one.probabilities[0] - ten.probabilities[0]).abs() < 1e-12, "{one:?} {ten:?}");
        assert_eq!(ten.top, one.top);
    }

    #[test]
    fn robots_that_have_nothing_in_common_are_a_log_pool() {
        let pool = Pool { likeness: 0.0, temperature: 1.0, rounds: 9 };
        let rows: [&[f32]; 2] = [&[2.0, -1.0, -1.0], &[-0.5, 1.0, -0.5]];
        let log_pool = FusionRule::LogPool.fuse(6.0, 3, &rows).unwrap();
        assert_eq!(fused(pool, &rows), log_pool);
    }

    #[test]
    fn half_alike_robots_are_worth_as_many_as_the_design_effect_leaves() {
        let pool = Pool { likeness: 0.5, temperature: 2.0, rounds: 0 };
        // Four voices are worth 4 / (1 + 3 / 2) = 1.6, and each is half of what it says.
        let row: &[f32] = &[2.0, -1.0, -1.0];
        let odds = (3.0 * 1.6 / 2.0_f64).exp();
        let p = fused(pool, &[row; 4]).probabilities[0];
        assert!((p - odds / (odds + 2.0)).abs() < 1e-12, "{p}");
    }

    #[test]
    fn who_has_nothing_to_say_takes_no_weight_from_the_others() {
        let row: &[f32] = &[2.0, -1.0, -1.0];
        let silent: &[f32] = &[0.0; 3];
        let with = fused(Pool::PRIOR, &[row, row, silent, silent, silent]);
        assert_eq!(with, fused(Pool::PRIOR, &[row, row]));
    }
}
