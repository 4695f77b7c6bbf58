//! What a robot must not forget over a restart, as records that any key-value store can keep.

use std::sync::Arc;

use gestalt_protocol::{
    ClassId, DecodeError, Envelope, Fate, FeatureSpaceId, HeldBatch, InstructorId, Lesson, Message, Naming,
    PROTOCOL_VERSION, RobotId, RoundId, SampleId, SampleSeries, SignedWord, VocabularyId, Word,
};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use thiserror::Error;

use super::unresolved::{LAST_NUMBER, UnresolvedSample};
use crate::sample::{HeldSample, SeenSamples, SetPart};

/// One change of a robot's memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordChange {
    /// Which record.
    pub key: Vec<u8>,
    /// What it now holds; `None` when it is gone.
    pub value: Option<Vec<u8>>,
}

/// Records that are no memory of this robot.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum MemoryError {
    /// Written by another version of the program.
    #[error(
        "the memory has layout {0}, this program reads layout {LAYOUT}: move the file away, or run the release that wrote it"
    )]
    Layout(u8),
    /// With samples as another version of the protocol has them.
    #[error(
        "the memory has samples of version {0} of the protocol, this program speaks version {PROTOCOL_VERSION}: run the release that wrote it, or move the file away"
    )]
    Protocol(u8),
    /// Of another robot.
    #[error("the memory is robot {found}'s, this is robot {expected}: give each robot a file of its own")]
    Robot {
        /// Whose it is.
        found: RobotId,
        /// Who reads it.
        expected: RobotId,
    },
    /// Of another feature space.
    #[error(
        "the memory is of feature space {found}, the model is of {expected}: start with the model it was made with, or move the file away"
    )]
    Space {
        /// The memory's.
        found: FeatureSpaceId,
        /// The model's.
        expected: FeatureSpaceId,
    },
    /// Of another vocabulary.
    #[error(
        "the memory is of another list of gestures than the model: start with the model it was made with, or move the file away"
    )]
    Vocabulary,
    /// A record that says nothing, or contradicts another.
    #[error("the memory is damaged: {0}; move the file away")]
    Damaged(&'static str),
}

/// The layout of the records; another layout gets another number.
const LAYOUT: u8 = 3;

/// Whose memory it is, and of what.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Owner {
    layout: u8,
    robot: RobotId,
    space: FeatureSpaceId,
    vocabulary: VocabularyId,
}

impl Owner {
    pub fn new(robot: RobotId, space: FeatureSpaceId, vocabulary: VocabularyId) -> Self {
        Self { layout: LAYOUT, robot, space, vocabulary }
    }
}

/// Numbers that must never be used twice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Counters {
    pub next_key: u64,
    pub next_aside: u64,
}

/// Which record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Item {
    Owner,
    Counters,
    Sample(u64),
    Seen(SampleSeries),
    Lessons(RoundId),
    /// What was said of a gesture that was named.
    Naming(ClassId),
    Aside(u64),
    /// The batch that begins with that sample.
    Batch(SampleId),
}

#[derive(Serialize, Deserialize)]
struct StoredSample {
    part: u8,
    id: Option<SampleId>,
    class: ClassId,
    round: RoundId,
    vector: Vec<f32>,
}

#[derive(Serialize, Deserialize)]
struct StoredAside {
    part: u8,
    shared: Option<SampleId>,
    round: RoundId,
    vector: Vec<f32>,
    guess: Option<ClassId>,
}

/// An instructor's word on a round, with its count and time.
type StoredWord = (InstructorId, u64, u64, Word);

/// What was said of a gesture: who named it and how, the count and the time of the word, who said that, and what became of it.
type StoredNaming = (InstructorId, String, u64, u64, InstructorId, Fate);

