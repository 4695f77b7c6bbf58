//! A classifier as a file of bytes, as `gestalt train` writes it and `gestalt peer --model` reads it.
//!
//! ```text
//! magic "GESTALT\n" │ version u16 │ length of the body u64 │ CRC-32 of the body u32 │ body (postcard)
//! ```
//! Numbers are little-endian.

use gestalt_strategies::{Classifier, MAX_MODEL, ModelError};
use serde::{Deserialize, Serialize};
use thiserror::Error;

const MAGIC: &[u8; 8] = b"GESTALT\n";
/// The layout of the file; another layout gets another number.
const VERSION: u16 = 1;
const HEADER: usize = 8 + 2 + 8 + 4;
/// Longest body that is read: a classifier, and the record of its training.
const MAX_BODY: u64 = 2 * MAX_MODEL as u64;

/// The longest file that can be a model, in bytes.
pub const MAX_MODEL_FILE: u64 = HEADER as u64 + MAX_BODY;

/// Bytes that are no model.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum ModelFileError {
    /// Something else altogether.
    #[error("not a model file: `gestalt train` writes one")]
    NotAModel,
    /// Written by another version of the program.
    #[error("the model has file version {0}, this program reads version {VERSION}: train it again")]
    Version(u16),
    /// Its end is missing.
    #[error("the model is truncated ({found} of {expected} bytes): copy it again, or train it again")]
    CutShort {
        /// Bytes of the body that are there.
        found: u64,
        /// Bytes of the body that its header promises.
        expected: u64,
    },
    /// Its contents are not those that were written.
    #[error("the model is corrupted (checksum mismatch): copy it again, or train it again")]
    Damaged,
    /// Larger than any model.
    #[error("the model declares {0} bytes; at most {MAX_BODY} are allowed")]
    TooLarge(u64),
    /// Checksum right, contents wrong: written by another program.
    #[error("the model cannot be used: {0}")]
    Contents(#[from] ModelError),
}

/// How a model came to be.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Origin {
    /// Name of the dataset.
    pub dataset: String,
    /// The people it has seen in training, by the numbers of that dataset.
    pub people: Vec<u32>,
    /// The fingerprints of the images it was shown in training, ascending.
    pub images: Vec<u64>,
    /// The seed of the training.
    pub seed: u64,
    /// C.
    pub cost: f64,
    /// γ, in units of 1 / (total variance of the reduced samples).
    pub gamma: f64,
}

/// A classifier and its origin.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelFile {
    /// What judges.
    pub classifier: Classifier,
    /// How it came to be.
    pub origin: Origin,
}

#[derive(Serialize, Deserialize)]
struct Body {
    origin: Origin,
    classifier: Vec<u8>,
}

impl ModelFile {
    /// Reads the bytes of a model file. Any bytes give a model or an error.
    ///
    /// # Errors
    /// See [`ModelFileError`].
    pub fn decode(bytes: &[u8]) -> Result<Self, ModelFileError> {
        let (header, body) = bytes.split_at_checked(HEADER).ok_or(ModelFileError::NotAModel)?;
        let (magic, rest) = header.split_at(8);
        let (version, rest) = rest.split_at(2);
        let (length, checksum) = rest.split_at(8);
        if magic != MAGIC {
            return Err(ModelFileError::NotAModel);
        }
        let version = little_endian(version) as u16;
        if version != VERSION {
            return Err(ModelFileError::Version(version));
        }
        let (expected, found) = (little_endian(length), body.len() as u64);
        if expected > MAX_BODY {
            return Err(ModelFileError::TooLarge(expected));
        }
        if found < expected {
            return Err(ModelFileError::CutShort { found, expected });
        }
        if found > expected || u64::from(crc32fast::hash(body)) != little_endian(checksum) {
            return Err(ModelFileError::Damaged);
        }
        let body: Body = postcard::from_bytes(body).map_err(|_| ModelError::Malformed)?;
        Ok(Self { classifier: Classifier::decode(&body.classifier)?, origin: body.origin })
    }

    /// The bytes of a model file.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        let body = Body { origin: self.origin.clone(), classifier: self.classifier.encode() };
        let body =
            postcard::to_allocvec(&body).expect("postcard writes every value of known length into a vector");
        let mut bytes = MAGIC.to_vec();
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend((body.len() as u64).to_le_bytes());
        bytes.extend(crc32fast::hash(&body).to_le_bytes());
        bytes.extend(body);
        bytes
    }
}

fn little_endian(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte))
}
