//! The samples that robots share, and how they tell each other which they have.

use serde::{Deserialize, Serialize};

use crate::bounded;
use crate::decode::DecodeError;
use crate::fixed;
use crate::id::{ClassId, FeatureSpaceId, RobotId, RoundId, SampleId, SampleSeries, Stamp};
use crate::lesson::{Lesson, MAX_LESSONS, Word};
use crate::limits::MAX_ROBOTS;
use crate::signature::Signature;

/// The most components of a shared vector.
pub const MAX_COMPONENTS: usize = 2048;

/// The most samples in one batch.
pub const MAX_SAMPLES: usize = 64;

/// The most bytes that the vectors of one batch take.
pub const MAX_BATCH_BYTES: usize = 32 * 1024;

/// The most batches in one message.
pub const MAX_BATCHES: usize = 1024;

/// The most intervals of sample numbers that are told of one series.
pub const MAX_INTERVALS: usize = 256;

/// A feature vector as it travels. How its numbers stand for coordinates is the feature space's matter.
#[derive(Clone, Debug, PartialEq)]
pub enum Vector {
    /// IEEE single precision, 4 bytes a component.
    F32(Vec<f32>),
    /// IEEE half precision, 2 bytes a component, the lower one first.
    F16(Vec<u8>),
    /// 1 byte a component, scaled by how far that component spreads in its feature space.
    I8(Vec<i8>),
}

impl Vector {
    /// How many components it has.
    #[must_use]
    pub fn components(&self) -> usize {
        match self {
            Self::F32(values) => values.len(),
            Self::F16(bytes) => bytes.len() / 2,
            Self::I8(values) => values.len(),
        }
    }

    /// How many bytes its components take.
    #[must_use]
    pub fn bytes(&self) -> usize {
        match self {
            Self::F32(values) => 4 * values.len(),
            Self::F16(bytes) => bytes.len(),
            Self::I8(values) => values.len(),
        }
    }

    fn check(&self) -> Result<(), DecodeError> {
        /// All exponent bits of a half: infinite, or not a number.
        const INFINITE: u8 = 0x7c;
        let sound = match self {
            Self::F32(values) => values.iter().all(|value| value.is_finite()),
            Self::F16(bytes) => {
                bytes.len().is_multiple_of(2)
                    && bytes.chunks_exact(2).all(|half| half[1] & INFINITE != INFINITE)
            }
            Self::I8(_) => true,
        };
        if !sound || self.components() == 0 {
            return Err(DecodeError::Impossible("a vector that is empty, cut or not finite"));
        }
        Ok(())
    }
}

/// A labelled feature vector, as shared.
#[derive(Clone, Debug, PartialEq)]
pub struct SharedSample {
    /// Whose sample, and which.
    pub id: SampleId,
    /// The gesture it shows, as its author was told.
    pub class: ClassId,
    /// The round it was seen in: what an instructor says of that round later is said of this sample too.
    pub round: RoundId,
    /// Its coordinates.
    pub vector: Vector,
}

/// A batch of samples of one feature space and one series, by ascending numbers; at least one. It is its author's statement:
/// whoever passes it on does so as a whole, so that the author's signature goes with it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "TravellingSamples", into = "TravellingSamples")]
pub struct Samples {
    /// What the vectors' components mean.
    pub space: FeatureSpaceId,
    /// The samples.
    pub samples: Vec<SharedSample>,
}

/// A batch as it travels: the series once, and of each sample what differs from the one before.
#[derive(Clone, Serialize, Deserialize)]
struct TravellingSamples {
    space: FeatureSpaceId,
    series: SampleSeries,
    #[serde(deserialize_with = "bounded::vec::<_, _, MAX_SAMPLES>")]
    samples: Vec<TravellingSample>,
}

#[derive(Clone, Serialize, Deserialize)]
struct TravellingSample {
    /// By how much its number is higher than that of the one before, or than 0.
    step: u32,
    class: ClassId,
    seen: Seen,
}

