//! Which sample can be spared when there are too many.

mod class_balanced_reservoir;
mod fifo;
mod herding;
mod random;
mod redundancy;
mod representativity;
mod reservoir;

use std::fmt::{self, Debug};
use std::str::FromStr;

use rand::Rng;
use serde::{Deserialize, Serialize};
use thiserror::Error;

pub use class_balanced_reservoir::ClassBalancedReservoir;
pub use fifo::Fifo;
pub use herding::HerdingForgetting;
pub use random::RandomForgetting;
pub use redundancy::Redundancy;
pub use representativity::RepresentativityForgetting;
pub use reservoir::Reservoir;

use crate::training_set::{HeldSample, Samples};

/// Says which sample goes when the set holds more than its capacity.
///
/// A rule is told of every change of the set, so that it can keep distances up to date instead of computing them
/// anew each time; a rule that needs none of that only writes `victim`. What it picks may depend on what it was
/// told of and on the generator handed in, and on nothing else.
///
/// ```
/// use gestalt_protocol::{ClassId, RobotId, RoundId};
/// use gestalt_strategies::training_set::{Samples, TrainingSet};
/// use gestalt_strategies::{Forgetting, SelectionRule};
/// use rand::{Rng, SeedableRng};
/// use rand_chacha::ChaCha8Rng;
///
/// /// The first impression counts: whatever comes when the set is full goes at once.
/// #[derive(Debug)]
/// struct FirstImpression;
///
/// impl Forgetting for FirstImpression {
///     fn victim(&mut self, samples: &Samples, _: &mut dyn Rng) -> Option<u64> {
///         samples.iter().next_back().map(|newest| newest.key)
///     }
/// }
///
/// let mut rng = ChaCha8Rng::seed_from_u64(1);
/// let mut set = TrainingSet::new(RobotId(1), 2, SelectionRule::default().build(), Box::new(FirstImpression));
/// for counter in 1..=3 {
///     let round = RoundId { counter, opener: RobotId(1) };
///     set.keep(ClassId(0), round, vec![counter as f32], &mut rng);
/// }
/// assert!(set.iter().map(|sample| sample.round.counter).eq([1, 2]));
/// ```
pub trait Forgetting: Debug + Send {
    /// A sample came in, in any part; it is not among the samples yet.
    fn inserted(&mut self, sample: &HeldSample) {
        let _ = sample;
    }

    /// A sample went.
    fn removed(&mut self, sample: &HeldSample) {
        let _ = sample;
    }

    /// A sample has another class, or went from personal to shared, maybe with another vector. By default the old
    /// one goes and the new one comes.
    fn replaced(&mut self, before: &HeldSample, after: &HeldSample) {
        self.removed(before);
        self.inserted(after);
    }

    /// The key of the sample to forget. Asked when the set, the newest sample included, holds more than its
    /// capacity. If the answer is no sample that is held, the oldest goes.
    fn victim(&mut self, samples: &Samples, rng: &mut dyn Rng) -> Option<u64>;
}

/// The forgetting rules that come with Gestalt.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ForgettingRule {
    /// See [`Fifo`].
    Fifo,
    /// See [`RandomForgetting`].
    Random,
    /// See [`Redundancy`]. The default: what goes has another close to it, and it was measured to cost the least.
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
