//! What a link does to a message.

use std::time::Duration;

use serde::{Deserialize, Serialize};

/// What a link does to a message.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LinkModel {
    /// How long a message takes over one hop, at least.
    #[serde(with = "humantime_serde")]
    pub latency: Duration,
    /// How much longer it may take, uniformly.
    #[serde(with = "humantime_serde")]
    pub jitter: Duration,
    /// The probability that one hop loses it, `0.0..1.0`.
    pub loss: f64,
    /// How long until robots notice that a link or a robot has gone or come, and route accordingly.
    #[serde(with = "humantime_serde")]
    pub detection: Duration,
}

impl Default for LinkModel {
    fn default() -> Self {
        Self {
            latency: Duration::from_millis(2),
            jitter: Duration::from_millis(2),
            loss: 0.0,
            detection: Duration::from_millis(1500),
        }
    }
}
