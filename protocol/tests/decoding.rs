//! Reading is total and bounded: any bytes give a value or a typed error.

use gestalt_protocol::{
    Announced, Announcement, Batches, Certificate, ClassId, CountedVote, Decision, DecodeError, Digest,
    Envelope, FeatureSpaceId, FusionRule, Give, Have, HeldBatch, HeldVote, Holder, Holding, Instruction,
    Know, Known, Lesson, Lessons, MAX_ALLOCATION, MAX_ATTACHMENT, MAX_CLASSES, MAX_COMPONENTS, MAX_JSON,
    MAX_MESSAGE, MAX_ROBOTS, MAX_SAMPLES, MAX_TITLE, MAX_WORD, Message, PROTOCOL_VERSION, Rank, RobotId,
    RoundId, SampleId, SampleSeries, Samples, SharedSample, SignedWord, Stamp, Terms, Vector, VocabularyId,
    Vote, Word, decode_json,
};
use proptest::prelude::*;

fn round() -> impl Strategy<Value = RoundId> {
    any::<(u32, u32, u32)>().prop_map(|(counter, opener, life)| RoundId {
        counter,
        opener: RobotId(opener),
        life,
    })
}

fn stamp() -> impl Strategy<Value = Stamp> {
    (any::<u32>(), any::<u32>()).prop_map(|(boot, sequence)| Stamp { boot, sequence })
}

/// Two, in order.
fn named_gestures() -> impl Iterator<Item = ClassId> {
    let mut named = ["circle", "fist"].map(|label| ClassId::named(&"ana".parse().unwrap(), label));
    named.sort();
    named.into_iter()
}

fn vote() -> impl Strategy<Value = Vote> {
    let evidence = prop_oneof![Just(vec![]), prop::collection::vec(-1e30f32..1e30, 2..=MAX_CLASSES)];
    let unknown = prop::option::of(-1e30f32..1e30);
    (round(), any::<u32>(), evidence, 0f32..1e6, unknown, 0..=2_usize).prop_map(
        |(round, vocabulary, evidence, looks, unknown, named)| Vote {
            round,
            vocabulary: VocabularyId(vocabulary),
            unknown: unknown.filter(|_| !evidence.is_empty()),
            named: named_gestures().take(named.min(evidence.len().saturating_sub(2))).collect(),
            evidence,
            looks,
        },
    )
}

fn decision() -> impl Strategy<Value = Decision> {
    let rule = prop_oneof![
        Just(FusionRule::Majority),
        Just(FusionRule::MeanProbability),
        Just(FusionRule::LogPool),
        Just(FusionRule::ConfidenceWeighted),
    ];
    let counted = (stamp(), 0..2_u32, 0f32..1e6, vote());
    let votes = prop::collection::btree_map(any::<u32>(), counted, 0..8);
    let certificate =
        (rule, prop::collection::vec(0f64..=1.0, 2..=MAX_CLASSES), votes, any::<[u32; 3]>(), any::<bool>());
    (round(), prop::option::of(0..2_u32), 0f64..=1.0, any::<u32>(), certificate).prop_map(
        |(
            round,
            class,
            confidence,
            author,
            (rule, probabilities, said, [robots, quorum, elapsed_ms], is_final),
        )| {
            let (mut votes, mut others) = (Vec::new(), Vec::new());
            for (robot, (stamp, class, weight, vote)) in said {
                let robot = RobotId(robot);
                if vote.evidence.is_empty() {
                    others.push(HeldVote { robot, stamp, vote, signature: None });
                } else {
                    let evidence =
                        (0..probabilities.len()).map(|k| vote.evidence[k % vote.evidence.len()]).collect();
                    let vote = Vote { evidence, named: vec![], ..vote };
                    votes.push(CountedVote {
                        robot,
                        stamp,
                        class: ClassId(class),
                        weight,
                        vote,
                        signature: None,
                    });
                }
            }
            let vocabulary = VocabularyId(1);
            Decision {
                round,
                class: class.map(ClassId),
                confidence,
                author: RobotId(author),
                is_final,
                certificate: Certificate {
                    vocabulary,
                    rule,
                    pool: None,
                    probabilities,
                    unknown: None,
                    votes,
                    others,
                    robots,
                    quorum,
                    elapsed_ms,
                    named: vec![],
                    terms: Terms::default(),
                },
            }
        },
    )
}