impl Item {
    /// The record's key: a byte for the kind, then its number in big-endian order.
    pub fn key(self) -> Vec<u8> {
        match self {
            Self::Owner => vec![0],
            Self::Counters => vec![1],
            Self::Sample(key) => [&[2][..], &key.to_be_bytes()].concat(),
            Self::Seen(SampleSeries { author, life }) => {
                [&[3][..], [author.0, life].map(u32::to_be_bytes).as_flattened()].concat()
            }
            Self::Lessons(round) => {
                let parts = [round.counter, round.opener.0, round.life].map(u32::to_be_bytes);
                [&[4][..], parts.as_flattened()].concat()
            }
            Self::Naming(gesture) => [&[7][..], &gesture.0.to_be_bytes()].concat(),
            Self::Aside(number) => [&[5][..], &number.to_be_bytes()].concat(),
            Self::Batch(SampleId { author, life, number }) => {
                [&[6][..], [author.0, life, number].map(u32::to_be_bytes).as_flattened()].concat()
            }
        }
    }

    fn read(key: &[u8]) -> Option<Self> {
        let (kind, number) = key.split_first()?;
        let word = |bytes: &[u8]| Some(u32::from_be_bytes(bytes.try_into().ok()?));
        let three = |bytes: &[u8]| {
            let (first, rest) = bytes.split_at_checked(4)?;
            let (second, third) = rest.split_at_checked(4)?;
            Some([word(first)?, word(second)?, word(third)?])
        };
        let long = |bytes: &[u8]| Some(u64::from_be_bytes(bytes.try_into().ok()?));
        match kind {
            0 if number.is_empty() => Some(Self::Owner),
            1 if number.is_empty() => Some(Self::Counters),
            2 => long(number).map(Self::Sample),
            3 => {
                let (author, life) = number.split_at_checked(4)?;
                Some(Self::Seen(SampleSeries { author: RobotId(word(author)?), life: word(life)? }))
            }
            4 => {
                let [counter, opener, life] = three(number)?;
                Some(Self::Lessons(RoundId { counter, opener: RobotId(opener), life }))
            }
            5 => long(number).map(Self::Aside),
            6 => {
                let [author, life, number] = three(number)?;
                Some(Self::Batch(SampleId { author: RobotId(author), life, number }))
            }
            7 => word(number).map(|gesture| Self::Naming(ClassId(gesture))),
            _ => None,
        }
    }
}

pub(super) fn encode<T: Serialize>(value: &T) -> Vec<u8> {
    postcard::to_stdvec(value).expect("memory is the only thing that writing to a vector can lack")
}

pub(super) fn encode_sample(sample: &HeldSample) -> Vec<u8> {
    let HeldSample { part, id, class, round, vector, .. } = sample;
    encode(&StoredSample {
        part: part_number(*part),
        id: *id,
        class: *class,
        round: *round,
        vector: vector.to_vec(),
    })
}

pub(super) fn encode_aside(aside: &UnresolvedSample) -> Vec<u8> {
    let UnresolvedSample { part, shared, round, vector, guess } = aside;
    encode(&StoredAside {
        part: part_number(*part),
        shared: *shared,
        round: *round,
        vector: vector.to_vec(),
        guess: *guess,
    })
}

/// The words, and behind them their proofs, one for each: releases before there were any wrote, and read, the words alone.
pub(super) fn encode_lessons(lessons: impl Iterator<Item = Lesson>) -> Vec<u8> {
    let stored = |lesson: Lesson| ((lesson.instructor, lesson.count, lesson.at, lesson.word), lesson.said);
    let stored: (Vec<StoredWord>, Vec<Option<SignedWord>>) = lessons.map(stored).unzip();
    encode(&stored)
}

fn decode_lessons(round: RoundId, bytes: &[u8]) -> Result<impl Iterator<Item = Lesson>, MemoryError> {
    let (words, rest): (Vec<StoredWord>, _) = decode_first(bytes)?;
    let proofs: Vec<Option<SignedWord>> =
        if rest.is_empty() { vec![None; words.len()] } else { decode(rest)? };
    if proofs.len() != words.len() {
        return Err(MemoryError::Damaged("words and proofs that are not as many"));
    }
    Ok(words.into_iter().zip(proofs).map(move |((instructor, count, at, word), said)| Lesson {
        round,
        instructor,
        count,
        at,
        word,
        said,
    }))
}

