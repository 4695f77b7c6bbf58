//! What robots say to each other, as JSON: for readers and writers in languages that have no postcard.
//!
//! ```json
//! {"author": 7, "stamp": {"boot": 1, "sequence": 130}, "signature": null,
//!  "message": {"kind": "vote", "body": {"round": {"counter": 1, "opener": 2, "life": 161}, "vocabulary": 1890817326,
//!                                       "evidence": [1.5, -1.5], "looks": 2.0, "unknown": null}}}
//! ```
//!
//! Kinds are `vote`, `have`, `give`, `samples`, `know`, `lessons`, `batches`, `holding`, `announced`, `namings` and `asked`, with the fields of the types of that name in
//! `gestalt-protocol`. Vectors of samples are spelt `{"f32": […]}`, `{"f16": […]}` (as numbers) or `{"i8": […]}`. What is read
//! and written again has the same bytes.

use gestalt_protocol::{
    Announced, Asked, ClassId, DecodeError, Envelope, FeatureSpaceId, Give, Have, HeldBatch, Holding, Know,
    Lessons, MAX_JSON, Message, Namings, RobotId, RoundId, SampleId, Samples, SharedSample, Signature, Stamp,
    Vector, Vote,
};
use half::f16;
use serde::{Deserialize, Serialize};

/// The bytes of an envelope, as JSON.
///
/// # Errors
/// See [`DecodeError`].
pub fn to_json(bytes: &[u8]) -> Result<String, DecodeError> {
    let Envelope { author, stamp, message, signature } = Envelope::decode(bytes)?;
    let spelt = Spelt { author, stamp, signature, message: message.into() };
    serde_json::to_string(&spelt).map_err(|error| DecodeError::Malformed(error.to_string()))
}

