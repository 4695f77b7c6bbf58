//! A user's rules, put into a robot.

use std::fmt;
use std::sync::Arc;

use super::config::LearningConfig;
use crate::forgetting::Forgetting;
use crate::selection::Selection;

type Make<T> = Arc<dyn Fn() -> Box<T> + Send + Sync>;

/// How the rules of a training set are made, where they are not the ones that the parameters name. One that a robot
/// keeps starts empty at each start of the robot, and is told of all samples remembered: hence a way to make it.
///
/// ```
/// use gestalt_strategies::sample::HeldSamples;
/// use gestalt_strategies::{Forgetting, OwnRules};
/// use rand::Rng;
///
/// /// The first impression counts: whatever comes when the set is full goes at once.
/// #[derive(Debug)]
/// struct FirstImpression;
///
/// impl Forgetting for FirstImpression {
///     fn victim(&mut self, samples: &HeldSamples, _: &mut dyn Rng) -> Option<u64> {
///         samples.iter().next_back().map(|newest| newest.key)
///     }
/// }
///
/// // Into `LearningSetup::rules`; what is shared stays the parameters' choice.
/// let rules = OwnRules::default().forgetting(|| Box::new(FirstImpression));
/// assert_eq!(format!("{rules:?}"), "OwnRules { selection: None, forgetting: Some(FirstImpression) }");
/// ```
#[derive(Clone, Default)]
pub struct OwnRules {
    selection: Option<Make<dyn Selection>>,
    forgetting: Option<Make<dyn Forgetting>>,
}

impl OwnRules {
    /// Shares by this rule, whatever the parameters say.
    #[must_use]
    pub fn selection(mut self, make: impl Fn() -> Box<dyn Selection> + Send + Sync + 'static) -> Self {
        self.selection = Some(Arc::new(make));
        self
    }

    /// Forgets by this rule, whatever the parameters say.
    #[must_use]
    pub fn forgetting(mut self, make: impl Fn() -> Box<dyn Forgetting> + Send + Sync + 'static) -> Self {
        self.forgetting = Some(Arc::new(make));
        self
    }

    /// The rules for a set that is still empty.
    pub(super) fn make(&self, config: &LearningConfig) -> (Box<dyn Selection>, Box<dyn Forgetting>) {
        (
            self.selection.as_ref().map_or_else(|| config.selection.build(), |make| make()),
            self.forgetting.as_ref().map_or_else(|| config.forgetting.build(), |make| make()),
        )
    }
}

impl fmt::Debug for OwnRules {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("OwnRules")
            .field("selection", &self.selection.as_ref().map(|make| make()))
            .field("forgetting", &self.forgetting.as_ref().map(|make| make()))
            .finish()
    }
}
