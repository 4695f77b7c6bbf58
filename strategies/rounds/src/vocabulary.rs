//! The gestures a swarm can tell apart.

use std::collections::BTreeMap;

use gestalt_protocol::{ClassId, MAX_CLASSES, MAX_LABEL, MAX_NAMED, Status, VocabularyId};
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

/// The ordered list of gestures that a swarm starts with, and those that were named since.
///
/// A vector with one element for each gesture has those of the list first, in its order, then the others in the order in which they were met here: see
/// [`Self::place`]. The list alone is what is written, and what names it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Vec<String>", into = "Vec<String>")]
pub struct Vocabulary {
    labels: Vec<String>,
    /// Of the labels: votes are held against it all the time.
    id: VocabularyId,
    named: Vec<ClassId>,
    titles: BTreeMap<ClassId, String>,
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
            if !(1..=MAX_LABEL).contains(&label.len()) {
                return Err(VocabularyError::Label(label.chars().take(70).collect()));
            }
            if labels[..i].contains(label) {
                return Err(VocabularyError::Repeated(label.clone()));
            }
        }
        let id = id_of(&labels);
        Ok(Self { labels, id, named: Vec::new(), titles: BTreeMap::new() })
    }

    /// The gestures that a robot says it can tell apart, with what those are called that were named since; `None` where it reports none.
    #[must_use]
    pub fn of_status(status: &Status) -> Option<Self> {
        let named = status.learning.iter().flat_map(|learning| &learning.named);
        let titles = named.map(|gesture| (gesture.class, gesture.label.clone()));
        Some(Self::new(status.vocabulary.iter().cloned()).ok()?.called(titles))
    }

    /// The labels of the list, by class.
    #[must_use]
    pub fn labels(&self) -> &[String] {
        &self.labels
    }

    /// The same, in which gestures that were named are called so: for whoever shows them.
    #[must_use]
    pub fn called(mut self, titles: impl IntoIterator<Item = (ClassId, String)>) -> Self {
        self.titles = titles.into_iter().filter(|(class, _)| class.is_named()).take(MAX_NAMED).collect();
        self
    }

    /// What all gestures are called: those of the list, then those that were named.
    #[must_use]
    pub fn shown(&self) -> Vec<String> {
        self.labels.iter().chain(self.titles.values()).cloned().collect()
    }

    /// Of how many gestures that were named it is known what they are called.
    #[must_use]
    pub fn titles(&self) -> usize {
        self.titles.len()
    }

    /// The gesture of that label, of the list before others.
    #[must_use]
    pub fn class(&self, label: &str) -> Option<ClassId> {
        let listed = (0..).map(ClassId).zip(&self.labels);
        let titled = self.titles.iter().map(|(class, title)| (*class, title));
        listed.chain(titled).find(|(_, known)| *known == label).map(|(class, _)| class)
    }

    /// How many gestures there are.
    #[must_use]
    pub fn classes(&self) -> usize {
        self.labels.len() + self.named.len()
    }

    /// Those that were named, in the order in which they were met.
    #[must_use]
    pub fn named(&self) -> &[ClassId] {
        &self.named
    }

    /// Takes in a gesture that was named, as the last; says whether there was room for it, or it was there.
    pub fn meet(&mut self, class: ClassId) -> bool {
        let known = self.named.contains(&class);
        let room = class.is_named() && self.classes() < MAX_CLASSES;
        if room && !known {
            self.named.push(class);
        }
        known || room
    }

    /// Gives the place of a gesture that was named to another one.
    pub fn rename(&mut self, class: ClassId, other: ClassId) {
        if let Some(place) = self.named.iter_mut().find(|named| **named == class && other.is_named()) {
            *place = other;
        }
    }

    /// Keeps only those that were named, the places of which are wanted.
    pub fn keep_named(&mut self, is_wanted: impl Fn(usize) -> bool) {
        let mut place = self.labels.len()..;
        self.named.retain(|_| place.next().is_some_and(&is_wanted));
    }

    /// The place of a gesture in a vector with one element for each.
    #[must_use]
    pub fn place(&self, class: ClassId) -> Option<usize> {
        if class.is_named() {
            self.named.iter().position(|named| *named == class).map(|place| self.labels.len() + place)
        } else {
            Some(class.index()).filter(|index| *index < self.labels.len())
        }
    }

    /// The gesture at that place.
    #[must_use]
    pub fn class_at(&self, place: usize) -> Option<ClassId> {
        match place.checked_sub(self.labels.len()) {
            None => Some(ClassId(place as u32)),
            Some(beyond) => self.named.get(beyond).copied(),
        }
    }

    /// All gestures, in the order of their places.
    pub fn all(&self) -> impl Iterator<Item = ClassId> + '_ {
        (0..self.labels.len() as u32).map(ClassId).chain(self.named.iter().copied())
    }

    /// The label of a gesture of the list, or what one that was named is called, if that is known.
    #[must_use]
    pub fn label(&self, class: ClassId) -> Option<&str> {
        self.labels.get(class.index()).or_else(|| self.titles.get(&class)).map(String::as_str)
    }

    /// Names this list on the wire: the CRC-32 of the labels, each followed by a zero byte.
    #[must_use]
    pub fn id(&self) -> VocabularyId {
        self.id
    }
}

fn id_of(labels: &[String]) -> VocabularyId {
    let mut hash = crc32fast::Hasher::new();
    for label in labels {
        hash.update(label.as_bytes());
        hash.update(&[0]);
    }
    VocabularyId(hash.finalize())
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
