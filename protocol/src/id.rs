//! Who, what and when: one type per meaning.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::fixed;
use crate::fnv::Fnv1a;
use crate::limits::MAX_CLASSES;

/// A text that is no valid identifier.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum IdError {
    /// Not a decimal number within the range of the identifier.
    #[error("'{0}' is not a whole number from 0 to {max}", max = u32::MAX)]
    NotANumber(String),
    /// An instructor's name that could not stand in a key expression.
    #[error("'{0}' is no instructor name: 1 to 32 of the characters A-Z a-z 0-9 _ -")]
    NotAName(String),
    /// A round that is not written as it is displayed.
    #[error("'{0}' is no round: write its counter, its opener and the opener's life, like 5@2-3f9a01c7")]
    NotARound(String),
}

/// A robot, unique in its swarm. Small numbers travel in fewer bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct RobotId(pub u32);

impl fmt::Display for RobotId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl FromStr for RobotId {
    type Err = IdError;

    fn from_str(text: &str) -> Result<Self, IdError> {
        // One spelling per robot: "+7" and "007" would be second names for the same key.
        let number: u32 = text.parse().map_err(|_| IdError::NotANumber(text.to_owned()))?;
        if number.to_string() == text { Ok(Self(number)) } else { Err(IdError::NotANumber(text.to_owned())) }
    }
}

/// A human who opens rounds and gives feedback: 1 to 32 of the characters `A-Z a-z 0-9 _ -`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct InstructorId(String);

impl InstructorId {
    /// The most characters of one.
    pub const MAX_LENGTH: usize = 32;
}

impl fmt::Display for InstructorId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl FromStr for InstructorId {
    type Err = IdError;

    fn from_str(text: &str) -> Result<Self, IdError> {
        let fits = (1..=Self::MAX_LENGTH).contains(&text.len())
            && text.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_' || b == b'-');
        if fits { Ok(Self(text.to_owned())) } else { Err(IdError::NotAName(text.chars().take(40).collect())) }
    }
}

impl TryFrom<String> for InstructorId {
    type Error = IdError;

    fn try_from(text: String) -> Result<Self, IdError> {
        text.parse()
    }
}

impl From<InstructorId> for String {
    fn from(id: InstructorId) -> String {
        id.0
    }
}

/// A gesture: its place in the list that the swarm started with or, of one that was named since, a number that follows from who
/// named it and how.
///
/// So nobody gives out numbers: all robots find the same for the same word, whenever they hear it, and two instructors who name a gesture at
/// once name two.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ClassId(pub u32);

impl ClassId {
    /// The first number of a gesture that was named. They end before twice that, so that one travels as 4 bytes: of 64 gestures two share
    /// a number once in 65,000 swarms.
    const FIRST_NAMED: u32 = 1 << 27;

    /// The gesture that this instructor names so. To name it again is to speak of the same.
    #[must_use]
    pub fn named(by: &InstructorId, label: &str) -> Self {
        let mut hash = Fnv1a::default();
        hash.add(by.0.bytes().chain([0]).chain(label.bytes()));
        Self(Self::FIRST_NAMED + hash.hash() as u32 % Self::FIRST_NAMED)
    }

    /// Whether it was named, and is not of the list.
    #[must_use]
    pub fn is_named(self) -> bool {
        (Self::FIRST_NAMED..2 * Self::FIRST_NAMED).contains(&self.0)
    }

    /// Whether it can be a gesture at all: of the largest list, or named.
    #[must_use]
    pub fn is_possible(self) -> bool {
        self.index() < MAX_CLASSES || self.is_named()
    }

    /// The position of a gesture of the list in a vector with one element for each of them. Of one that was named, a number beyond any.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

impl fmt::Display for ClassId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// One showing of a gesture: the count of rounds so far, the robot that opened it, and that robot's life.
///
/// No other showing ever has this name, though all robots were switched off meanwhile, disks were lost and clocks were wrong: counts
/// may begin anew, lives are drawn at random. Robots that open at the same time choose the same counter; such rounds merge on the
/// smallest name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct RoundId {
    /// Highest counter seen, plus one.
    pub counter: u32,
    /// Who opened it.
    pub opener: RobotId,
    /// A number that the opener drew at random when it started.
    pub life: u32,
}

impl RoundId {
    /// Whether the two can be names of one showing: of one count, and not of one robot before and after it started again.
    #[must_use]
    pub fn may_merge(&self, other: &Self) -> bool {
        self.counter == other.counter && (self.opener != other.opener || self.life == other.life)
    }
}

impl fmt::Display for RoundId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}@{}-{:08x}", self.counter, self.opener, self.life)
    }
}

impl FromStr for RoundId {
    type Err = IdError;

