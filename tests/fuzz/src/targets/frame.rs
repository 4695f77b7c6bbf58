//! What travels beside a picture.

use gestalt_protocol::{FrameHeader, FrameTaken, MAX_FRAME_HEADER};

use crate::memory::bounded;

/// What is read is written so that it reads the same, and says nothing that no camera does.
///
/// # Panics
/// If not.
pub fn run(bytes: &[u8]) {
    if let Ok(header) = bounded(bytes, || FrameHeader::decode(bytes)) {
        assert!(bytes.len() <= MAX_FRAME_HEADER);
        assert!(header.fps > 0.0 && header.fps <= 1000.0 && header.camera.len() <= 64);
        assert_eq!(FrameHeader::decode(&header.encode()), Ok(header));
    }
    if let Ok(taken) = bounded(bytes, || FrameTaken::decode(bytes)) {
        assert_eq!(FrameTaken::decode(&taken.encode()), Ok(taken));
    }
}