fn message() -> impl Strategy<Value = Message> {
    let have = (
        prop::option::of(round()),
        prop::option::of(decision()),
        prop::collection::vec((any::<u32>(), stamp()), 0..10),
        prop::option::of(any::<(u64, u64, u64)>()),
        any::<bool>(),
    )
        .prop_map(|(round, decision, votes, knowledge, answer)| Have {
            round,
            decision: decision.map(|decision| decision.rank()),
            holders: if answer { 7 } else { 0x1234 },
            votes: votes.into_iter().map(|(robot, stamp)| (RobotId(robot), stamp)).collect(),
            knowledge: knowledge.map(|(key, samples, lessons)| Digest { key, samples, lessons }),
            answer,
        });
    let held = (any::<u32>(), stamp(), vote()).prop_map(|(robot, stamp, vote)| HeldVote {
        robot: RobotId(robot),
        stamp,
        vote,
        signature: None,
    });
    let holder =
        (any::<u32>(), stamp(), decision(), any::<bool>()).prop_map(|(robot, stamp, held, changed)| Holder {
            robot: RobotId(robot),
            stamp,
            holding: held.holding(changed),
            signature: None,
        });
    let (held, holders) = (prop::collection::vec(held, 0..5), prop::collection::vec(holder, 0..5));
    let give = (prop::option::of(decision()), held, holders).prop_map(|(decision, votes, holders)| Give {
        decision,
        votes,
        holders,
    });
    let announced = (decision(), prop::option::of("[a-zäöü() ]{0,40}"))
        .prop_map(|(decision, label)| Announced { decision, label });
    prop_oneof![
        decision().prop_map(|held| Message::Holding(held.holding(held.is_final))),
        announced.prop_map(Message::Announced),
        vote().prop_map(Message::Vote),
        have.prop_map(Message::Have),
        give.prop_map(Message::Give),
        samples().prop_map(Message::Samples),
        know().prop_map(Message::Know),
        prop::collection::vec(lesson(), 0..5).prop_map(|lessons| Message::Lessons(Lessons { lessons })),
        prop::collection::vec((stamp(), samples()), 0..4).prop_map(|batches| {
            let held = |(stamp, samples): (Stamp, Samples)| HeldBatch {
                robot: samples.first().unwrap().author,
                stamp,
                samples,
                signature: None,
            };
            Message::Batches(Batches { batches: batches.into_iter().map(held).collect() })
        }),
    ]
}

fn samples() -> impl Strategy<Value = Samples> {
    let vector = prop_oneof![
        prop::collection::vec(-1e30f32..1e30, 1..40).prop_map(Vector::F32),
        prop::collection::vec((any::<u8>(), 0..0x7c_u8), 1..40)
            .prop_map(|halves| Vector::F16(halves.into_iter().flat_map(|(low, high)| [low, high]).collect())),
        prop::collection::vec(any::<i8>(), 1..40).prop_map(Vector::I8),
    ];
    let sample = (0..MAX_CLASSES as u32, round(), vector);
    let samples = prop::collection::btree_map(1..u32::MAX, sample, 1..5);
    (any::<u64>(), any::<(u32, u32)>(), samples).prop_map(|(space, (author, life), samples)| {
        let sample = |(number, (class, round, vector))| SharedSample {
            id: SampleId { author: RobotId(author), life, number },
            class: ClassId(class),
            round,
            vector,
        };
        Samples { space: FeatureSpaceId(space), samples: samples.into_iter().map(sample).collect() }
    })
}

