//! How votes are fused, as configurations and certificates name it.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// How the votes of a ballot become one distribution over the classes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FusionRule {
    /// Frequency counting: each robot counts once, for its top class.
    Majority,
    /// Averaging: the mean of the robots' probabilities.
    MeanProbability,
    /// Logarithmic opinion pool: the softmax of the sum of the robots' log-evidence.
    LogPool,
    /// A log-opinion pool in which each robot weighs by its own certainty.
    ConfidenceWeighted,
    /// A rule of somebody's own, by its name. Who does not have it cannot draw the decision again from its votes.
    Other(RuleName),
    /// A logarithmic opinion pool that knows how alike its robots are: the sum is divided by how far they repeat each other.
    #[default]
    CorrelatedPool,
}

impl FusionRule {
    /// Those that come with Gestalt.
    pub const ALL: [Self; 5] = [
        Self::Majority,
        Self::MeanProbability,
        Self::LogPool,
        Self::ConfidenceWeighted,
        Self::CorrelatedPool,
    ];

    /// The name it has in a configuration and in a certificate.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            Self::Majority => "majority",
            Self::MeanProbability => "mean_probability",
            Self::LogPool => "log_pool",
            Self::ConfidenceWeighted => "confidence_weighted",
            Self::Other(name) => name.as_str(),
            Self::CorrelatedPool => "correlated_pool",
        }
    }
}

impl fmt::Display for FusionRule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A text that is no name of a rule.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("'{0}' is no name of a rule: 1 to {MAX_NAME} of the characters a-z 0-9 _")]
pub struct RuleNameError(String);

/// The longest name of a rule, in bytes.
const MAX_NAME: usize = 31;

/// The name of a rule of somebody's own: 1 to 31 of the characters `a-z 0-9 _`.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct RuleName {
    /// The name, then zeros.
    bytes: [u8; MAX_NAME],
}

impl RuleName {
    /// The name.
    #[must_use]
    pub fn as_str(&self) -> &str {
        let length = self.bytes.iter().position(|byte| *byte == 0).unwrap_or(MAX_NAME);
        // All its characters are ASCII.
        str::from_utf8(&self.bytes[..length]).unwrap_or_default()
    }
}

impl fmt::Display for RuleName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

impl fmt::Debug for RuleName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}", self.as_str())
    }
}

impl FromStr for RuleName {
    type Err = RuleNameError;

    fn from_str(text: &str) -> Result<Self, RuleNameError> {
        let fits = (1..=MAX_NAME).contains(&text.len())
            && text.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_');
        if !fits {
            return Err(RuleNameError(text.chars().take(40).collect()));
        }
        let mut bytes = [0; MAX_NAME];
        bytes[..text.len()].copy_from_slice(text.as_bytes());
        Ok(Self { bytes })
    }
}

impl TryFrom<String> for RuleName {
    type Error = RuleNameError;

    fn try_from(text: String) -> Result<Self, RuleNameError> {
        text.parse()
    }
}

impl From<RuleName> for String {
    fn from(name: RuleName) -> Self {
        name.as_str().to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rule_travels_under_its_name() {
        for rule in FusionRule::ALL {
            assert_eq!(serde_json::to_value(rule).unwrap(), rule.name());
        }
        let own = FusionRule::Other("trimmed_mean".parse().unwrap());
        assert_eq!(serde_json::to_string(&own).unwrap(), r#"{"other":"trimmed_mean"}"#);
        assert_eq!(serde_json::from_str::<FusionRule>(r#"{"other":"trimmed_mean"}"#).unwrap(), own);
        assert_eq!(postcard::to_stdvec(&own).unwrap(), b"\x04\x0ctrimmed_mean");
        assert_eq!(postcard::from_bytes::<FusionRule>(b"\x04\x0ctrimmed_mean").unwrap(), own);
    }

    #[test]
    fn a_name_is_short_and_plain() {
        let longest = "x".repeat(MAX_NAME);
        assert_eq!(longest.parse::<RuleName>().unwrap().as_str(), longest);
        for bad in ["", "Mean", "a b", "naïve", &"x".repeat(MAX_NAME + 1)] {
            assert!(bad.parse::<RuleName>().is_err(), "{bad}");
        }
    }
}
