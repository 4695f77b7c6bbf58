//! By which terms votes make a decision.

use serde::{Deserialize, Serialize};

/// The terms that a robot decides by, as a certificate states them beside its rule and its quorum: with them and the votes anybody finds whether the
/// decision is one. All robots of a swarm have the same, those of their configuration, and decide nothing by those of another.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Terms {
    /// c: the bound on a robot's evidence for or against any class, in nats; above 0, at most 1000.
    pub clip: f64,
    /// α: a gesture needs 1 − α, of what the rule gives; above 0, at most 0.5.
    pub alpha: f64,
    /// Whether the quorum is a majority of the robots; otherwise it is a number that somebody chose.
    pub majority: bool,
    /// f: how many lying robots a decision withstands.
    pub liars: u32,
    /// How many robots vote at least where not all do; 0: all do.
    pub committee: u32,
}

impl Default for Terms {
    /// Those of a robot that is configured to nothing else, and fuses by a pool.
    fn default() -> Self {
        Self { clip: 6.0, alpha: 0.05, majority: true, liars: 0, committee: 72 }
    }
}

impl Terms {
    /// Whether a robot can work with them.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        self.clip > 0.0 && self.clip <= 1000.0 && self.alpha > 0.0 && self.alpha <= 0.5
    }
}
