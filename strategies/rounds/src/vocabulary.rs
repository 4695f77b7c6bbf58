//! The list of gestures a swarm can tell apart.

use gestalt_protocol::{ClassId, MAX_CLASSES, VocabularyId};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A list of labels that is no vocabulary.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum VocabularyError {
    /// Fewer than two labels: nothing to tell apart.
    #[error("a vocabulary needs at least 2 gestures, this one has {0}")]
    TooSmall(usize),
    /// More labels than a vote can carry.
    #[error("a vocabulary holds at most {MAX_CLASSES} gestures, this one has {0}")]
    TooLarge(usize),
    /// A label that is empty or longer than 64 bytes.
    #[error("'{0}' is no label: 1 to 64 bytes")]
    Label(String),
    /// The same label twice.
    #[error("the gesture '{0}' stands twice in the vocabulary")]
    Repeated(String),
}

/// The ordered list of gestures; a [`ClassId`] is an index into it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Vec<String>", into = "Vec<String>")]
pub struct Vocabulary {
    labels: Vec<String>,
}

impl Vocabulary {
    /// The vocabulary of these labels, in this order.
    ///
    /// # Errors
    /// See [`VocabularyError`].
    pub fn new(labels: impl IntoIterator<Item = impl Into<String>>) -> Result<Self, VocabularyError> {
        let labels: Vec<String> = labels.into_iter().map(Into::into).collect();
        if labels.len() < 2 {
            return Err(VocabularyError::TooSmall(labels.len()));
        }
        if labels.len() > MAX_CLASSES {
            return Err(VocabularyError::TooLarge(labels.len()));
        }
        for (i, label) in labels.iter().enumerate() {
            if !(1..=64).contains(&label.len()) {
                return Err(VocabularyError::Label(label.chars().take(70).collect()));
            }
            if labels[..i].contains(label) {
                return Err(VocabularyError::Repeated(label.clone()));
            }
        }
        Ok(Self { labels })
    }

    /// The labels, by class.
    #[must_use]
    pub fn labels(&self) -> &[String] {
        &self.labels
    }

    /// The gesture of that label.
    #[must_use]
    pub fn class(&self, label: &str) -> Option<ClassId> {
        (0..).map(ClassId).zip(&self.labels).find(|(_, known)| *known == label).map(|(class, _)| class)
    }

    /// How many gestures there are.
    #[must_use]
    pub fn classes(&self) -> usize {
        self.labels.len()
    }

    /// The label of a class, if it is one of this vocabulary.
    #[must_use]
    pub fn label(&self, class: ClassId) -> Option<&str> {
        self.labels.get(class.index()).map(String::as_str)
    }

    /// Names this list on the wire: the CRC-32 of the labels, each followed by a zero byte.
    #[must_use]
    pub fn id(&self) -> VocabularyId {
        let mut hash = crc32fast::Hasher::new();
        for label in &self.labels {
            hash.update(label.as_bytes());
            hash.update(&[0]);
        }
        VocabularyId(hash.finalize())
    }
}

impl TryFrom<Vec<String>> for Vocabulary {
    type Error = VocabularyError;

    fn try_from(labels: Vec<String>) -> Result<Self, VocabularyError> {
        Self::new(labels)
    }
}

impl From<Vocabulary> for Vec<String> {
    fn from(vocabulary: Vocabulary) -> Self {
        vocabulary.labels
    }
}
