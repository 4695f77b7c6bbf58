//! The forgetting rules that come with Gestalt, by name.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::class_balanced_reservoir::ClassBalancedReservoir;
use super::contract::Forgetting;
use super::fifo::Fifo;
use super::herding::HerdingForgetting;
use super::random::RandomForgetting;
use super::redundancy::Redundancy;
use super::representativity::RepresentativityForgetting;
use super::reservoir::Reservoir;

/// The forgetting rules that come with Gestalt. A rule is asked where no author has more than its share of the room, and own samples that it names stay
/// while they are few: see [`author_shares`](crate::LearningConfig::author_shares).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ForgettingRule {
    /// See [`Fifo`].
    Fifo,
    /// See [`RandomForgetting`].
    Random,
    /// See [`Redundancy`]. The default: what goes has another close to it, and of those compared, within shares of authors, it cost the least.
    #[default]
    Redundancy,
    /// See [`RepresentativityForgetting`].
    Representativity,
    /// See [`Reservoir`].
    Reservoir,
    /// See [`ClassBalancedReservoir`].
    ClassBalancedReservoir,
    /// See [`HerdingForgetting`].
    Herding,
}

impl ForgettingRule {
    /// All of them: the source's, then the baselines.
    pub const ALL: [Self; 7] = [
        Self::Fifo,
        Self::Random,
        Self::Redundancy,
        Self::Representativity,
        Self::Reservoir,
        Self::ClassBalancedReservoir,
        Self::Herding,
    ];

    /// The name it has in a config.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Fifo => "fifo",
            Self::Random => "random",
            Self::Redundancy => "redundancy",
            Self::Representativity => "representativity",
            Self::Reservoir => "reservoir",
            Self::ClassBalancedReservoir => "class_balanced_reservoir",
            Self::Herding => "herding",
        }
    }

    /// The rule, for a set that is still empty.
    #[must_use]
    pub fn build(self) -> Box<dyn Forgetting> {
        match self {
            Self::Fifo => Box::new(Fifo),
            Self::Random => Box::new(RandomForgetting),
            Self::Redundancy => Box::<Redundancy>::default(),
            Self::Representativity => Box::<RepresentativityForgetting>::default(),
            Self::Reservoir => Box::new(Reservoir),
            Self::ClassBalancedReservoir => Box::<ClassBalancedReservoir>::default(),
            Self::Herding => Box::<HerdingForgetting>::default(),
        }
    }
}

impl fmt::Display for ForgettingRule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A name that no forgetting rule has.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("'{0}' is no forgetting rule: take one of {known}", known = ForgettingRule::ALL.map(ForgettingRule::name).join(", "))]
pub struct UnknownForgetting(String);

impl FromStr for ForgettingRule {
    type Err = UnknownForgetting;

    fn from_str(name: &str) -> Result<Self, UnknownForgetting> {
        let named = Self::ALL.into_iter().find(|rule| rule.name() == name);
        named.ok_or_else(|| UnknownForgetting(name.chars().take(40).collect()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rule_has_one_name() {
        for rule in ForgettingRule::ALL {
            assert_eq!(rule.to_string().parse(), Ok(rule));
            let name: serde::de::value::StrDeserializer<'_, serde::de::value::Error> =
                serde::de::IntoDeserializer::into_deserializer(rule.name());
            assert_eq!(ForgettingRule::deserialize(name), Ok(rule));
        }
        assert!("all".parse::<ForgettingRule>().is_err());
    }
}
