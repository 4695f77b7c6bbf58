//! The bytes on the wire, once and for all: robots of different builds must understand each other. A change here is
//! a new protocol version.

use gestalt_protocol::{
    Announcement, Answer, Ask, Asked, Batches, Certificate, ClassId, CountedVote, Decision, Digest, Envelope,
    Fate, FeatureSpaceId, FusionRule, Gesture, Give, Have, HeldBatch, HeldVote, Holder, Instruction, Know,
    Known, Lesson, Lessons, Message, Naming, Namings, Outcome, Pool, Question, RobotId, RoundId, SampleId,
    SampleSeries, Samples, SharedSample, Signature, SignedWord, Stamp, Terms, Vector, VocabularyId, Vote,
    Word, decode_json,
};

const ROUND: RoundId = RoundId { counter: 300, opener: RobotId(2), life: 0xA1 };

fn vote() -> Vote {
    Vote {
        round: ROUND,
        vocabulary: VocabularyId(0x0102_0304),
        evidence: vec![1.5, -1.5],
        looks: 2.0,
        unknown: None,
        named: vec![],
    }
}

fn decision() -> Decision {
    Decision {
        round: ROUND,
        class: Some(ClassId(1)),
        confidence: 0.75,
        author: RobotId(4),
        is_final: true,
        certificate: Certificate {
            vocabulary: VocabularyId(0x0102_0304),
            rule: FusionRule::LogPool,
            pool: None,
            probabilities: vec![0.25, 0.75],
            unknown: None,
            votes: vec![CountedVote {
                robot: RobotId(7),
                stamp: Stamp { boot: 1, sequence: 9 },
                class: ClassId(1),
                weight: 1.0,
                vote: vote(),
                signature: None,
            }],
            others: vec![],
            robots: 3,
            quorum: 2,
            elapsed_ms: 1250,
            named: vec![],
            terms: Terms::default(),
        },
    }
}

fn announcement() -> Announcement {
    let (announcer, stamp) = (RobotId(7), Stamp { boot: 1, sequence: 130 });
    Announcement { decision: decision(), label: Some("palm".to_owned()), announcer, stamp, signature: None }
}

