//! What travels beside a picture.

use gestalt_protocol::{FrameHeader, FrameTaken, MAX_FRAME_HEADER};

use crate::memory::bounded;

/// What is read is written so that it reads the same, and says nothing that no camera does.
///
/// # Panics
/// If not.
pub fn run(bytes: &[u8]) {
    if let Ok((header, proof)) = bounded(bytes, || FrameHeader::decode_proven(bytes)) {
        assert!(bytes.len() <= MAX_FRAME_HEADER);
        assert!(header.fps > 0.0 && header.fps <= 1000.0 && header.camera.len() <= 64);
        let again = proof.as_ref().map_or_else(|| header.encode(), |proof| header.encode_proven(proof));
        assert_eq!(FrameHeader::decode_proven(&again), Ok((header, proof)));
    }
    if let Ok((taken, asked)) = bounded(bytes, || FrameTaken::decode_challenging(bytes)) {
        let again = asked.map_or_else(|| taken.encode(), |asked| taken.encode_challenging(&asked));
        assert_eq!(FrameTaken::decode_challenging(&again), Ok((taken, asked)));
    }
}
