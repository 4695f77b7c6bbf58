//! Pictures on their way from a robot without a computer to whoever looks for it.
//!
//! The payload on `robot/<id>/frame` is the encoded picture itself, so that any Zenoh client can show it; what belongs to
//! it travels beside it, as the attachment. Whoever looks says on `robot/<id>/taken` that it took a frame, and thereby
//! asks for the next one.
//!
//! In a sealed swarm whoever looks sends a [`FrameChallenge`] along, and a [`FrameProof`] answers it behind each header: a frame that was
//! recorded earlier answers no challenge of today. `gestalt-trust` makes and checks both.

use serde::{Deserialize, Serialize};

use crate::decode::{DecodeError, encode_versioned, take_versioned};
use crate::id::{RobotId, RoundId};
use crate::signature::Signature;

/// The largest encoded picture accepted, in bytes.
pub const MAX_FRAME: usize = 4 * 1024 * 1024;

/// The largest attachment of a frame and the largest acknowledgement accepted, in bytes.
pub const MAX_FRAME_HEADER: usize = 256;

/// The longest name of a camera, in bytes.
const MAX_CAMERA: usize = 64;

/// The most challenges that one frame answers: so many robots may look at one camera.
pub const MAX_CHALLENGES: usize = 8;

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

/// That a frame is its robot's and new: behind its header, in a sealed swarm.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameProof {
    /// What those asked who look at it: at most [`MAX_CHALLENGES`].
    pub challenges: Vec<u64>,
    /// The robot's, over all of it: robot, header, challenges and picture.
    pub signature: Signature,
}

/// What whoever looks asks the sender to answer, so that it knows new frames from recorded ones: behind an acknowledgement, in a
/// sealed swarm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameChallenge {
    /// Who looks.
    pub by: RobotId,
    /// A number that it drew for this robot's frames.
    pub challenge: u64,
    /// The signature of whoever looks.
    pub signature: Signature,
}

impl FrameHeader {
    /// The bytes that travel: the protocol's version byte, then postcard.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        encode_versioned(self)
    }

    /// The bytes that travel in a sealed swarm: the [header](Self::encode), the challenges in postcard, the 64 bytes of the signature.
    #[must_use]
    pub fn encode_proven(&self, proof: &FrameProof) -> Vec<u8> {
        let mut bytes = self.encode_answering(&proof.challenges);
        bytes.extend(proof.signature.as_bytes());
        bytes
    }

    /// What is signed of them: all but the signature.
    #[must_use]
    pub fn encode_answering(&self, challenges: &[u64]) -> Vec<u8> {
        appended(self.encode(), &challenges)
    }

    /// Reads what [`FrameHeader::encode`] or [`FrameHeader::encode_proven`] wrote.
    ///
    /// # Errors
    /// See [`DecodeError`]; the check of the values is part of the decoding.
    pub fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        Self::decode_proven(bytes).map(|(header, _)| header)
    }

    /// The same, with the proof, if there is one.
    ///
    /// # Errors
    /// See [`DecodeError`].
    pub fn decode_proven(bytes: &[u8]) -> Result<(Self, Option<FrameProof>), DecodeError> {
        let (header, rest): (Self, _) = take_versioned(bytes, MAX_FRAME_HEADER)?;
        if !(header.fps > 0.0 && header.fps <= 1000.0) {
            return Err(DecodeError::Impossible("frames per second, above 0 and at most 1000"));
        }
        if header.camera.len() > MAX_CAMERA || header.camera.chars().any(char::is_control) {
            return Err(DecodeError::Impossible("a camera's name, at most 64 bytes of plain text"));
        }
        let proof = signed_rest(rest)?.map(|(challenges, signature)| FrameProof { challenges, signature });
        if proof.as_ref().is_some_and(|proof| proof.challenges.len() > MAX_CHALLENGES) {
            return Err(DecodeError::Impossible("answers to more robots than may look at one camera"));
        }
        Ok((header, proof))
    }
}

impl FrameTaken {
    /// The bytes that travel: the protocol's version byte, then postcard.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        encode_versioned(self)
    }

    /// The bytes that travel in a sealed swarm: the [acknowledgement](Self::encode), who looks and the challenge in postcard, the 64
    /// bytes of the signature.
    #[must_use]
    pub fn encode_challenging(&self, challenge: &FrameChallenge) -> Vec<u8> {
        let mut bytes = appended(self.encode(), &(challenge.by, challenge.challenge));
        bytes.extend(challenge.signature.as_bytes());
        bytes
    }

    /// Reads what [`FrameTaken::encode`] or [`FrameTaken::encode_challenging`] wrote.
    ///
    /// # Errors
    /// See [`DecodeError`].
    pub fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        Self::decode_challenging(bytes).map(|(taken, _)| taken)
    }

    /// The same, with the challenge, if there is one.
    ///
    /// # Errors
    /// See [`DecodeError`].
    pub fn decode_challenging(bytes: &[u8]) -> Result<(Self, Option<FrameChallenge>), DecodeError> {
        let (taken, rest) = take_versioned(bytes, MAX_FRAME_HEADER)?;
        let challenge = signed_rest(rest)?.map(|((by, challenge), signature)| FrameChallenge {
            by,
            challenge,
            signature,
        });
        Ok((taken, challenge))
    }
}

fn appended(bytes: Vec<u8>, value: &impl Serialize) -> Vec<u8> {
    postcard::to_extend(value, bytes).expect("memory is the only thing that writing to a vector can lack")
}

/// What follows a message: nothing, or a value in postcard and a signature.
fn signed_rest<'a, T: Deserialize<'a>>(rest: &'a [u8]) -> Result<Option<(T, Signature)>, DecodeError> {
    if rest.is_empty() {
        return Ok(None);
    }
    let trailing = || DecodeError::Trailing(rest.len());
    let (value, signature) = postcard::take_from_bytes(rest).map_err(|_| trailing())?;
    let signature = signature.try_into().map_err(|_| trailing())?;
    Ok(Some((value, Signature::from_bytes(signature))))
}