fn know() -> impl Strategy<Value = Know> {
    // Steps of at least two between the ends give intervals with gaps between them.
    let numbers = prop::collection::vec((2..1000_u32, 0..1000_u32), 0..6).prop_map(|steps| {
        let mut last = 0;
        let interval = |(gap, length)| {
            let first = last + gap;
            last = first + length;
            (first, last)
        };
        steps.into_iter().map(interval).collect::<Vec<_>>()
    });
    let samples =
        prop::collection::btree_map((any::<u32>(), any::<u32>()), numbers, 0..5).prop_map(|known| {
            let series = |(author, life)| SampleSeries { author: RobotId(author), life };
            known.into_iter().map(|(of, numbers)| Known { series: series(of), numbers }).collect()
        });
    let digest =
        || any::<(u64, u64, u64)>().prop_map(|(key, samples, lessons)| Digest { key, samples, lessons });
    let lessons = prop::collection::vec((round(), any::<u64>()), 0..5);
    (samples, lessons, digest(), any::<bool>(), prop::option::of(digest())).prop_map(
        |(samples, lessons, digest, answer, nothing_for)| Know {
            samples,
            lessons,
            digest,
            answer,
            nothing_for,
            named: 0,
        },
    )
}

fn lesson() -> impl Strategy<Value = Lesson> {
    let word = prop_oneof![
        (0..MAX_CLASSES as u32).prop_map(|class| Word::Was(ClassId(class))),
        (0..MAX_CLASSES as u32).prop_map(|class| Word::Not(ClassId(class))),
        Just(Word::Retracted),
    ];
    let bytes = |most| prop::collection::vec(any::<u8>(), 0..most);
    let said = (bytes(MAX_WORD), bytes(MAX_ATTACHMENT))
        .prop_map(|(word, attachment)| SignedWord { word, attachment });
    (round(), "[a-zA-Z0-9_-]{1,32}", any::<(u64, u64)>(), word, prop::option::of(said)).prop_map(
        |(round, name, (count, at), word, said)| Lesson {
            round,
            instructor: name.parse().expect("a name of that form"),
            count,
            at,
            word,
            said,
        },
    )
}

fn envelope() -> impl Strategy<Value = Envelope> {
    (any::<u32>(), stamp(), message()).prop_map(|(author, stamp, message)| Envelope {
        author: RobotId(author),
        stamp,
        message,
        signature: None,
    })
}

proptest! {
    #[test]
    fn what_was_written_is_read(envelope in envelope()) {
        prop_assert_eq!(Envelope::decode(&envelope.encode()), Ok(envelope));
    }

    #[test]
    fn a_decision_survives_json_bit_for_bit(decision in decision()) {
        let json = serde_json::to_vec(&decision).unwrap();
        let read: Decision = decode_json(&json).unwrap();
        prop_assert_eq!(read.confidence.to_bits(), decision.confidence.to_bits());
        prop_assert_eq!(read, decision);
    }

    #[test]
    fn random_bytes_never_panic_and_what_is_read_is_written_the_same(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let mut versioned = vec![PROTOCOL_VERSION];
        versioned.extend(&bytes);
        for bytes in [bytes, versioned] {
            if let Ok(envelope) = Envelope::decode(&bytes) {
                // A varint can be written longer than it need be, so the bytes may differ, the meaning may not.
                prop_assert_eq!(Envelope::decode(&envelope.encode()), Ok(envelope));
            }
            let _ = decode_json::<Decision>(&bytes);
            let _ = decode_json::<Instruction>(&bytes);
        }
    }

    #[test]
    fn a_message_cut_short_or_with_something_behind_it_is_refused(envelope in envelope(), at in any::<prop::sample::Index>()) {
        let mut bytes = envelope.encode();
        let cut = at.index(bytes.len());
        prop_assert!(Envelope::decode(&bytes[..cut]).is_err());
        bytes.push(0);
        prop_assert_eq!(Envelope::decode(&bytes), Err(DecodeError::Trailing(1)));
    }

    #[test]
    fn a_flipped_bit_never_panics(envelope in envelope(), at in any::<prop::sample::Index>(), bit in 0..8u32) {
        let mut bytes = envelope.encode();
        let at = at.index(bytes.len());
        bytes[at] ^= 1u8 << bit;
        let _ = Envelope::decode(&bytes);
    }

    #[test]
    fn ranks_are_a_total_order(a in decision(), b in decision(), c in decision()) {
        let (a, b, c): (Rank, Rank, Rank) = (a.rank(), b.rank(), c.rank());
        prop_assert_eq!(a.cmp(&b), b.cmp(&a).reverse());
        if a <= b && b <= c {
            prop_assert!(a <= c);
        }
    }
}

