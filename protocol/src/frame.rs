//! Pictures on their way from a robot without a computer to whoever looks for it.
//!
//! The payload on `robot/<id>/frame` is the encoded picture itself, so that any Zenoh client can show it; what belongs to
//! it travels beside it, as the attachment. Whoever looks says on `robot/<id>/taken` that it took a frame, and thereby
//! asks for the next one.

use serde::{Deserialize, Serialize};

use crate::decode::{DecodeError, decode_versioned, encode_versioned};
use crate::id::RoundId;

/// The largest encoded picture accepted, in bytes.
pub const MAX_FRAME: usize = 4 * 1024 * 1024;

/// The largest attachment of a frame and the largest acknowledgement accepted, in bytes.
pub const MAX_FRAME_HEADER: usize = 256;

/// The longest name of a camera, in bytes.
const MAX_CAMERA: usize = 64;

/// How a picture is encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ImageEncoding {
    /// JPEG, ITU-T T.81.
    Jpeg,
    /// PNG, ISO/IEC 15948.
    Png,
}

/// What belongs to a frame: the attachment on `robot/<id>/frame`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameHeader {
    /// Differs at every start of the sender, so that a sequence that begins anew is told from an old frame.
    pub nonce: u64,
    /// Grows with every frame sent since that start.
    pub sequence: u32,
    /// How old the picture was when it was sent, in microseconds.
    pub age_us: u32,
    /// How the payload is encoded.
    pub encoding: ImageEncoding,
    /// Frames per second the camera takes. Range `0.0 < fps <= 1000.0`.
    pub fps: f32,
    /// Which camera, in words: at most 64 bytes, without control characters; may be empty.
    pub camera: String,
}

/// A frame was taken, and the next one may come: the payload on `robot/<id>/taken`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FrameTaken {
    /// The nonce of the frame.
    pub nonce: u64,
    /// The sequence number of the frame.
    pub sequence: u32,
    /// The round for which this robot's pictures are judged now; `None` between rounds.
    pub round: Option<RoundId>,
}

impl FrameHeader {
    /// The bytes that travel: the protocol's version byte, then postcard.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        encode_versioned(self)
    }

    /// Reads what [`FrameHeader::encode`] wrote.
    ///
    /// # Errors
    /// See [`DecodeError`]; the check of the values is part of the decoding.
    pub fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        let header: Self = decode_versioned(bytes, MAX_FRAME_HEADER)?;
        if !(header.fps > 0.0 && header.fps <= 1000.0) {
            return Err(DecodeError::Impossible("frames per second, above 0 and at most 1000"));
        }
        if header.camera.len() > MAX_CAMERA || header.camera.chars().any(char::is_control) {
            return Err(DecodeError::Impossible("a camera's name, at most 64 bytes of plain text"));
        }
        Ok(header)
    }
}

impl FrameTaken {
    /// The bytes that travel: the protocol's version byte, then postcard.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        encode_versioned(self)
    }

    /// Reads what [`FrameTaken::encode`] wrote.
    ///
    /// # Errors
    /// See [`DecodeError`].
    pub fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        decode_versioned(bytes, MAX_FRAME_HEADER)
    }
}
