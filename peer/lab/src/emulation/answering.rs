//! An instructor who speaks when asked.

use serde::{Deserialize, Serialize};

/// By whom, or by what, an instructor who says nothing unasked is asked. All keep to the same budget, that of the robots' configuration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AskedBy {
    /// The swarm's own questions.
    #[default]
    Swarm,
    /// Chance: every second round about which a question may be asked.
    Random,
    /// Entropy: whatever leaves at least .35 nats of it, of whatever was said before.
    Entropy,
    /// The margin: whatever has its two likeliest outcomes less than a half apart.
    Margin,
}

/// How an instructor answers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Answering {
    /// Who asks; of no consequence where the instructor speaks unasked.
    pub asked_by: AskedBy,
    /// Which part of what the instructor says is wrong, `0.0..=1.0`: it names another gesture than the one shown, or says right of a wrong
    /// decision and wrong of a right one.
    pub wrong: f64,
}

impl Default for Answering {
    fn default() -> Self {
        Self { asked_by: AskedBy::default(), wrong: 0.0 }
    }
}
