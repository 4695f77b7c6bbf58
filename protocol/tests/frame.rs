//! What travels beside a picture: the bytes once and for all, and the bounds of reading it.

use gestalt_protocol::{
    DecodeError, FrameChallenge, FrameHeader, FrameProof, FrameTaken, ImageEncoding, MAX_CHALLENGES,
    MAX_FRAME_HEADER, RobotId, RoundId, Signature,
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
fn what_a_sealed_swarm_adds() {
    let signature = Signature::from_bytes([0xAB; 64]);
    let signed = |bytes: &str| bytes.replace(' ', "") + &"ab".repeat(64);
    // how many challenges, each (varints); the signature
    let proof = FrameProof { challenges: vec![5, 300], signature };
    let bytes = header().encode_proven(&proof);
    assert_eq!(hex(&bytes), signed("03 ac02 07 e05d 00 0000f041 06 706172726f74 02 05 ac02"));
    assert_eq!(FrameHeader::decode_proven(&bytes), Ok((header(), Some(proof.clone()))));
    assert_eq!(FrameHeader::decode(&bytes), Ok(header()), "who does not ask for it need not know of it");
    assert_eq!(FrameHeader::decode_proven(&header().encode()), Ok((header(), None)));
    // who looks, the challenge; the signature
    let taken = FrameTaken { nonce: 300, sequence: 7, round: None };
    let challenge = FrameChallenge { by: RobotId(2), challenge: 300, signature };
    let bytes = taken.encode_challenging(&challenge);
    assert_eq!(hex(&bytes), signed("03 ac02 07 00 02 ac02"));
    assert_eq!(FrameTaken::decode_challenging(&bytes), Ok((taken, Some(challenge))));
    assert_eq!(FrameTaken::decode(&bytes), Ok(taken));
    for length in taken.encode().len() + 1..bytes.len() {
        let left = length - taken.encode().len();
        assert_eq!(FrameTaken::decode(&bytes[..length]), Err(DecodeError::Trailing(left)));
    }

    let most = |challenges| FrameProof { challenges: vec![u64::MAX; challenges], ..proof.clone() };
    let longest = FrameHeader {
        nonce: u64::MAX,
        sequence: u32::MAX,
        age_us: u32::MAX,
        camera: "x".repeat(64),
        ..header()
    };
    let bytes = longest.encode_proven(&most(MAX_CHALLENGES));
    assert!(FrameHeader::decode_proven(&bytes).is_ok(), "{} bytes", bytes.len());
    let bytes = header().encode_proven(&most(MAX_CHALLENGES + 1));
    assert!(matches!(FrameHeader::decode_proven(&bytes), Err(DecodeError::Impossible(_))));
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