fn vote_of(evidence: Vec<f32>) -> Vote {
    let round = RoundId { counter: 1, opener: RobotId(1), life: 0 };
    Vote { round, vocabulary: VocabularyId(1), evidence, looks: 1.0, unknown: None, named: vec![] }
}

fn read(message: Message) -> Result<Envelope, DecodeError> {
    let stamp = Stamp { boot: 1, sequence: 1 };
    Envelope::decode(&Envelope { author: RobotId(1), stamp, message, signature: None }.encode())
}

#[test]
fn no_bytes_too_many_bytes_and_another_version_are_told_apart() {
    assert_eq!(Envelope::decode(&[]), Err(DecodeError::Empty));
    assert_eq!(Envelope::decode(&[PROTOCOL_VERSION + 1, 1, 2]), Err(DecodeError::Version { found: 4 }));
    let long = vec![PROTOCOL_VERSION; MAX_MESSAGE + 1];
    assert_eq!(
        Envelope::decode(&long),
        Err(DecodeError::TooLong { length: MAX_MESSAGE + 1, limit: MAX_MESSAGE })
    );
    let long = vec![b' '; MAX_JSON + 1];
    assert!(matches!(decode_json::<Instruction>(&long), Err(DecodeError::TooLong { .. })));
    assert_eq!(decode_json::<Instruction>(&[]), Err(DecodeError::Empty));
}

#[test]
fn a_vote_says_only_what_a_robot_can_mean() {
    for (vote, what) in [
        (vote_of(vec![1.0]), "fewer than two"),
        (vote_of(vec![f32::NAN, 0.0]), "not finite"),
        (vote_of(vec![f32::INFINITY, 0.0]), "not finite"),
        (Vote { looks: -1.0, ..vote_of(vec![]) }, "looks"),
        (Vote { looks: f32::NAN, ..vote_of(vec![]) }, "looks"),
        (Vote { unknown: Some(f32::NAN), ..vote_of(vec![1.0, -1.0]) }, "unknown"),
        (Vote { unknown: Some(0.0), ..vote_of(vec![]) }, "nothing was seen"),
    ] {
        let Err(DecodeError::Impossible(why)) = read(Message::Vote(vote.clone())) else { panic!("{vote:?}") };
        assert!(why.contains(what), "{why}");
        let held = HeldVote { robot: RobotId(1), stamp: Stamp::default(), vote, signature: None };
        assert!(read(Message::Give(Give { decision: None, votes: vec![held], holders: vec![] })).is_err());
    }
}

#[test]
fn a_rank_that_no_decision_has_is_refused() {
    let round = RoundId { counter: 1, opener: RobotId(1), life: 0 };
    let rank = Rank { decided: true, robots: 2, looks: 2.0, confidence: 0.9, author: RobotId(1) };
    let holding = |rank| Holding { round, class: Some(ClassId(1)), rank, changed: false };
    assert!(read(Message::Holding(holding(rank))).is_ok());
    for rank in [
        Rank { looks: f32::NAN, ..rank },
        Rank { looks: -1.0, ..rank },
        Rank { confidence: f32::INFINITY, ..rank },
        Rank { confidence: 1.5, ..rank },
    ] {
        let holding = holding(rank);
        assert!(matches!(read(Message::Holding(holding.clone())), Err(DecodeError::Impossible(_))));
        let holder = Holder { robot: RobotId(1), stamp: Stamp::default(), holding, signature: None };
        assert!(read(Message::Give(Give { decision: None, votes: vec![], holders: vec![holder] })).is_err());
    }
}