/// The round, if it is not that of the sample before, and the vector. One byte says of both which it is.
#[derive(Clone, Serialize, Deserialize)]
enum Seen {
    SameF32(#[serde(deserialize_with = "bounded::vec::<_, _, MAX_COMPONENTS>")] Vec<f32>),
    SameF16(#[serde(deserialize_with = "bounded::vec::<_, _, { 2 * MAX_COMPONENTS }>")] Vec<u8>),
    SameI8(#[serde(deserialize_with = "bounded::vec::<_, _, MAX_COMPONENTS>")] Vec<i8>),
    F32(RoundId, #[serde(deserialize_with = "bounded::vec::<_, _, MAX_COMPONENTS>")] Vec<f32>),
    F16(RoundId, #[serde(deserialize_with = "bounded::vec::<_, _, { 2 * MAX_COMPONENTS }>")] Vec<u8>),
    I8(RoundId, #[serde(deserialize_with = "bounded::vec::<_, _, MAX_COMPONENTS>")] Vec<i8>),
}

impl Seen {
    fn new(round: Option<RoundId>, vector: Vector) -> Self {
        match (round, vector) {
            (None, Vector::F32(values)) => Self::SameF32(values),
            (None, Vector::F16(bytes)) => Self::SameF16(bytes),
            (None, Vector::I8(values)) => Self::SameI8(values),
            (Some(round), Vector::F32(values)) => Self::F32(round, values),
            (Some(round), Vector::F16(bytes)) => Self::F16(round, bytes),
            (Some(round), Vector::I8(values)) => Self::I8(round, values),
        }
    }

    fn into_parts(self) -> (Option<RoundId>, Vector) {
        match self {
            Self::SameF32(values) => (None, Vector::F32(values)),
            Self::SameF16(bytes) => (None, Vector::F16(bytes)),
            Self::SameI8(values) => (None, Vector::I8(values)),
            Self::F32(round, values) => (Some(round), Vector::F32(values)),
            Self::F16(round, bytes) => (Some(round), Vector::F16(bytes)),
            Self::I8(round, values) => (Some(round), Vector::I8(values)),
        }
    }
}

impl From<Samples> for TravellingSamples {
    fn from(Samples { space, samples }: Samples) -> Self {
        let series =
            samples.first().map_or(SampleSeries { author: RobotId(0), life: 0 }, |first| first.id.series());
        let (mut number, mut of) = (0, None);
        let travelling = |SharedSample { id, class, round, vector }: SharedSample| {
            let step = id.number.wrapping_sub(std::mem::replace(&mut number, id.number));
            let round = (of.replace(round) != Some(round)).then_some(round);
            TravellingSample { step, class, seen: Seen::new(round, vector) }
        };
        Self { space, series, samples: samples.into_iter().map(travelling).collect() }
    }
}

impl TryFrom<TravellingSamples> for Samples {
    type Error = &'static str;

    fn try_from(
        TravellingSamples { space, series, samples }: TravellingSamples,
    ) -> Result<Self, Self::Error> {
        let (mut number, mut of) = (0_u32, None);
        let shared = |TravellingSample { step, class, seen }: TravellingSample| {
            let (round, vector) = seen.into_parts();
            number = number.checked_add(step).ok_or("a sample beyond the last number")?;
            of = round.or(of);
            let round = of.ok_or("a sample of no round")?;
            Ok(SharedSample { id: series.sample(number), class, round, vector })
        };
        Ok(Self { space, samples: samples.into_iter().map(shared).collect::<Result<_, _>>()? })
    }
}

impl Samples {
    /// The name of the first of them, which names the batch.
    #[must_use]
    pub fn first(&self) -> Option<SampleId> {
        self.samples.first().map(|sample| sample.id)
    }

    /// Whether there are some, and all are that robot's own.
    #[must_use]
    pub fn are_by(&self, robot: RobotId) -> bool {
        !self.samples.is_empty() && self.samples.iter().all(|sample| sample.id.author == robot)
    }

    pub(crate) fn check(&self) -> Result<(), DecodeError> {
        let of_one_series = |pair: &[SharedSample]| {
            pair[0].id.series() == pair[1].id.series() && pair[0].id.number < pair[1].id.number
        };
        if self.samples.is_empty() || !self.samples.windows(2).all(of_one_series) {
            return Err(DecodeError::Impossible("a batch of no samples, of several series, or out of order"));
        }
        if self.samples.iter().map(|sample| sample.vector.bytes()).sum::<usize>() > MAX_BATCH_BYTES {
            return Err(DecodeError::Impossible("a batch beyond the largest"));
        }
        for sample in &self.samples {
            if !sample.class.is_possible() {
                return Err(DecodeError::Impossible("a gesture that can be none"));
            }
            if sample.id.number == 0 {
                return Err(DecodeError::Impossible("a sample of number 0"));
            }
            sample.vector.check()?;
        }
        Ok(())
    }
}

/// A batch of samples as its author stamped it, held and passed on by another robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldBatch {
    /// Who shared it: the author of all of them.
    pub robot: RobotId,
    /// The author's stamp on it.
    pub stamp: Stamp,
    /// The samples.
    pub samples: Samples,
    /// The author's signature under the [`Envelope`](crate::Envelope) that it came in.
    pub signature: Option<Signature>,
}

impl HeldBatch {
    /// Whether every value is one that a robot may say, and the samples are the author's.
    ///
    /// # Errors
    /// [`DecodeError::Impossible`] names what is wrong.
    pub fn check(&self) -> Result<(), DecodeError> {
        self.samples.check()?;
        match self.samples.are_by(self.robot) {
            true => Ok(()),
            false => Err(DecodeError::Impossible("samples in another's name")),
        }
    }
}

/// To one neighbour: batches of which it lacks a sample.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Batches {
    /// Each as its author said it.
    #[serde(deserialize_with = "bounded::vec::<_, _, MAX_BATCHES>")]
    pub batches: Vec<HeldBatch>,
}

/// What a robot knows, in two numbers: if what the reader knows gives the same under that key, there is nothing to tell each
/// other.
///
/// The key is drawn anew whenever what the robot knows has changed. So whoever wants two robots to take different knowledge for
/// the same, and chooses names and words for it, does not know the key that they are to agree under: of two robots that
/// compare, the one that learned something last has drawn its key after that. It is no secret once said, and proves nothing
/// of who said it: a robot that lies about its own knowledge still can, and deprives others of nothing but its own help.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Digest {
    /// Under which key.
    #[serde(with = "fixed::u64")]
    pub key: u64,
    /// Over the ids of all samples it ever had.
    #[serde(with = "fixed::u64")]
    pub samples: u64,
    /// Over all that instructors said, and named.
    #[serde(with = "fixed::u64")]
    pub lessons: u64,
}

/// Which samples of one series a robot ever had.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Known {
    /// Whose samples, of which life.
    pub series: SampleSeries,
    /// Their numbers, first to last of each interval; ascending, and with gaps between them.
    #[serde(deserialize_with = "bounded::vec::<_, _, MAX_INTERVALS>")]
    pub numbers: Vec<(u32, u32)>,
}

/// To one neighbour: all that the author knows, in short, so that each can give the other what it lacks.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Know {
    /// The samples it ever had, by series, ascending.
    #[serde(deserialize_with = "bounded::vec::<_, _, MAX_ROBOTS>")]
    pub samples: Vec<Known>,
    /// What instructors said of each round, as a digest under the key of `digest`.
    #[serde(deserialize_with = "bounded::vec::<_, _, MAX_LESSONS>")]
    pub lessons: Vec<(RoundId, u64)>,
    /// What instructors named, as a digest under the key of `digest`.
    #[serde(with = "fixed::u64")]
    pub named: u64,
    /// All in short. Where its author takes the reader to know the same, the list is left out.
    pub digest: Digest,
    /// Whether this is itself an answer to a [`Know`]; such a one is answered with what is lacking only.
    pub answer: bool,
    /// The digest in the [`Know`] that this answers, if its author had nothing to give for it: the reader need not ask
    /// again until either's digest has changed. The lists are empty then.
    pub nothing_for: Option<Digest>,
}

impl Know {
    pub(crate) fn check(&self) -> Result<(), DecodeError> {
        let apart = |numbers: &[(u32, u32)]| {
            numbers.iter().all(|(first, last)| (1..=*last).contains(first))
                && numbers
                    .windows(2)
                    .all(|pair| pair[0].1.checked_add(1).is_some_and(|next| next < pair[1].0))
        };
        if !self.samples.is_sorted_by(|a, b| a.series < b.series) {
            return Err(DecodeError::Impossible("a series of samples twice, or out of order"));
        }
        if !self.samples.iter().all(|known| apart(&known.numbers)) {
            return Err(DecodeError::Impossible("intervals of sample numbers that overlap, or none of them"));
        }
        Ok(())
    }
}

/// To one neighbour: what instructors said and it has not heard.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Lessons {
    /// One for each instructor and round.
    #[serde(deserialize_with = "bounded::vec::<_, _, MAX_LESSONS>")]
    pub lessons: Vec<Lesson>,
}

impl Lessons {
    pub(crate) fn check(&self) -> Result<(), DecodeError> {
        let possible = |lesson: &Lesson| match lesson.word {
            Word::Was(class) | Word::Not(class) => class.is_possible(),
            Word::Retracted => true,
        };
        if !self.lessons.iter().all(possible) {
            return Err(DecodeError::Impossible("a gesture that can be none"));
        }
        Ok(())
    }
}
