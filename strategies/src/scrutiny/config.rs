//! The parameters of the defence against poisoned samples.

use serde::{Deserialize, Serialize};

/// How a robot meets samples of others that would teach it wrongly. In a configuration file what is left out is the default: all are
/// believed, for the defence costs a swarm of honest robots that see badly some of what it knows. With it: 1.25 and 3.
///
/// | name | default | meaning | range |
/// |---|---|---|---|
/// | `influence` | 0 | of each author and class so many times as many samples are trained on as of the middle robot, but five at least; 0: any number | 0, or 1–100 |
/// | `agreement` | 0 | how much the samples of others weigh when it is judged whether one is true; 0: all are believed | 0–100 |
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PoisonDefence {
    /// Of each author and class so many times as many samples are trained on as of the middle robot; 0: any number.
    pub influence: f64,
    /// How much the samples of others weigh when it is judged whether one is true; 0: all are believed.
    pub agreement: f64,
}

impl Default for PoisonDefence {
    fn default() -> Self {
        Self { influence: 0.0, agreement: 0.0 }
    }
}

impl PoisonDefence {
    /// The defence, with the weights that it was measured with.
    #[must_use]
    pub fn measured() -> Self {
        Self { influence: 1.25, agreement: 3.0 }
    }
}