#[test]
fn more_classes_or_robots_than_the_limit_are_refused_by_their_reader() {
    assert!(read(Message::Vote(vote_of(vec![0.0; MAX_CLASSES]))).is_ok());
    assert!(matches!(
        read(Message::Vote(vote_of(vec![0.0; MAX_CLASSES + 1]))),
        Err(DecodeError::Malformed(_))
    ));
    let have = |robots: usize| {
        let votes = (0..robots as u32).map(|robot| (RobotId(robot), Stamp::default())).collect();
        read(Message::Have(Have {
            round: None,
            decision: None,
            holders: 0,
            votes,
            knowledge: None,
            answer: false,
        }))
    };
    assert!(have(MAX_ROBOTS).is_ok());
    assert!(matches!(have(MAX_ROBOTS + 1), Err(DecodeError::Malformed(_))));
}

#[test]
fn a_sample_says_only_what_a_robot_can_have_seen() {
    let sample = |vector| SharedSample {
        id: SampleId { author: RobotId(1), life: 5, number: 1 },
        class: ClassId(0),
        round: RoundId { counter: 1, opener: RobotId(1), life: 0 },
        vector,
    };
    let sound = sample(Vector::F32(vec![0.0; MAX_COMPONENTS]));
    let of = |sample| {
        read(Message::Samples(Samples { space: FeatureSpaceId(1), samples: vec![sample] })).map(|_| ())
    };
    assert_eq!(of(sound.clone()), Ok(()));
    assert!(matches!(of(sample(Vector::F32(vec![0.0; MAX_COMPONENTS + 1]))), Err(DecodeError::Malformed(_))));
    for wrong in [
        sample(Vector::F32(vec![f32::NAN])),
        sample(Vector::F32(vec![f32::INFINITY])),
        sample(Vector::F16(vec![0x00, 0x7c])),
        sample(Vector::F16(vec![0x01, 0xfe])),
        sample(Vector::F16(vec![0x00])),
        sample(Vector::I8(vec![])),
        SharedSample { class: ClassId(64), ..sound.clone() },
        SharedSample { id: SampleId { author: RobotId(1), life: 5, number: 0 }, ..sound },
    ] {
        assert!(matches!(of(wrong.clone()), Err(DecodeError::Impossible(_))), "{wrong:?}");
    }
}

#[test]
fn a_batch_is_of_one_author_in_order_and_bounded() {
    let sample = |author, life, number| SharedSample {
        id: SampleId { author: RobotId(author), life, number },
        class: ClassId(0),
        round: RoundId { counter: 1, opener: RobotId(1), life: 0 },
        vector: Vector::I8(vec![0; 4]),
    };
    let of = |samples: Vec<SharedSample>| Samples { space: FeatureSpaceId(1), samples };
    let by = |robot, samples: Vec<SharedSample>| {
        let held = HeldBatch {
            robot: RobotId(robot),
            stamp: Stamp::default(),
            samples: of(samples),
            signature: None,
        };
        read(Message::Batches(Batches { batches: vec![held] })).map(|_| ())
    };
    assert_eq!(by(1, vec![sample(1, 5, 1), sample(1, 5, 3)]), Ok(()));
    assert_eq!(by(1, (1..=MAX_SAMPLES as u32).map(|number| sample(1, 5, number)).collect()), Ok(()));
    for wrong in [
        vec![],
        vec![sample(2, 5, 1)],
        vec![sample(1, 5, 2), sample(1, 5, 2)],
        (1..6)
            .map(|n| SharedSample { vector: Vector::F32(vec![0.0; MAX_COMPONENTS]), ..sample(1, 5, n) })
            .collect(),
    ] {
        assert!(matches!(by(1, wrong.clone()), Err(DecodeError::Impossible(_))), "{wrong:?}");
    }
    // Downwards the numbers run over.
    let downwards = vec![sample(1, 5, 2), sample(1, 5, 1)];
    assert!(matches!(by(1, downwards), Err(DecodeError::Malformed(_))));
    let many = (1..=MAX_SAMPLES as u32 + 1).map(|number| sample(1, 5, number)).collect();
    assert!(matches!(by(1, many), Err(DecodeError::Malformed(_))));
}

