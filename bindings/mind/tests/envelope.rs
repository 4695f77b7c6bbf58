//! What robots say, as JSON and back.

use gestalt_mind::envelope::{from_json, to_json};
use gestalt_protocol::{
    Ask, Asked, Batches, ClassId, Envelope, Fate, FeatureSpaceId, HeldBatch, Lesson, Lessons, Message,
    Naming, Namings, RobotId, RoundId, SampleId, Samples, SharedSample, Signature, Stamp, Vector,
    VocabularyId, Vote, Word,
};
use proptest::prelude::*;

const ROUND: RoundId = RoundId { counter: 300, opener: RobotId(2), life: 0xA1 };
const STAMP: Stamp = Stamp { boot: 1, sequence: 130 };

fn envelope(message: Message) -> Vec<u8> {
    Envelope { author: RobotId(7), stamp: STAMP, message, signature: None }.encode()
}

fn samples(vector: Vector) -> Samples {
    let sample = |number, round| SharedSample {
        id: SampleId { author: RobotId(7), life: 9, number },
        class: ClassId(3),
        round,
        vector: vector.clone(),
    };
    let other = RoundId { counter: 301, ..ROUND };
    let space = FeatureSpaceId(u64::MAX - 1);
    Samples { space, samples: vec![sample(1, ROUND), sample(4, ROUND), sample(5, other)] }
}

#[track_caller]
fn comes_back(bytes: &[u8]) -> String {
    let json = to_json(bytes).unwrap();
    assert_eq!(from_json(json.as_bytes()).unwrap(), bytes, "{json}");
    json
}

#[test]
fn a_golden_vote_is_spelt_as_documented() {
    // As in protocol/tests/golden.rs.
    let head = [3, 7, 1, 0x82, 1, 0, 0xac, 2, 2, 0xa1, 1, 0x84, 0x86, 0x88, 8, 2];
    let bytes = [&head[..], &[0, 0, 0xc0, 0x3f, 0, 0, 0xc0, 0xbf, 0, 0, 0, 0x40, 0, 0]].concat();
    let json = comes_back(&bytes);
    let start = r#"{"author":7,"stamp":{"boot":1,"sequence":130},"signature":null,"message":{"kind":"vote","body":{"round":{"counter":300"#;
    assert!(json.starts_with(start), "{json}");
    assert!(json.contains(r#""evidence":[1.5,-1.5],"looks":2.0"#), "{json}");
}

#[test]
fn samples_of_every_precision_come_back_byte_for_byte() {
    for vector in [
        Vector::F32(vec![0.1, -1e-30, 3.402_823_5e38]),
        Vector::F16(vec![0x66, 0x2e, 0x01, 0x00, 0xff, 0x7b]),
        Vector::I8(vec![-128, 0, 127]),
    ] {
        let json = comes_back(&envelope(Message::Samples(samples(vector.clone()))));
        assert!(json.contains(r#""id":{"author":7,"life":9,"number":4}"#), "{json}");
        let batch = HeldBatch {
            robot: RobotId(7),
            stamp: STAMP,
            samples: samples(vector),
            signature: Some(Signature::from_bytes([0xA5; 64])),
        };
        comes_back(&envelope(Message::Batches(Batches { batches: vec![batch] })));
    }
}

#[test]
fn lessons_and_signed_votes_come_back_byte_for_byte() {
    let lesson = Lesson {
        round: ROUND,
        instructor: "ada".parse().unwrap(),
        count: 1,
        at: u64::MAX,
        word: Word::Was(ClassId(3)),
        said: None,
    };
    comes_back(&envelope(Message::Lessons(Lessons { lessons: vec![lesson] })));
    let vote = Vote {
        round: ROUND,
        vocabulary: VocabularyId(1),
        evidence: vec![],
        looks: 0.0,
        unknown: None,
        named: vec![],
    };
    let signature = Some(Signature::from_bytes([0xA5; 64]));
    comes_back(
        &Envelope { author: RobotId(7), stamp: STAMP, message: Message::Vote(vote), signature }.encode(),
    );
}

#[test]
fn what_was_named_and_what_is_asked_come_back_byte_for_byte() {
    let circle = Naming {
        by: "ana".parse().unwrap(),
        label: "circle".to_owned(),
        count: 2,
        at: 1,
        said_by: "bob".parse().unwrap(),
        fate: Fate::Same(ClassId(3)),
        said: None,
    };
    comes_back(&envelope(Message::Namings(Namings { namings: vec![circle] })));
    let ask = Ask::Name { nearest: Some(ClassId(2)) };
    let asked = Asked { round: ROUND, ask, labels: vec![], entropy: 0.75, disagreement: 0.25 };
    comes_back(&envelope(Message::Asked(asked)));
}

#[test]
fn every_kind_is_documented() {
    let unknown = r#"{"author":7,"stamp":{"boot":1,"sequence":1},"message":{"kind":"none","body":{}}}"#;
    let error = from_json(unknown.as_bytes()).unwrap_err().to_string();
    let (_, known) = error.split_once("expected one of ").expect("the kinds");
    let kinds: Vec<&str> = known.split('`').skip(1).step_by(2).collect();
    assert!(kinds.contains(&"vote") && kinds.contains(&"asked"), "{error}");
    let documented = include_str!("../src/envelope.rs").split("\nuse ").next().unwrap();
    for kind in kinds {
        assert!(documented.contains(&format!("`{kind}`")), "{kind}");
    }
}

#[test]
fn json_that_no_robot_may_say_is_refused_as_its_bytes_would_be() {
    let json = comes_back(&envelope(Message::Samples(samples(Vector::I8(vec![1])))));
    for (from, to) in [
        (r#""number":4"#, r#""number":1"#),
        (r#""class":3"#, r#""class":200"#),
        (r#"{"i8":[1]}"#, r#"{"i8":[]}"#),
        (r#"{"i8":[1]}"#, r#"{"i8":[300]}"#),
        (r#""space""#, r#""spaces""#),
        (r#""kind":"samples""#, r#""kind":"vote""#),
    ] {
        let wrong = json.replacen(from, to, 1);
        assert_ne!(wrong, json);
        assert!(from_json(wrong.as_bytes()).is_err(), "{wrong}");
    }
}

proptest! {
    #[test]
    fn every_finite_float_survives_the_way_through_text(bits in prop::collection::vec(any::<u32>(), 2..64), looks in 0.0..1e9_f32) {
        let evidence: Vec<f32> = bits.into_iter().map(f32::from_bits).filter(|x| x.is_finite()).collect();
        prop_assume!(evidence.len() != 1);
        let vote = Vote { round: ROUND, vocabulary: VocabularyId(1), evidence, looks, unknown: None, named: vec![] };
        comes_back(&envelope(Message::Vote(vote)));
    }

    #[test]
    fn any_bytes_and_any_text_give_a_message_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..200), text in ".{0,200}") {
        let _ = to_json(&bytes);
        let _ = to_json(&[&[3], &bytes[..]].concat());
        let _ = from_json(text.as_bytes());
    }
}