/// The bytes of the envelope that this JSON spells.
///
/// # Errors
/// See [`DecodeError`]: what would be refused of the bytes is refused here.
pub fn from_json(json: &[u8]) -> Result<Vec<u8>, DecodeError> {
    if json.len() > MAX_JSON {
        return Err(DecodeError::TooLong { length: json.len(), limit: MAX_JSON });
    }
    let spelt: Spelt =
        serde_json::from_slice(json).map_err(|error| DecodeError::Malformed(error.to_string()))?;
    let Spelt { author, stamp, signature, message } = spelt;
    // On the wire numbers are steps up: what cannot be written is told apart here.
    if !message.batches().all(SpeltSamples::is_in_order) {
        return Err(DecodeError::Impossible("samples out of order, or of one number"));
    }
    let bytes = Envelope { author, stamp, message: message.into(), signature }.encode();
    Envelope::decode(&bytes)?;
    Ok(bytes)
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Spelt {
    author: RobotId,
    stamp: Stamp,
    #[serde(default)]
    signature: Option<Signature>,
    message: SpeltMessage,
}

#[derive(Serialize, Deserialize)]
#[serde(tag = "kind", content = "body", rename_all = "snake_case", deny_unknown_fields)]
enum SpeltMessage {
    Vote(Vote),
    Have(Have),
    Give(Give),
    Samples(SpeltSamples),
    Know(Know),
    Lessons(Lessons),
    Batches(SpeltBatches),
    Holding(Holding),
    Announced(Announced),
    Namings(Namings),
    Asked(Asked),
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SpeltSamples {
    space: FeatureSpaceId,
    samples: Vec<SpeltSample>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SpeltSample {
    id: SampleId,
    class: ClassId,
    round: RoundId,
    vector: SpeltVector,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum SpeltVector {
    F32(Vec<f32>),
    F16(Vec<f32>),
    I8(Vec<i8>),
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SpeltBatches {
    batches: Vec<SpeltBatch>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SpeltBatch {
    robot: RobotId,
    stamp: Stamp,
    samples: SpeltSamples,
    #[serde(default)]
    signature: Option<Signature>,
}

impl SpeltMessage {
    fn batches(&self) -> impl Iterator<Item = &SpeltSamples> {
        let (alone, held) = match self {
            Self::Samples(samples) => (Some(samples), [].as_slice()),
            Self::Batches(batches) => (None, batches.batches.as_slice()),
            _ => (None, [].as_slice()),
        };
        alone.into_iter().chain(held.iter().map(|batch| &batch.samples))
    }
}

impl SpeltSamples {
    fn is_in_order(&self) -> bool {
        self.samples.is_sorted_by(|a, b| a.id.number < b.id.number)
    }
}

impl From<Message> for SpeltMessage {
    fn from(message: Message) -> Self {
        match message {
            Message::Vote(vote) => Self::Vote(vote),
            Message::Have(have) => Self::Have(have),
            Message::Give(give) => Self::Give(give),
            Message::Samples(samples) => Self::Samples(samples.into()),
            Message::Know(know) => Self::Know(know),
            Message::Lessons(lessons) => Self::Lessons(lessons),
            Message::Batches(batches) => {
                let spelt =
                    batches.batches.into_iter().map(|HeldBatch { robot, stamp, samples, signature }| {
                        SpeltBatch { robot, stamp, samples: samples.into(), signature }
                    });
                Self::Batches(SpeltBatches { batches: spelt.collect() })
            }
            Message::Holding(holding) => Self::Holding(holding),
            Message::Announced(announced) => Self::Announced(announced),
            Message::Namings(namings) => Self::Namings(namings),
            Message::Asked(asked) => Self::Asked(asked),
        }
    }
}

impl From<SpeltMessage> for Message {
    fn from(spelt: SpeltMessage) -> Self {
        match spelt {
            SpeltMessage::Vote(vote) => Self::Vote(vote),
            SpeltMessage::Have(have) => Self::Have(have),
            SpeltMessage::Give(give) => Self::Give(give),
            SpeltMessage::Samples(samples) => Self::Samples(samples.into()),
            SpeltMessage::Know(know) => Self::Know(know),
            SpeltMessage::Lessons(lessons) => Self::Lessons(lessons),
            SpeltMessage::Batches(SpeltBatches { batches }) => {
                let held = batches.into_iter().map(|SpeltBatch { robot, stamp, samples, signature }| {
                    HeldBatch { robot, stamp, samples: samples.into(), signature }
                });
                Self::Batches(gestalt_protocol::Batches { batches: held.collect() })
            }
            SpeltMessage::Holding(holding) => Self::Holding(holding),
            SpeltMessage::Announced(announced) => Self::Announced(announced),
            SpeltMessage::Namings(namings) => Self::Namings(namings),
            SpeltMessage::Asked(asked) => Self::Asked(asked),
        }
    }
}

impl From<Samples> for SpeltSamples {
    fn from(Samples { space, samples }: Samples) -> Self {
        let spelt = samples.into_iter().map(|SharedSample { id, class, round, vector }| {
            let vector = match vector {
                Vector::F32(values) => SpeltVector::F32(values),
                Vector::F16(bytes) => {
                    let halves = bytes.chunks_exact(2).map(|half| f16::from_le_bytes([half[0], half[1]]));
                    SpeltVector::F16(halves.map(f16::to_f32).collect())
                }
                Vector::I8(steps) => SpeltVector::I8(steps),
            };
            SpeltSample { id, class, round, vector }
        });
        Self { space, samples: spelt.collect() }
    }
}

impl From<SpeltSamples> for Samples {
    fn from(SpeltSamples { space, samples }: SpeltSamples) -> Self {
        let shared = samples.into_iter().map(|SpeltSample { id, class, round, vector }| {
            let vector = match vector {
                SpeltVector::F32(values) => Vector::F32(values),
                SpeltVector::F16(values) => {
                    Vector::F16(values.into_iter().flat_map(|x| f16::from_f32(x).to_le_bytes()).collect())
                }
                SpeltVector::I8(steps) => Vector::I8(steps),
            };
            SharedSample { id, class, round, vector }
        });
        Self { space, samples: shared.collect() }
    }
}
