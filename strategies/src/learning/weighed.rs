//! What the votes of one round say of how alike robots are.

use std::sync::Arc;

use gestalt_rounds::{Testimony, Weights};

use crate::lessons::Verdict;

/// What the votes of a round say of how alike robots are, by what it was about.
#[derive(Debug)]
pub(super) struct Weighed {
    testimony: Arc<Testimony>,
    verdict: Verdict,
    weights: Option<Weights>,
}

impl Weighed {
    /// `None` of a round of which nothing is said.
    pub fn new(testimony: Arc<Testimony>, verdict: Verdict) -> Option<Self> {
        let weights = match &verdict {
            Verdict::Class(class) => testimony.weigh(&|k| k == *class),
            Verdict::Among(candidates) => testimony.weigh(&|k| candidates.contains(k)),
            Verdict::Unsaid | Verdict::Retracted => return None,
        };
        Some(Self { testimony, verdict, weights })
    }

    /// None where they say nothing.
    pub fn weights(&self) -> Option<&Weights> {
        self.weights.as_ref()
    }

    pub fn is_of(&self, testimony: &Arc<Testimony>, verdict: &Verdict) -> bool {
        let same = || Arc::ptr_eq(&self.testimony, testimony) || self.testimony == *testimony;
        self.verdict == *verdict && same()
    }
}
