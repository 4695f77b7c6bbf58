//! Ready vocabularies: gestures with a name, a meaning, and how a hand shows them.
//!
//! A [`GestureBook`] is what an instructor is handed: it says what to show, and what it means. Drawn hands show it, so it can be
//! looked at, trained on and experimented with before anybody raises a hand. To a swarm its gestures are names like others: they
//! are taught one by one.

mod hand_pose;

use std::collections::BTreeSet;
use std::io::Read;
use std::path::{Path, PathBuf};

use gestalt_protocol::MAX_LABEL;
use serde::{Deserialize, Serialize};
use thiserror::Error;

pub use hand_pose::{Finger, HandPose, HandPoseError, Thumb, Which};

/// The books that come with the program, by name.
const READY: [(&str, &str); 2] = [
    ("spatial", include_str!("../../vocabularies/spatial.json5")),
    ("rescue", include_str!("../../vocabularies/rescue.json5")),
];

/// No book has more gestures: as many as a swarm can tell apart.
const MOST: usize = 64;

/// No book is larger, in bytes.
const MAX_FILE: usize = 1 << 20;

/// A vocabulary that is ready to be taught.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GestureBook {
    /// What it is for, in one line.
    pub title: String,
    /// The gestures, at least two.
    pub gestures: Vec<ReadyGesture>,
}

/// One gesture of a [`GestureBook`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReadyGesture {
    /// What the swarm calls it: the label that is taught.
    pub name: String,
    /// What it asks of the robots.
    pub meaning: String,
    /// How to show it, in words.
    pub show: String,
    /// How a drawn hand shows it.
    #[serde(default)]
    pub pose: HandPose,
}

/// A vocabulary that cannot be used.
#[derive(Debug, Error)]
pub enum GestureBookError {
    /// There is no such file, nor a ready vocabulary of that name.
    #[error("cannot read the vocabulary {}: {cause}; the ready ones are {}", path.display(), GestureBook::names().join(", "))]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why not.
        cause: std::io::Error,
    },
    /// Larger than any vocabulary.
    #[error("{} has {size} bytes: a vocabulary has at most {MAX_FILE}", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size.
        size: u64,
    },
    /// No vocabulary.
    #[error("{origin} is no vocabulary: {key}: {cause}")]
    Syntax {
        /// The file or name.
        origin: String,
        /// Where in it.
        key: String,
        /// What is wrong.
        cause: String,
    },
    /// Too few gestures, or too many.
    #[error("{origin} has {count} gestures: write 2 to {MOST}")]
    Count {
        /// The file or name.
        origin: String,
        /// How many.
        count: usize,
    },
    /// A name that no gesture can have.
    #[error("{origin}: '{name}' is no name of a gesture: {fix}")]
    Name {
        /// The file or name.
        origin: String,
        /// The gesture.
        name: String,
        /// What to write instead.
        fix: &'static str,
    },
    /// A hand that cannot be held so.
    #[error("{origin}: the pose of '{name}': {cause}")]
    Pose {
        /// The file or name.
        origin: String,
        /// The gesture.
        name: String,
        /// What is wrong.
        cause: HandPoseError,
    },
}

impl GestureBook {
    /// The names of those that come with the program.
    #[must_use]
    pub fn names() -> [&'static str; 2] {
        READY.map(|(name, _)| name)
    }

    /// The book of that name, or in that file.
    ///
    /// # Errors
    /// See [`GestureBookError`].
    pub fn find(name: &str) -> Result<Self, GestureBookError> {
        match READY.iter().find(|(ready, _)| *ready == name) {
            Some((_, text)) => Self::parse(text, name),
            None => Self::read(Path::new(name)),
        }
    }

    /// The book in a file of JSON5.
    ///
    /// # Errors
    /// See [`GestureBookError`].
    pub fn read(path: &Path) -> Result<Self, GestureBookError> {
        let unreadable = |cause| GestureBookError::Unreadable { path: path.to_owned(), cause };
        let mut file = gestalt_file::open(path).map_err(unreadable)?;
        let size = file.metadata().map_err(unreadable)?.len();
        if size > MAX_FILE as u64 {
            return Err(GestureBookError::TooLarge { path: path.to_owned(), size });
        }
        let mut text = String::new();
        file.read_to_string(&mut text).map_err(unreadable)?;
        Self::parse(&text, &path.display().to_string())
    }

