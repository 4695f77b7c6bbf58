//! Which gestures are possible.

use std::collections::BTreeSet;

use gestalt_protocol::{ClassId, Word};

/// A set of classes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Candidates(pub(crate) BTreeSet<ClassId>);

impl Candidates {
    /// These.
    #[must_use]
    pub fn of(classes: impl IntoIterator<Item = ClassId>) -> Self {
        Self(classes.into_iter().collect())
    }

    /// Whether that class is one of them.
    #[must_use]
    pub fn contains(&self, class: ClassId) -> bool {
        self.0.contains(&class)
    }

    /// The only one, if it is one.
    #[must_use]
    pub fn only(&self) -> Option<ClassId> {
        self.0.first().copied().filter(|_| self.0.len() == 1)
    }

    pub(crate) fn restrict(&mut self, word: Word) {
        match word {
            Word::Was(class) => self.0.retain(|candidate| *candidate == class),
            Word::Not(class) => {
                self.0.remove(&class);
            }
            Word::Retracted => {}
        }
    }
}