    /// Reads what is displayed: `5@2-3f9a01c7`.
    fn from_str(text: &str) -> Result<Self, IdError> {
        let parts = text.split_once('@').and_then(|(counter, rest)| {
            let (opener, life) = rest.split_once('-')?;
            let life = u32::from_str_radix(life, 16).ok()?;
            Some(Self { counter: counter.parse().ok()?, opener: opener.parse().ok()?, life })
        });
        parts.ok_or_else(|| IdError::NotARound(text.chars().take(40).collect()))
    }
}

/// Orders the messages of one author, also across its restarts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Stamp {
    /// Grows at every start of the author.
    pub boot: u32,
    /// Grows with every message of that boot.
    pub sequence: u32,
}

/// A sample that was shared: its author, the life of that author, and its place among all that was shared in that life.
///
/// No other sample ever has this name, as no other showing has a [`RoundId`]: whatever became of the author's disk, an old
/// copy of it put back included, and of its clock, it numbers under another life at each start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct SampleId {
    /// Who made and shared it.
    pub author: RobotId,
    /// A number that the author drew at random when it started. Any is as likely as the others, so it travels as 4 bytes.
    #[serde(with = "fixed::u32")]
    pub life: u32,
    /// Counts up from 1 without gaps.
    pub number: u32,
}

impl SampleId {
    /// The series that it is a part of.
    #[must_use]
    pub fn series(self) -> SampleSeries {
        SampleSeries { author: self.author, life: self.life }
    }
}

impl fmt::Display for SampleId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}#{}-{:08x}", self.author, self.number, self.life)
    }
}

/// All samples that one robot shares in one of its lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct SampleSeries {
    /// Who makes and shares them.
    pub author: RobotId,
    /// The author's life, see [`SampleId`].
    #[serde(with = "fixed::u32")]
    pub life: u32,
}

impl SampleSeries {
    /// The sample of that number.
    #[must_use]
    pub fn sample(self, number: u32) -> SampleId {
        SampleId { author: self.author, life: self.life, number }
    }
}

impl fmt::Display for SampleSeries {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}#-{:08x}", self.author, self.life)
    }
}

/// Names a list of gestures: votes are fused only with votes over the same list.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct VocabularyId(pub u32);

impl VocabularyId {
    /// Of no list: in a vote, its author cannot tell any gesture, for want of a classifier or of a camera that shows anything.
    pub const NONE: Self = Self(0);
}

/// Names what the components of a feature vector mean: the list of features, their scaling and their reduction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct FeatureSpaceId(#[serde(with = "fixed::u64")] pub u64);

impl fmt::Display for FeatureSpaceId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_robot_has_one_spelling() {
        assert_eq!("7".parse(), Ok(RobotId(7)));
        for other in ["+7", "007", " 7", "", "-1", "4294967296"] {
            assert!(other.parse::<RobotId>().is_err(), "{other}");
        }
    }

    #[test]
    fn a_round_is_read_as_it_is_displayed() {
        let round = RoundId { counter: 5, opener: RobotId(2), life: 0xA1 };
        assert_eq!(round.to_string(), "5@2-000000a1");
        assert_eq!(round.to_string().parse(), Ok(round));
        for bad in ["", "5", "@2", "5@", "5@x", "5@2@3", "5@2", "5@2-", "5@2-g", "5@-1"] {
            assert!(bad.parse::<RoundId>().is_err(), "{bad}");
        }
    }

    #[test]
    fn an_instructor_name_can_stand_in_a_key() {
        assert!("ada-2_B".parse::<InstructorId>().is_ok());
        for bad in ["", "a/b", "**", "naïve", &"x".repeat(33)] {
            assert!(bad.parse::<InstructorId>().is_err(), "{bad}");
        }
    }

    #[test]
    fn what_is_named_has_a_number_of_its_own_for_each_who_names_it() {
        let named = |by: &str, label| ClassId::named(&by.parse().unwrap(), label);
        assert_eq!(named("ana", "circle"), named("ana", "circle"));
        let others = [named("bob", "circle"), named("ana", "circles"), named("an", "acircle")];
        for other in others.into_iter().chain([named("ana", "")]) {
            assert_ne!(named("ana", "circle"), other);
            assert!(other.is_named() && other.is_possible() && other.index() >= MAX_CLASSES);
        }
        assert!(ClassId(63).is_possible() && !ClassId(63).is_named());
        assert!(!ClassId(64).is_possible() && !ClassId(1 << 28).is_possible());
    }

    #[test]
    fn a_restart_outranks_any_sequence() {
        assert!(Stamp { boot: 2, sequence: 0 } > Stamp { boot: 1, sequence: u32::MAX });
    }
}