    /// The book that JSON5 text says; `origin` names it in errors.
    ///
    /// # Errors
    /// See [`GestureBookError`].
    pub fn parse(text: &str, origin: &str) -> Result<Self, GestureBookError> {
        let mut deserializer = json5::Deserializer::from_str(text);
        let book: Self = serde_path_to_error::deserialize(&mut deserializer).map_err(|error| {
            let (key, cause) = (error.path().to_string(), error.inner().to_string());
            GestureBookError::Syntax { origin: origin.to_owned(), key, cause }
        })?;
        book.check(origin)?;
        Ok(book)
    }

    fn check(&self, origin: &str) -> Result<(), GestureBookError> {
        let origin = || origin.to_owned();
        let count = self.gestures.len();
        if !(2..=MOST).contains(&count) {
            return Err(GestureBookError::Count { origin: origin(), count });
        }
        let mut names = BTreeSet::new();
        for ReadyGesture { name, pose, .. } in &self.gestures {
            let fix = if name.split_whitespace().collect::<Vec<_>>().join(" ") != *name || name.is_empty() {
                Some("write words with single spaces between them")
            } else if name.len() > MAX_LABEL || name.chars().any(char::is_control) {
                Some("write at most 64 bytes, without control characters")
            } else if !names.insert(name) {
                Some("another gesture has it: name them apart")
            } else {
                None
            };
            if let Some(fix) = fix {
                return Err(GestureBookError::Name { origin: origin(), name: name.clone(), fix });
            }
            pose.validate().map_err(|cause| GestureBookError::Pose {
                origin: origin(),
                name: name.clone(),
                cause,
            })?;
        }
        Ok(())
    }

    /// How each gesture is shown, in order.
    #[must_use]
    pub fn poses(&self) -> Vec<HandPose> {
        self.gestures.iter().map(|gesture| gesture.pose).collect()
    }

    /// The names, in order.
    #[must_use]
    pub fn labels(&self) -> Vec<String> {
        self.gestures.iter().map(|gesture| gesture.name.clone()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_ready_vocabulary_can_be_used_and_no_two_gestures_are_shown_alike() {
        for name in GestureBook::names() {
            let book = GestureBook::find(name).unwrap();
            assert!(book.gestures.len() >= 6, "{name}");
            for (n, gesture) in book.gestures.iter().enumerate() {
                assert!(gesture.meaning.len() > 10 && gesture.show.len() > 10, "{name}: {gesture:?}");
                assert!(book.gestures[..n].iter().all(|other| other.pose != gesture.pose), "{gesture:?}");
            }
        }
    }

    #[test]
    fn what_is_wrong_with_a_file_is_named_with_its_mend() {
        let book = |gestures: &str| {
            GestureBook::parse(&format!("{{title: 't', gestures: [{gestures}]}}"), "x.json5")
        };
        let one = "{name: 'one', meaning: 'm', show: 's'}";
        assert!(book(&format!("{one}, {}", one.replace("one", "two"))).is_ok());
        for (gestures, named) in [
            (one.to_owned(), "write 2 to 64"),
            (format!("{one}, {one}"), "name them apart"),
            (format!("{one}, {}", one.replace("one", "a  b")), "single spaces"),
            (format!("{one}, {}", one.replace("one", "")), "single spaces"),
            (format!("{one}, {}", one.replace("one", &"x".repeat(65))), "at most 64 bytes"),
            (format!("{one}, {{name: 'two', meaning: 'm', show: 's', pose: {{spread: 9}}}}"), "0..=2"),
            (format!("{one}, {{name: 'two', meaning: 'm', show: 's', pose: {{roll_deg: NaN}}}}"), "roll_deg"),
            (format!("{one}, {{name: 'two', meaning: 'm', show: 's', pose: {{index: 'bent'}}}}"), "hooked"),
            (format!("{one}, {{name: 'two', meening: 'm'}}"), "gestures[1]"),
            (format!("{one}, "), "write 2 to 64"),
            ("{".to_owned(), "x.json5"),
        ] {
            let error = book(&gestures).unwrap_err().to_string();
            assert!(error.contains(named), "{gestures}: {error}");
        }
        let missing = GestureBook::find("no/such.json5").unwrap_err().to_string();
        assert!(missing.contains("spatial") && missing.contains("no/such.json5"), "{missing}");
    }
}
