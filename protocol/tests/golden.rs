//! The bytes on the wire, once and for all: robots of different builds must understand each other. A change here is
//! a new protocol version.

use gestalt_protocol::{
    Certificate, ClassId, CountedVote, Decision, Envelope, FusionRule, Give, Have, HeldVote, Instruction,
    Message, RobotId, RoundId, Stamp, VocabularyId, Vote, decode_json,
};

const ROUND: RoundId = RoundId { counter: 300, opener: RobotId(2) };

fn vote() -> Vote {
    Vote { round: ROUND, vocabulary: VocabularyId(0x0102_0304), evidence: vec![1.5, -1.5], looks: 2.0 }
}

fn decision() -> Decision {
    Decision {
        round: ROUND,
        class: Some(ClassId(1)),
        confidence: 0.75,
        author: RobotId(4),
        certificate: Certificate {
            vocabulary: VocabularyId(0x0102_0304),
            rule: FusionRule::LogPool,
            probabilities: vec![0.25, 0.75],
            votes: vec![CountedVote {
                robot: RobotId(7),
                stamp: Stamp { boot: 1, sequence: 9 },
                class: ClassId(1),
                weight: 1.0,
            }],
            elapsed_ms: 1250,
        },
    }
}

fn envelope(message: Message) -> Envelope {
    Envelope { author: RobotId(7), stamp: Stamp { boot: 1, sequence: 130 }, message }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn travels_as(message: Message, expected: &str) {
    let envelope = envelope(message);
    let bytes = envelope.encode();
    assert_eq!(hex(&bytes), expected.replace(' ', ""));
    assert_eq!(Envelope::decode(&bytes), Ok(envelope));
}

// version, author, boot, sequence (varint), variant
const HEAD: &str = "01 07 01 8201";

#[test]
fn a_vote() {
    // round, vocabulary (varint), two f32 in little-endian order, looks
    travels_as(Message::Vote(vote()), &format!("{HEAD} 00 ac0202 84868808 02 0000c03f 0000c0bf 00000040"));
}

#[test]
fn a_null_vote() {
    let null = Vote { evidence: vec![], looks: 0.0, ..vote() };
    travels_as(Message::Vote(null), &format!("{HEAD} 00 ac0202 84868808 00 00000000"));
}

#[test]
fn what_a_robot_has() {
    let have = Have {
        round: Some(ROUND),
        decision: Some(decision().rank()),
        votes: vec![(RobotId(7), Stamp { boot: 1, sequence: 9 })],
        answer: true,
    };
    // Some round; Some rank: decided, robots, confidence as f64, author; one vote: robot, boot, sequence; answer
    travels_as(
        Message::Have(have),
        &format!("{HEAD} 01 01ac0202 01 01 01 000000000000e83f 04 01 07 01 09 01"),
    );
    let nothing = Have { round: None, decision: None, votes: vec![], answer: false };
    travels_as(Message::Have(nothing), &format!("{HEAD} 01 00 00 00 00"));
}

#[test]
fn what_a_robot_gives() {
    let held = HeldVote { robot: RobotId(3), stamp: Stamp { boot: 2, sequence: 5 }, vote: vote() };
    let decided = "01 ac0202 0101 000000000000e83f 04 84868808 02 02 000000000000d03f 000000000000e83f \
                   01 07 01 09 01 0000803f e209";
    let votes = "01 03 02 05 ac0202 84868808 02 0000c03f 0000c0bf 00000040";
    travels_as(
        Message::Give(Give { decision: Some(decision()), votes: vec![held] }),
        &format!("{HEAD} 02 {decided} {votes}").replace("\n", ""),
    );
}

#[test]
fn a_decision_for_clients() {
    let json = r#"{"round":{"counter":300,"opener":2},"class":1,"confidence":0.75,"author":4,"certificate":{"vocabulary":16909060,"rule":"log_pool","probabilities":[0.25,0.75],"votes":[{"robot":7,"stamp":{"boot":1,"sequence":9},"class":1,"weight":1.0}],"elapsed_ms":1250}}"#;
    assert_eq!(serde_json::to_string(&decision()).unwrap(), json);
    assert_eq!(decode_json::<Decision>(json.as_bytes()), Ok(decision()));
    let none = Decision { class: None, ..decision() };
    assert!(serde_json::to_string(&none).unwrap().contains(r#""class":null"#));
}

#[test]
fn an_instruction_as_people_write_it() {
    assert_eq!(decode_json::<Instruction>(br#" {"say": "open"} "#), Ok(Instruction::Open));
    for wrong in ["{}", r#"{"say":"close"}"#, r#"{"say":"open","now":1}"#, "[]", "open"] {
        assert!(decode_json::<Instruction>(wrong.as_bytes()).is_err(), "{wrong}");
    }
}