fn envelope(message: Message) -> Envelope {
    Envelope { author: RobotId(7), stamp: Stamp { boot: 1, sequence: 130 }, message, signature: None }
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
const HEAD: &str = "03 07 01 8201";

fn digest(samples: u64, lessons: u64) -> Digest {
    Digest { key: 0xC3, samples, lessons }
}

// of the above, 300 and 1: 8 bytes each
const DIGEST: &str = "c300000000000000 2c01000000000000 0100000000000000";

#[test]
fn a_vote() {
    // round, vocabulary (varint), two f32 in little-endian order, looks, nothing of unknown, nothing named
    travels_as(
        Message::Vote(vote()),
        &format!("{HEAD} 00 ac0202a101 84868808 02 0000c03f 0000c0bf 00000040 00 00"),
    );
    // Five bytes for what is unknown.
    travels_as(
        Message::Vote(Vote { unknown: Some(-3.0), ..vote() }),
        &format!("{HEAD} 00 ac0202a101 84868808 02 0000c03f 0000c0bf 00000040 01 000040c0 00"),
    );
    // Eight bytes for each gesture that was named: its number and the evidence for it.
    let circle = ClassId::named(&"ana".parse().unwrap(), "circle");
    travels_as(
        Message::Vote(Vote { evidence: vec![1.5, -1.5, 0.0], named: vec![circle], ..vote() }),
        &format!("{HEAD} 00 ac0202a101 84868808 03 0000c03f 0000c0bf 00000000 00000040 00 01 a791c457"),
    );
}

#[test]
fn a_signed_vote() {
    let signature = Some(Signature::from_bytes([0xA5; 64]));
    let signed = Envelope { signature, ..envelope(Message::Vote(vote())) };
    // The vote, then the signature's 64 bytes.
    let bytes = [signed.statement(), vec![0xA5; 64]].concat();
    assert_eq!((signed.encode(), Envelope::decode(&bytes)), (bytes, Ok(signed.clone())));
    assert_eq!(signed.statement(), envelope(Message::Vote(vote())).encode());
}

#[test]
fn a_null_vote() {
    let null = Vote { evidence: vec![], looks: 0.0, ..vote() };
    travels_as(Message::Vote(null), &format!("{HEAD} 00 ac0202a101 84868808 00 00000000 00 00"));
}

#[test]
fn what_a_robot_has() {
    let have = Have {
        round: Some(ROUND),
        decision: Some(decision().rank()),
        holders: 0x1234,
        votes: vec![(RobotId(7), Stamp { boot: 1, sequence: 9 })],
        knowledge: Some(digest(300, 1)),
        answer: true,
    };
    // Some round; Some rank: decided, robots, looks and confidence as f32, author; the digest of who holds what (varint); one vote: robot, boot, sequence; Some digest:
    // key, samples, lessons; answer
    travels_as(
        Message::Have(have),
        &format!("{HEAD} 01 01ac0202a101 01 01 01 00000040 0000403f 04 b424 01 07 01 09 01 {DIGEST} 01"),
    );
    let nothing =
        Have { round: None, decision: None, holders: 0, votes: vec![], knowledge: None, answer: false };
    travels_as(Message::Have(nothing), &format!("{HEAD} 01 00 00 00 00 00 00"));
}

#[test]
fn what_a_robot_gives() {
    let held =
        HeldVote { robot: RobotId(3), stamp: Stamp { boot: 2, sequence: 5 }, vote: vote(), signature: None };
    // The decision; its certificate: vocabulary, rule, no pool, probabilities, nothing of
    // unknown, nothing named, one vote as it was said, unsigned, no others, n, q, time; its terms: clip and alpha, a majority, liars, committee.
    let decided = "01 ac0202a101 0101 000000000000e83f 04 01 84868808 02 00 02 000000000000d03f 000000000000e83f 00 00 \
                   01 07 01 09 01 0000803f ac0202a101 84868808 02 0000c03f 0000c0bf 00000040 00 00 00 00 03 02 e209 \
                   0000000000001840 9a9999999999a93f 01 00 48";
    let votes = "01 03 02 05 ac0202a101 84868808 02 0000c03f 0000c0bf 00000040 00 00 00";
    // One word on what a robot holds: robot, boot, sequence, the word as it was said, unsigned.
    let (stamp, holding) = (Stamp { boot: 2, sequence: 6 }, decision().holding(true));
    let holder = Holder { robot: RobotId(3), stamp, holding, signature: None };
    let holders = format!("01 03 02 06 {HOLDING} 00");
    travels_as(
        Message::Give(Give { decision: Some(decision()), votes: vec![held], holders: vec![holder] }),
        &format!("{HEAD} 02 {decided} {votes} {holders}").replace("\n", ""),
    );
}

// round; some class; its rank: decided, robots, looks and confidence as f32, author; changed
const HOLDING: &str = "ac0202a101 0101 01 01 00000040 0000403f 04 01";

#[test]
fn what_a_robot_holds() {
    travels_as(Message::Holding(decision().holding(true)), &format!("{HEAD} 07 {HOLDING}"));
}

#[test]
fn what_an_announcer_signs() {
    let announcement = announcement();
    // The decision as it is given, but here it is final; some label.
    let decided = "ac0202a101 0101 000000000000e83f 04 01 84868808 02 00 02 000000000000d03f 000000000000e83f 00 00 \
                   01 07 01 09 01 0000803f ac0202a101 84868808 02 0000c03f 0000c0bf 00000040 00 00 00 00 03 02 e209 \
                   0000000000001840 9a9999999999a93f 01 00 48";
    let envelope = Envelope::from(announcement.clone());
    let expected = format!("{HEAD} 08 {decided} 01 04 70616c6d");
    assert_eq!(hex(&envelope.statement()), expected.replace([' ', '\n'], ""));
    assert_eq!(Announcement::of(envelope), Some(announcement));
    assert_eq!(Announcement::of(self::envelope(Message::Vote(vote()))), None);
}

fn question() -> Question {
    Question {
        round: ROUND,
        ask: Ask::Between { classes: [ClassId(2), ClassId(3)] },
        labels: vec!["two".to_owned(), "three".to_owned()],
        entropy: 0.75,
        disagreement: 0.25,
        robot: RobotId(7),
        stamp: Stamp { boot: 1, sequence: 130 },
        signature: None,
    }
}

#[test]
fn what_an_asker_signs() {
    // The round, what is asked, two labels, the two numbers.
    let nats = "000000000000e83f 000000000000d03f";
    let labels = "02 03 74776f 05 7468726565";
    let Question { entropy, disagreement, labels: named, .. } = question();
    let asked = |ask, labels| Asked { round: ROUND, ask, labels, entropy, disagreement };
    for (ask, said) in [
        (question().ask, "00 02 03"),
        (Ask::Again { nearest: ClassId(2) }, "01 02"),
        (Ask::Name { nearest: Some(ClassId(2)) }, "02 01 02"),
        (Ask::Name { nearest: None }, "02 00"),
    ] {
        travels_as(Message::Asked(asked(ask, vec![])), &format!("{HEAD} 0a ac0202a101 {said} 00 {nats}"));
    }
    let envelope = Envelope::from(question());
    assert_eq!(envelope, self::envelope(Message::Asked(asked(question().ask, named))));
    assert_eq!(
        hex(&envelope.statement()),
        format!("{HEAD} 0a ac0202a101 00 02 03 {labels} {nats}").replace(' ', "")
    );
    assert_eq!(Question::of(envelope), Some(question()));
}

#[test]
fn a_question_as_clients_read_it() {
    let json = concat!(
        r#"{"round":{"counter":300,"opener":2,"life":161},"ask":{"kind":"between","classes":[2,3]},"#,
        r#""labels":["two","three"],"entropy":0.75,"disagreement":0.25,"#,
        r#""robot":7,"stamp":{"boot":1,"sequence":130},"signature":null}"#
    );
    assert_eq!(serde_json::to_string(&question()).unwrap(), json);
    assert_eq!(decode_json::<Question>(json.as_bytes()), Ok(question()));
    for (ask, said) in [
        (Ask::Again { nearest: ClassId(2) }, r#"{"kind":"again","nearest":2}"#),
        (Ask::Name { nearest: None }, r#"{"kind":"name","nearest":null}"#),
    ] {
        assert_eq!(serde_json::to_string(&ask).unwrap(), said);
        assert_eq!(decode_json::<Ask>(said.as_bytes()), Ok(ask));
    }
}

fn sample(vector: Vector) -> SharedSample {
    let id = SampleId { author: RobotId(7), life: 0xB2, number: 200 };
    SharedSample { id, class: ClassId(3), round: ROUND, vector }
}

#[test]
fn shared_samples() {
    let space = FeatureSpaceId(0x0102);
    let samples = [
        Vector::F32(vec![1.5, -1.5]),
        Vector::F16(vec![0x00, 0x3e, 0x00, 0xbe]),
        Vector::I8(vec![127, -128]),
    ];
    // the space (8 bytes), the author and its life (4 bytes); each sample: by how much its number is higher, its class, kind of vector
    // (and from 3 on its round, which is not that of the one before), length, components
    let numbered = |(number, vector)| {
        let sample = sample(vector);
        SharedSample { id: SampleId { number, ..sample.id }, ..sample }
    };
    let samples = Samples { space, samples: (200..).zip(samples).map(numbered).collect() };
    let batch = "0201000000000000 07b2000000 03 c80103 03 ac0202a101 02 0000c03f0000c0bf 0103 01 04 003e00be 0103 02 02 7f80";
    travels_as(Message::Samples(samples.clone()), &format!("{HEAD} 03 {batch}"));
    // One batch: robot, boot, sequence, the batch as it was said, unsigned.
    let held =
        HeldBatch { robot: RobotId(7), stamp: Stamp { boot: 2, sequence: 5 }, samples, signature: None };
    travels_as(
        Message::Batches(Batches { batches: vec![held] }),
        &format!("{HEAD} 06 01 07 02 05 {batch} 00"),
    );
}

#[test]
fn a_sample_of_24_components_takes_at_most_64_bytes_and_each_further_one_of_its_round_half_as_many() {
    // The largest ids that a swarm of 4,096 robots, a million rounds and a million samples of one robot in one life come to.
    let sample = SharedSample {
        id: SampleId { author: RobotId(4096), life: u32::MAX, number: 1_000_000 },
        class: ClassId(63),
        round: RoundId { counter: 1_000_000, opener: RobotId(4096), life: u32::MAX },
        vector: Vector::I8(vec![-128; 24]),
    };
    let stamp = Stamp { boot: 10_000, sequence: 1_000_000 };
    let length = |samples: Vec<SharedSample>| {
        let message = Message::Samples(Samples { space: FeatureSpaceId(u64::MAX), samples });
        Envelope { author: RobotId(4096), stamp, message, signature: None }.encode().len()
    };
    let next = SharedSample { id: SampleId { number: 1_000_001, ..sample.id }, ..sample.clone() };
    let (one, two) = (length(vec![sample.clone()]), length(vec![sample, next]));
    assert!(one <= 64 && two - one <= 32, "{one} bytes, {two} of two");
}

#[test]
fn what_a_robot_knows() {
    let know = Know {
        samples: vec![Known {
            series: SampleSeries { author: RobotId(3), life: 0xB2 },
            numbers: vec![(1, 300), (302, 302)],
        }],
        lessons: vec![(ROUND, 5)],
        digest: digest(300, 1),
        answer: true,
        nothing_for: None,
        named: 7,
    };
    travels_as(
        Message::Know(know),
        &format!(
            "{HEAD} 04 01 03b2000000 02 01ac02 ae02ae02 01 ac0202a101 05 0700000000000000 {DIGEST} 01 00"
        ),
    );
    let nothing = Know {
        samples: vec![],
        lessons: vec![],
        digest: digest(300, 1),
        answer: true,
        nothing_for: Some(digest(300, 1)),
        named: 0,
    };
    travels_as(Message::Know(nothing), &format!("{HEAD} 04 00 00 0000000000000000 {DIGEST} 01 01 {DIGEST}"));
}

#[test]
fn what_instructors_said() {
    let said = |word| {
        let instructor = "ada".parse().unwrap();
        Lesson { round: ROUND, instructor, count: 2, at: 1, word, said: None }
    };
    let signed = SignedWord { word: b"{}".to_vec(), attachment: vec![1, 2, 3] };
    let lessons = vec![
        said(Word::Was(ClassId(3))),
        said(Word::Not(ClassId(4))),
        Lesson { said: Some(signed), ..said(Word::Retracted) },
    ];
    travels_as(
        Message::Lessons(Lessons { lessons }),
        &format!(
            "{HEAD} 05 03 ac0202a101 03616461 02 01 0003 00 ac0202a101 03616461 02 01 0104 00 ac0202a101 03616461 02 01 02 01 027b7d 03010203"
        ),
    );
}

#[test]
fn what_instructors_named() {
    let (ana, bob) = ("ana".parse().unwrap(), "bob".parse().unwrap());
    let circle = Naming {
        by: ana,
        label: "circle".into(),
        count: 2,
        at: 1,
        said_by: bob,
        fate: Fate::Same(ClassId(3)),
        said: None,
    };
    travels_as(
        Message::Namings(Namings { namings: vec![circle] }),
        &format!("{HEAD} 09 01 03616e61 06636972636c65 02 01 03626f62 0103 00"),
    );
}

fn json_of_before(decision: &Decision) -> String {
    let json = serde_json::to_string(decision).unwrap();
    json.replace(r#""pool":null,"#, "")
        .replace(r#""unknown":null,"#, "")
        .replace(r#","unknown":null,"named":[]"#, "")
        .replace(r#""named":[],"#, "")
        .replace(r#","terms":{"clip":6.0,"alpha":0.05,"majority":true,"liars":0,"committee":72}"#, "")
}

#[test]
fn a_decision_for_clients() {
    let json = r#"{"round":{"counter":300,"opener":2,"life":161},"class":1,"confidence":0.75,"author":4,"final":true,"certificate":{"vocabulary":16909060,"rule":"log_pool","pool":null,"probabilities":[0.25,0.75],"unknown":null,"named":[],"votes":[{"robot":7,"stamp":{"boot":1,"sequence":9},"class":1,"weight":1.0,"vote":{"round":{"counter":300,"opener":2,"life":161},"vocabulary":16909060,"evidence":[1.5,-1.5],"looks":2.0,"unknown":null,"named":[]},"signature":null}],"others":[],"robots":3,"quorum":2,"elapsed_ms":1250,"terms":{"clip":6.0,"alpha":0.05,"majority":true,"liars":0,"committee":72}}}"#;
    assert_eq!(serde_json::to_string(&decision()).unwrap(), json);
    assert_eq!(decode_json::<Decision>(json.as_bytes()), Ok(decision()));
    // One recorded before robots could tell what is unknown, and stated their terms.
    let before = json_of_before(&decision());
    assert_eq!(decode_json::<Decision>(before.as_bytes()), Ok(decision()));
    let pool =
        Certificate { pool: Some(Pool::PRIOR), rule: FusionRule::CorrelatedPool, ..decision().certificate };
    let spelt = r#""rule":"correlated_pool","pool":{"likeness":0.5,"temperature":1.1,"rounds":0}"#;
    assert!(serde_json::to_string(&pool).unwrap().contains(spelt));
    let more = r#","label":"palm","announcer":7,"stamp":{"boot":1,"sequence":130},"signature":null}"#;
    let json = format!("{}{more}", json.strip_suffix('}').unwrap());
    assert_eq!(serde_json::to_string(&announcement()).unwrap(), json);
    assert_eq!(decode_json::<Announcement>(json.as_bytes()), Ok(announcement()));
    let none = Decision { class: None, ..decision() };
    assert!(serde_json::to_string(&none).unwrap().contains(r#""class":null"#));
}

#[test]
fn instructions_as_people_write_them() {
    let round = ROUND;
    let of = Gesture::Class(ClassId(3));
    let by_class = Instruction::Was { round, class: Gesture::Class(ClassId(3)) };
    let by_label = Instruction::Was { round, class: Gesture::Label("three".to_owned()) };
    for (json, instruction) in [
        (r#" {"say": "open"} "#, Instruction::Open),
        (r#"{"say":"was","round":{"counter":300,"opener":2,"life":161},"class":3}"#, by_class),
        (r#"{"say":"was","round":{"counter":300,"opener":2,"life":161},"class":"three"}"#, by_label),
        (
            r#"{"round":{"counter":300,"opener":2,"life":161},"say":"right","of":3}"#,
            Instruction::Right { round, of: of.clone() },
        ),
        (
            r#"{"say":"wrong","round":{"counter":300,"opener":2,"life":161},"of":3}"#,
            Instruction::Wrong { round, of: of.clone() },
        ),
        (
            r#"{"say":"retract","round":{"counter":300,"opener":2,"life":161}}"#,
            Instruction::Retract { round },
        ),
        (r#"{"say":"new","label":"circle"}"#, Instruction::New { label: "circle".to_owned(), round: None }),
        (
            r#"{"say":"new","label":"circle","round":{"counter":300,"opener":2,"life":161}}"#,
            Instruction::New { label: "circle".to_owned(), round: Some(round) },
        ),
        (
            r#"{"say":"same","class":"ring","of":3}"#,
            Instruction::Same { class: Gesture::Label("ring".to_owned()), of: of.clone() },
        ),
        (r#"{"say":"retire","class":3}"#, Instruction::Retire { class: of.clone() }),
        (r#"{"say":"restore","class":3}"#, Instruction::Restore { class: of.clone() }),
    ] {
        assert_eq!(decode_json::<Instruction>(json.as_bytes()), Ok(instruction.clone()), "{json}");
        let written = serde_json::to_string(&instruction).unwrap();
        assert_eq!(decode_json::<Instruction>(written.as_bytes()), Ok(instruction), "{written}");
    }
    for wrong in [
        "{}",
        r#"{"say":"close"}"#,
        r#"{"say":"open","now":1}"#,
        "[]",
        r#"{"say":"new"}"#,
        r#"{"say":"same","class":"ring"}"#,
        r#"{"say":"retire","class":"ring","round":{"counter":300,"opener":2,"life":161}}"#,
        "open",
        r#"{"say":"right"}"#,
        r#"{"say":"right","round":{"counter":300,"opener":2,"life":161}}"#,
        r#"{"say":"was","round":{"counter":300,"opener":2,"life":161}}"#,
        r#"{"say":"was","round":{"counter":300,"opener":2,"life":161},"class":300}"#,
    ] {
        assert!(decode_json::<Instruction>(wrong.as_bytes()).is_err(), "{wrong}");
    }
}

#[test]
fn an_answer_for_instructors() {
    let answer = Answer {
        robot: RobotId(1),
        at: 7,
        to: Instruction::Right { round: ROUND, of: Gesture::Class(ClassId(3)) },
        outcome: Outcome::NothingSeen,
        class: Some(ClassId(3)),
        samples: 0,
        looks_like: None,
    };
    let json = r#"{"robot":1,"at":7,"to":{"say":"right","round":{"counter":300,"opener":2,"life":161},"of":3},"outcome":"nothing_seen","class":3,"samples":0}"#;
    assert_eq!(serde_json::to_string(&answer).unwrap(), json);
    assert_eq!(decode_json::<Answer>(json.as_bytes()), Ok(answer));
}
