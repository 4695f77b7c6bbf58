//! The file of a network's weights: `GESTNET1`.
//!
//! ```text
//! "GESTNET1" │ number of tensors, u32 │ the length of each, u32 │ all values, IEEE half precision │ CRC-32 of all before
//! ```
//!
//! Little-endian. Weights are followed by the biases of the same layer, layer after layer in the order each network names.

use half::f16;
use thiserror::Error;

const MAGIC: &[u8; 8] = b"GESTNET1";
const CHECKSUM: usize = size_of::<u32>();

/// Why a file holds no weights of the network asked for.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum WeightsError {
    /// It does not begin as such files do.
    #[error("no file of network weights: it does not begin with GESTNET1")]
    Magic,
    /// It is shorter or longer than it says itself.
    #[error("weights of {found} bytes, where their header says {expected}: the file is damaged")]
    Size {
        /// Bytes that the header speaks of.
        expected: usize,
        /// Bytes there are.
        found: usize,
    },
    /// Its bytes have changed since it was written.
    #[error("weights whose checksum is {found:08x}, not {expected:08x}: the file is damaged")]
    Checksum {
        /// What was written.
        expected: u32,
        /// What its bytes give.
        found: u32,
    },
    /// It is of another network.
    #[error("{found} tensors, where the network has {expected}: these are weights of another network")]
    Count {
        /// The network's.
        expected: usize,
        /// The file's.
        found: usize,
    },
    /// It is of a network whose layers have other widths.
    #[error(
        "tensor {tensor} has {found} values, where the network has {expected}: these are weights of another network"
    )]
    Length {
        /// Which one, from 0.
        tensor: usize,
        /// The network's.
        expected: usize,
        /// The file's.
        found: usize,
    },
    /// A weight is infinite or no number: its training failed.
    #[error("tensor {tensor} holds a value that is not finite")]
    NotFinite {
        /// Which one, from 0.
        tensor: usize,
    },
}

/// The tensors of a file, taken layer by layer.
#[derive(Debug)]
pub struct Tensors {
    tensors: Vec<Vec<f32>>,
    taken: usize,
}

impl Tensors {
    /// Decodes a file of that many tensors.
    pub fn decode(bytes: &[u8], count: usize) -> Result<Self, WeightsError> {
        let rest = bytes.strip_prefix(MAGIC).ok_or(WeightsError::Magic)?;
        let size = |header: usize, values: usize| {
            let expected = MAGIC.len() + header + size_of::<f16>() * values + CHECKSUM;
            WeightsError::Size { expected, found: bytes.len() }
        };
        let (found, rest) = number(rest).ok_or_else(|| size(size_of::<u32>(), 0))?;
        if found != count {
            return Err(WeightsError::Count { expected: count, found });
        }
        let header = size_of::<u32>() * (1 + count);
        let mut lengths = Vec::with_capacity(count);
        let mut rest = rest;
        for _ in 0..count {
            let length;
            (length, rest) = number(rest).ok_or_else(|| size(header, 0))?;
            lengths.push(length);
        }
        let total = lengths.iter().fold(0_usize, |sum, length| sum.saturating_add(*length));
        // More than the file can hold is said as that, before it can overflow.
        if total > bytes.len() || rest.len() != size_of::<f16>() * total + CHECKSUM {
            return Err(size(header, total.min(bytes.len())));
        }
        let (content, checksum) = bytes.split_at(bytes.len() - CHECKSUM);
        let (expected, found) = (
            checksum.iter().rev().fold(0, |sum, byte| sum << 8 | u32::from(*byte)),
            crc32fast::hash(content),
        );
        if expected != found {
            return Err(WeightsError::Checksum { expected, found });
        }
        let mut values = rest.chunks_exact(2).map(|half| f16::from_le_bytes([half[0], half[1]]).to_f32());
        let tensors: Vec<Vec<f32>> =
            lengths.iter().map(|length| values.by_ref().take(*length).collect()).collect();
        match tensors.iter().position(|tensor| tensor.iter().any(|value| !value.is_finite())) {
            Some(tensor) => Err(WeightsError::NotFinite { tensor }),
            None => Ok(Self { tensors, taken: 0 }),
        }
    }

    /// The next tensor, which the network expects to have that many values.
    pub fn take(&mut self, expected: usize) -> Result<Vec<f32>, WeightsError> {
        let (tensor, count) = (self.taken, self.tensors.len());
        let values =
            self.tensors.get_mut(tensor).ok_or(WeightsError::Count { expected: tensor + 1, found: count })?;
        self.taken += 1;
        if values.len() != expected {
            return Err(WeightsError::Length { tensor, expected, found: values.len() });
        }
        Ok(std::mem::take(values))
    }
}

/// The number at the beginning, and what follows it.
fn number(bytes: &[u8]) -> Option<(usize, &[u8])> {
    let (number, rest) = bytes.split_first_chunk()?;
    Some((usize::try_from(u32::from_le_bytes(*number)).ok()?, rest))
}
