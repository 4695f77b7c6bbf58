//! What travels beside a picture: the bytes once and for all, and the bounds of reading it.

use gestalt_protocol::{
    DecodeError, FrameHeader, FrameTaken, ImageEncoding, MAX_FRAME_HEADER, RobotId, RoundId,
};
use proptest::prelude::*;

fn header() -> FrameHeader {
    FrameHeader {
        nonce: 300,
        sequence: 7,
        age_us: 12_000,
        encoding: ImageEncoding::Jpeg,
        fps: 30.0,
        camera: "parrot".to_owned(),
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[test]
fn a_frames_header() {
    // version, nonce, sequence, age (varints), encoding, f32 in little-endian order, name with its length
    let bytes = "03 ac02 07 e05d 00 0000f041 06 706172726f74".replace(' ', "");
    assert_eq!(hex(&header().encode()), bytes);
    assert_eq!(FrameHeader::decode(&header().encode()), Ok(header()));
}

#[test]
fn an_acknowledgement() {
    let round = Some(RoundId { counter: 300, opener: RobotId(2), life: 0xA1 });
    for (taken, bytes) in [
        (FrameTaken { nonce: 300, sequence: 7, round }, "03 ac02 07 01 ac02 02 a101"),
        (FrameTaken { nonce: 300, sequence: 7, round: None }, "03 ac02 07 00"),
    ] {
        assert_eq!(hex(&taken.encode()), bytes.replace(' ', ""));
        assert_eq!(FrameTaken::decode(&taken.encode()), Ok(taken));
    }
}

#[test]
fn what_no_camera_says_is_refused() {
    for fps in [0.0, -1.0, f32::NAN, f32::INFINITY, 1001.0] {
        let bytes = FrameHeader { fps, ..header() }.encode();
        assert!(matches!(FrameHeader::decode(&bytes), Err(DecodeError::Impossible(_))), "{fps}");
    }
    for camera in ["x".repeat(65), "a\nb".to_owned()] {
        let bytes = FrameHeader { camera, ..header() }.encode();
        assert!(matches!(FrameHeader::decode(&bytes), Err(DecodeError::Impossible(_))));
    }
    let long = vec![2; MAX_FRAME_HEADER + 1];
    assert!(matches!(FrameHeader::decode(&long), Err(DecodeError::TooLong { .. })));
    assert_eq!(FrameHeader::decode(&[]), Err(DecodeError::Empty));
    assert_eq!(FrameTaken::decode(&[9, 0]), Err(DecodeError::Version { found: 9 }));
    let mut more = header().encode();
    more.push(0);
    assert_eq!(FrameHeader::decode(&more), Err(DecodeError::Trailing(1)));
}

proptest! {
    #[test]
    fn any_bytes_give_a_value_or_an_error(mut bytes: Vec<u8>) {
        let _ = (FrameHeader::decode(&bytes), FrameTaken::decode(&bytes));
        if let Some(first) = bytes.first_mut() {
            *first = 2;
        }
        let _ = (FrameHeader::decode(&bytes), FrameTaken::decode(&bytes));
    }

    #[test]
    fn a_header_cut_short_is_an_error(length in 0_usize..20) {
        let whole = header().encode();
        let length = length.min(whole.len() - 1);
        prop_assert!(FrameHeader::decode(&whole[..length]).is_err());
    }
}
