//! Which gestures are possible.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use gestalt_protocol::{ClassId, Word};

/// A set of classes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Candidates {
    pub(crate) classes: BTreeSet<ClassId>,
    /// Which gestures were found to be the same as another, and as which.
    merged: Arc<BTreeMap<ClassId, ClassId>>,
}

impl Candidates {
    /// These.
    #[must_use]
    pub fn of(classes: impl IntoIterator<Item = ClassId>) -> Self {
        Self { classes: classes.into_iter().collect(), merged: Arc::default() }
    }

    /// The same, where each of these gestures is by now another one.
    pub(crate) fn with_merged(self, merged: impl IntoIterator<Item = (ClassId, ClassId)>) -> Self {
        Self { merged: Arc::new(merged.into_iter().collect()), ..self }
    }

    /// Whether that class is one of them.
    #[must_use]
    pub fn contains(&self, class: ClassId) -> bool {
        self.classes.contains(&class)
    }

    /// The only one, if it is one.
    #[must_use]
    pub fn only(&self) -> Option<ClassId> {
        self.classes.first().copied().filter(|_| self.classes.len() == 1)
    }

    /// That one alone, by all the names that it has had.
    pub(crate) fn all_names_of(&self, class: ClassId) -> Self {
        let classes = [class, now(&self.merged, class)].into();
        Self { classes, merged: self.merged.clone() }.by_all_names()
    }

    /// These, by all the names that they have had: votes of before go by those.
    pub(crate) fn by_all_names(mut self) -> Self {
        let others = self.merged.iter().filter(|(_, now)| self.classes.contains(now));
        let others: Vec<ClassId> = others.map(|(before, _)| *before).collect();
        self.classes.extend(others);
        self
    }

    /// Whether both are one gesture by now.
    pub(crate) fn are_one(&self, one: ClassId, other: ClassId) -> bool {
        now(&self.merged, one) == now(&self.merged, other)
    }

    /// Who denies a gesture denies what it has become, and whatever else has become that.
    pub(crate) fn restrict(&mut self, word: Word) {
        match word {
            Word::Was(class) => self.classes.retain(|candidate| *candidate == class),
            Word::Not(class) => {
                let Self { classes, merged } = self;
                classes.retain(|candidate| now(merged, *candidate) != now(merged, class));
            }
            Word::Retracted => {}
        }
    }
}

/// What a gesture is by now.
fn now(merged: &BTreeMap<ClassId, ClassId>, class: ClassId) -> ClassId {
    merged.get(&class).copied().unwrap_or(class)
}