#[test]
fn intervals_that_overlap_touch_or_run_backwards_are_refused() {
    let of = |numbers: &[(u32, u32)]| {
        let known = Known { series: SampleSeries { author: RobotId(1), life: 5 }, numbers: numbers.to_vec() };
        read(Message::Know(Know {
            samples: vec![known],
            lessons: vec![],
            digest: Digest::default(),
            answer: false,
            nothing_for: None,
            named: 0,
        }))
        .is_ok()
    };
    assert!(of(&[(1, 5), (7, u32::MAX)]));
    for wrong in [&[(0, 5)][..], &[(5, 4)], &[(1, 5), (5, 9)], &[(1, 5), (6, 9)], &[(7, u32::MAX), (1, 2)]] {
        assert!(!of(wrong), "{wrong:?}");
    }
}

#[test]
fn a_decision_that_contradicts_itself_is_refused() {
    let round = RoundId { counter: 1, opener: RobotId(1), life: 0 };
    let vote = |evidence| Vote {
        round,
        vocabulary: VocabularyId(1),
        evidence,
        looks: 1.0,
        unknown: None,
        named: vec![],
    };
    let counted = |robot, class| CountedVote {
        robot: RobotId(robot),
        stamp: Stamp::default(),
        class: ClassId(class),
        weight: 1.0,
        vote: vote(vec![0.5, -0.5]),
        signature: None,
    };
    let null = |robot| HeldVote {
        robot: RobotId(robot),
        stamp: Stamp::default(),
        vote: vote(vec![]),
        signature: None,
    };
    let sound = Decision {
        round,
        class: Some(ClassId(1)),
        confidence: 0.75,
        author: RobotId(1),
        is_final: false,
        certificate: Certificate {
            vocabulary: VocabularyId(1),
            rule: FusionRule::LogPool,
            pool: None,
            probabilities: vec![0.25, 0.75],
            unknown: None,
            votes: vec![counted(1, 0), counted(2, 1)],
            others: vec![null(3), null(4)],
            robots: 5,
            quorum: 3,
            elapsed_ms: 1,
            named: vec![],
            terms: Terms::default(),
        },
    };
    assert_eq!(sound.check(), Ok(()));
    let broken = |change: &dyn Fn(&mut Decision)| {
        let mut decision = sound.clone();
        change(&mut decision);
        decision.check().unwrap_err().to_string()
    };
    assert!(broken(&|d| d.confidence = 1.5).contains("probability"));
    assert!(broken(&|d| d.confidence = f64::NAN).contains("probability"));
    assert!(broken(&|d| d.certificate.probabilities[0] = -0.1).contains("probability"));
    assert!(broken(&|d| d.class = Some(ClassId(2))).contains("class"));
    assert!(broken(&|d| d.certificate.votes[0].class = ClassId(2)).contains("class"));
    assert!(broken(&|d| d.certificate.votes[0].weight = f32::NAN).contains("weight"));
    assert!(
        broken(&|d| d.certificate.votes[1].robot = RobotId(1)).contains("out of order"),
        "one robot counts once"
    );
    assert!(broken(&|d| d.certificate.votes.swap(0, 1)).contains("out of order"));
    assert!(broken(&|d| d.certificate.others.swap(0, 1)).contains("out of order"));
    assert!(broken(&|d| d.certificate.others[0] = null(2)).contains("counted twice"));
    assert!(broken(&|d| d.certificate.votes[0].vote.evidence.push(0.0)).contains("other classes"));
    assert!(broken(&|d| d.certificate.votes[0].vote.evidence[0] = f32::NAN).contains("not finite"));
    assert!(broken(&|d| d.certificate.others[0].vote.looks = -1.0).contains("looks"));

    // The longest that a gesture is called, and a byte more.
    for (length, is_one) in [(MAX_TITLE, true), (MAX_TITLE + 1, false)] {
        let said = Announced { decision: sound.clone(), label: Some("x".repeat(length)) };
        let envelope = Envelope {
            author: RobotId(1),
            stamp: Stamp::default(),
            message: Message::Announced(said.clone()),
            signature: None,
        };
        assert_eq!(said.check().is_ok(), is_one);
        assert_eq!(Announcement::of(envelope.clone()).unwrap().check().is_ok(), is_one);
        assert_eq!(Envelope::decode(&envelope.encode()).is_ok(), is_one);
    }
}

