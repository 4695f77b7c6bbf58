//! The rules that come with Gestalt, as fusion rules.

use gestalt_protocol::{FusionRule, Pool};

use crate::correlated::CorrelatedPool;
use crate::fuse::Fuse;
use crate::fusion::{self, Fusion};
use crate::withstand;

impl Fuse for FusionRule {
    fn rule(&self) -> FusionRule {
        *self
    }

    fn fuse(&self, clip: f64, classes: usize, votes: &[&[f32]]) -> Option<Fusion> {
        fusion::fuse(*self, clip, classes, votes.iter().copied())
    }

    fn withstands(&self, clip: f64, votes: &[&[f32]], fusion: &Fusion, liars: u32) -> f64 {
        match liars {
            0 if fusion.margin > 0.0 => fusion.greatest(),
            0 => 0.0,
            liars => withstand::least(*self, clip, votes, fusion, liars as usize),
        }
    }

    fn pool(&self) -> Option<Pool> {
        (*self == Self::CorrelatedPool).then_some(Pool::PRIOR)
    }

    fn with(&self, pool: Pool) -> Option<Box<dyn Fuse>> {
        (*self == Self::CorrelatedPool).then(|| Box::new(CorrelatedPool(pool)) as Box<dyn Fuse>)
    }

    fn weight(&self, clip: f64, evidence: &[f32]) -> f64 {
        fusion::weight(*self, clip, evidence)
    }
}