/// The same of what was named; and behind it the word by which it was, if that is another.
pub(super) fn encode_naming(naming: &Naming, first: Option<&Naming>) -> Vec<u8> {
    let Naming { by, label, count, at, said_by, fate, said } = naming;
    let mut bytes = encode(&((by, label, count, at, said_by, fate), said));
    bytes.extend(first.map(|Naming { count, at, said, .. }| encode(&(count, at, said))).unwrap_or_default());
    bytes
}

/// The word by which it was named before the latest.
fn decode_naming(bytes: &[u8]) -> Result<[Option<Naming>; 2], MemoryError> {
    let ((by, label, count, at, said_by, fate), rest): (StoredNaming, _) = decode_first(bytes)?;
    let (said, rest) = if rest.is_empty() { (None, rest) } else { decode_first(rest)? };
    let first: Option<(u64, u64, Option<SignedWord>)> =
        if rest.is_empty() { None } else { Some(decode(rest)?) };
    let first = first.map(|(count, at, said)| {
        let (by, label) = (by.clone(), label.clone());
        Naming { said_by: by.clone(), by, label, count, at, fate: Fate::InUse, said }
    });
    Ok([first, Some(Naming { by, label, count, at, said_by, fate, said })])
}

fn part_number(part: SetPart) -> u8 {
    match part {
        SetPart::Personal => 0,
        SetPart::Shared => 1,
        SetPart::External => 2,
    }
}

fn part_of(number: u8) -> Option<SetPart> {
    [SetPart::Personal, SetPart::Shared, SetPart::External].get(usize::from(number)).copied()
}

/// A robot's memory as it was read back, not yet compared with the robot.
#[derive(Clone, Debug, Default)]
pub struct RobotMemory {
    owner: Option<Owner>,
    pub(super) counters: Counters,
    pub(crate) samples: Vec<HeldSample>,
    pub(crate) seen: SeenSamples,
    pub(super) lessons: Vec<Lesson>,
    pub(super) namings: Vec<Naming>,
    pub(super) aside: Vec<(u64, UnresolvedSample)>,
    pub(super) batches: Vec<HeldBatch>,
}