/// The bytes that one value takes on the wire, at least.
fn on_the_wire(messages: [Message; 2]) -> usize {
    let [without, with] = messages.map(|message| {
        Envelope { author: RobotId(0), stamp: Stamp::default(), message, signature: None }.encode().len()
    });
    with - without
}

#[test]
fn no_message_takes_more_memory_than_promised() {
    // Whatever a vector claims, it grows with what has arrived, and at most to twice of it. So the bound holds if
    // no element is larger in memory than the promised factor makes of its smallest encoding.
    let factor = MAX_ALLOCATION / MAX_MESSAGE;
    let null = Vote {
        round: RoundId { counter: 0, opener: RobotId(0), life: 0 },
        vocabulary: VocabularyId(0),
        evidence: vec![],
        looks: 0.0,
        unknown: None,
        named: vec![],
    };
    let have = |votes| {
        Message::Have(Have { round: None, decision: None, holders: 0, votes, knowledge: None, answer: false })
    };
    let known = on_the_wire([have(vec![]), have(vec![(RobotId(0), Stamp::default())])]);
    assert!(2 * size_of::<(RobotId, Stamp)>() <= factor * known);
    let give = |votes| Message::Give(Give { decision: None, votes, holders: vec![] });
    let held = HeldVote { robot: RobotId(0), stamp: Stamp::default(), vote: null, signature: None };
    let given = on_the_wire([give(vec![]), give(vec![held])]);
    assert!(2 * size_of::<HeldVote>() <= factor * given);
    let gives = |holders| Message::Give(Give { decision: None, votes: vec![], holders });
    let round = RoundId { counter: 0, opener: RobotId(0), life: 0 };
    let rank = Rank { decided: false, robots: 0, looks: 0.0, confidence: 0.0, author: RobotId(0) };
    let holding = Holding { round, class: None, rank, changed: false };
    let holder = Holder { robot: RobotId(0), stamp: Stamp::default(), holding, signature: None };
    let given_too = on_the_wire([gives(vec![]), gives(vec![holder])]);
    assert!(2 * size_of::<Holder>() <= factor * given_too);
    // Beside the vote: the class and the weight.
    let counted = given + 1 + 4;
    assert!(2 * size_of::<CountedVote>() <= factor * counted);
    // A claim of four thousand million elements with nothing behind it.
    let mut claim =
        Envelope { author: RobotId(0), stamp: Stamp::default(), message: have(vec![]), signature: None }
            .encode();
    claim.truncate(claim.len() - 3);
    claim.extend([0xff, 0xff, 0xff, 0xff, 0x0f]);
    assert!(matches!(Envelope::decode(&claim), Err(DecodeError::Malformed(_))));
}
