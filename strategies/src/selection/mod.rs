//! Which personal sample is worth sharing next.

mod herding;
mod k_center;
mod margin;
mod novelty;
mod random;
mod representativity;

use std::fmt::{self, Debug};
use std::str::FromStr;

use rand::Rng;
use serde::{Deserialize, Serialize};
use thiserror::Error;

pub use herding::HerdingSelection;
pub use k_center::KCenter;
pub use margin::Margin;
pub use novelty::Novelty;
pub use random::RandomSelection;
pub use representativity::RepresentativitySelection;

use crate::Classify;
use crate::training_set::{HeldSample, Samples};

/// Says which personal sample to share next.
///
/// A rule is told of every change of the set, so that it can keep distances up to date instead of computing them
/// anew at each choice; a rule that needs none of that only writes `select`. What it picks may depend on what is
/// held, on the classifier and on the generator handed in, and on nothing else.
///
/// ```
/// use gestalt_protocol::{ClassId, RobotId, RoundId};
/// use gestalt_strategies::training_set::{Part, Samples, TrainingSet};
/// use gestalt_strategies::{Classify, ForgettingRule, Selection};
/// use rand::{Rng, SeedableRng};
/// use rand_chacha::ChaCha8Rng;
///
/// /// The newest first: what is shown now is what the swarm talks about.
/// #[derive(Debug)]
/// struct Newest;
///
/// impl Selection for Newest {
///     fn select(&mut self, samples: &Samples, _: Option<&dyn Classify>, rng: &mut dyn Rng) -> Option<u64> {
///         let class = samples.draw_personal_class(rng)?;
///         samples.part_keys(Part::Personal, class).last().copied()
///     }
/// }
///
/// let mut rng = ChaCha8Rng::seed_from_u64(1);
/// let mut set = TrainingSet::new(RobotId(1), 100, Box::new(Newest), ForgettingRule::default().build());
/// for counter in 1..=3 {
///     let round = RoundId { counter, opener: RobotId(1) };
///     set.keep(ClassId(0), round, vec![counter as f32], &mut rng);
/// }
/// set.share(1, None, &|vector| vector.to_vec(), &mut rng);
/// let shared = set.common().next().expect("one sample was shared");
/// assert_eq!(shared.round.counter, 3);
/// ```
pub trait Selection: Debug + Send {
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

    /// The key of the personal sample to share next, or `None` when there is none. Any other answer ends the
    /// sharing.
    fn select(
        &mut self,
        samples: &Samples,
        classifier: Option<&dyn Classify>,
        rng: &mut dyn Rng,
    ) -> Option<u64>;
}

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