impl RobotMemory {
    /// Reads the records that the changes, one after the other, have left; an empty memory of none.
    ///
    /// # Errors
    /// [`MemoryError::Layout`] and [`MemoryError::Damaged`].
    pub fn read<'a>(records: impl IntoIterator<Item = (&'a [u8], &'a [u8])>) -> Result<Self, MemoryError> {
        let mut memory = Self::default();
        let mut seen: Vec<(SampleSeries, Vec<(u32, u32)>)> = Vec::new();
        for (key, value) in records {
            match Item::read(key).ok_or(MemoryError::Damaged("an unknown record"))? {
                Item::Owner => {
                    let layout = value.first().copied().ok_or(MemoryError::Damaged("an empty head"))?;
                    if layout != LAYOUT {
                        return Err(MemoryError::Layout(layout));
                    }
                    memory.owner = Some(decode(value)?);
                }
                Item::Counters => memory.counters = decode(value)?,
                Item::Sample(key) => {
                    let StoredSample { part, id, class, round, vector } = decode(value)?;
                    let part = part_of(part).ok_or(MemoryError::Damaged("a sample of no part"))?;
                    let vector = Arc::from(finite(vector)?);
                    memory.samples.push(HeldSample { key, part, id, class, round, vector });
                }
                Item::Seen(series) => seen.push((series, decode(value)?)),
                Item::Lessons(round) => {
                    memory.lessons.extend(decode_lessons(round, value)?);
                }
                Item::Naming(_) => memory.namings.extend(decode_naming(value)?.into_iter().flatten()),
                Item::Batch(first) => memory.batches.push(decode_batch(first, value)?),
                Item::Aside(number) => {
                    let StoredAside { part, shared, round, vector, guess } = decode(value)?;
                    let part = part_of(part).ok_or(MemoryError::Damaged("a sample of no part"))?;
                    memory.aside.push((
                        number,
                        UnresolvedSample { part, shared, round, vector: Arc::from(finite(vector)?), guess },
                    ));
                }
            }
        }
        memory.seen =
            SeenSamples::from_stored(seen).map_err(|_| MemoryError::Damaged("impossible sample numbers"))?;
        Ok(memory)
    }

    /// Whether nothing was ever written to it.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.owner.is_none()
    }

    /// The highest count of a round that this robot saw something of itself, or heard spoken of: of rounds that anybody may have made up nothing is written.
    /// What others say they saw is not looked at: of that nobody checks the count.
    pub(crate) fn newest_counter(&self) -> Option<u32> {
        let own = self.samples.iter().filter(|sample| sample.part == SetPart::Personal);
        let rounds = own.map(|sample| sample.round);
        let rounds = rounds.chain(self.lessons.iter().map(|lesson| lesson.round));
        let aside = self.aside.iter().filter(|(_, aside)| aside.part == SetPart::Personal);
        rounds.chain(aside.map(|(_, aside)| aside.round)).map(|round| round.counter).max()
    }

    /// Whether it holds nothing, whoever it is of.
    fn is_bare(&self) -> bool {
        let Self { owner: _, counters, samples, seen, lessons, namings, aside, batches } = self;
        *counters == Counters::default()
            && samples.is_empty()
            && seen.series_count() == 0
            && lessons.is_empty()
            && namings.is_empty()
            && aside.is_empty()
            && batches.is_empty()
    }

    pub(super) fn check(&self, owner: Owner, components: usize, classes: usize) -> Result<(), MemoryError> {
        let Some(found) = self.owner else {
            return if self.is_bare() { Ok(()) } else { Err(MemoryError::Damaged("records without a head")) };
        };
        if found.robot != owner.robot {
            return Err(MemoryError::Robot { found: found.robot, expected: owner.robot });
        }
        if found.space != owner.space {
            return Err(MemoryError::Space { found: found.space, expected: owner.space });
        }
        if found.vocabulary != owner.vocabulary {
            return Err(MemoryError::Vocabulary);
        }
        let vectors = self.samples.iter().map(|sample| &sample.vector);
        let mut vectors = vectors.chain(self.aside.iter().map(|(_, aside)| &aside.vector));
        if !vectors.all(|vector| vector.len() == components) {
            return Err(MemoryError::Damaged("a vector of another length"));
        }
        let labels = self.samples.iter().map(|sample| sample.class);
        let mut labels = labels.chain(self.aside.iter().filter_map(|(_, aside)| aside.guess));
        if !labels.all(|class| class.is_named() || class.index() < classes) {
            return Err(MemoryError::Damaged("a sample of an unknown class"));
        }
        // Nobody puts so many aside, and those to come would have no numbers.
        let mut numbers = self.aside.iter().map(|(number, _)| *number).chain([self.counters.next_aside]);
        if numbers.any(|number| number > LAST_NUMBER) {
            return Err(MemoryError::Damaged("a sample put aside under a number that none can have"));
        }
        Ok(())
    }
}

/// A batch as it would travel, signature and all.
pub(super) fn encode_batch(batch: &HeldBatch) -> Vec<u8> {
    Envelope::from(batch.clone()).encode()
}

fn decode_batch(first: SampleId, bytes: &[u8]) -> Result<HeldBatch, MemoryError> {
    match Envelope::decode(bytes) {
        Ok(Envelope { author: robot, stamp, message: Message::Samples(samples), signature })
            if samples.first() == Some(first) =>
        {
            Ok(HeldBatch { robot, stamp, samples, signature })
        }
        Err(DecodeError::Version { found }) => Err(MemoryError::Protocol(found)),
        _ => Err(MemoryError::Damaged("a batch of samples that is none")),
    }
}

fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, MemoryError> {
    decode_first(bytes).map(|(value, _)| value)
}

/// A value, and what stands behind it.
fn decode_first<T: DeserializeOwned>(bytes: &[u8]) -> Result<(T, &[u8]), MemoryError> {
    postcard::take_from_bytes(bytes).map_err(|_| MemoryError::Damaged("a record that cannot be read"))
}

fn finite(vector: Vec<f32>) -> Result<Vec<f32>, MemoryError> {
    if vector.iter().all(|x| x.is_finite()) {
        Ok(vector)
    } else {
        Err(MemoryError::Damaged("a vector that is not finite"))
    }
}
