//! The selection rules that come with Gestalt, by name.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::contract::Selection;
use super::herding::HerdingSelection;
use super::k_center::KCenter;
use super::margin::Margin;
use super::novelty::Novelty;
use super::random::RandomSelection;
use super::representativity::RepresentativitySelection;

/// The selection rules that come with Gestalt.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SelectionRule {
    /// See [`RandomSelection`].
    Random,
    /// See [`Novelty`].
    Novelty,
    /// See [`RepresentativitySelection`].
    Representativity,
    /// See [`HerdingSelection`].
    Herding,
    /// See [`KCenter`]. The default: of what may be shared it leaves the least out of reach, and was measured best.
    #[default]
    KCenter,
    /// See [`Margin`].
    Margin,
}

impl SelectionRule {
    /// All of them: the source's, then the baselines.
    pub const ALL: [Self; 6] =
        [Self::Random, Self::Novelty, Self::Representativity, Self::Herding, Self::KCenter, Self::Margin];

    /// The name it has in a config.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Random => "random",
            Self::Novelty => "novelty",
            Self::Representativity => "representativity",
            Self::Herding => "herding",
            Self::KCenter => "k_center",
            Self::Margin => "margin",
        }
    }

    /// The rule, for a set that is still empty.
    #[must_use]
    pub fn build(self) -> Box<dyn Selection> {
        match self {
            Self::Random => Box::new(RandomSelection),
            Self::Novelty => Box::<Novelty>::default(),
            Self::Representativity => Box::<RepresentativitySelection>::default(),
            Self::Herding => Box::<HerdingSelection>::default(),
            Self::KCenter => Box::<KCenter>::default(),
            Self::Margin => Box::new(Margin),
        }
    }
}

impl fmt::Display for SelectionRule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A name that no selection rule has.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("'{0}' is no selection rule: take one of {known}", known = SelectionRule::ALL.map(SelectionRule::name).join(", "))]
pub struct UnknownSelection(String);

impl FromStr for SelectionRule {
    type Err = UnknownSelection;

    fn from_str(name: &str) -> Result<Self, UnknownSelection> {
        let named = Self::ALL.into_iter().find(|rule| rule.name() == name);
        named.ok_or_else(|| UnknownSelection(name.chars().take(40).collect()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rule_has_one_name() {
        for rule in SelectionRule::ALL {
            assert_eq!(rule.to_string().parse(), Ok(rule));
            let name: serde::de::value::StrDeserializer<'_, serde::de::value::Error> =
                serde::de::IntoDeserializer::into_deserializer(rule.name());
            assert_eq!(SelectionRule::deserialize(name), Ok(rule));
        }
        assert!("best".parse::<SelectionRule>().is_err());
    }
}
