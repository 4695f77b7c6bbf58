//! Values as robots and people say them, for inputs to begin with. All of the wire that is spelt out here is in this file.

use gestalt_protocol::{
    Announcement, Answer, Ask, Batches, Certificate, ClassId, CountedVote, Decision, Digest, Envelope, Fate,
    FeatureSpaceId, FrameChallenge, FrameHeader, FrameProof, FrameTaken, FusionRule, Gesture, Give, Have,
    HeldBatch, HeldVote, Holder, Holding, ImageEncoding, Instruction, InstructorId, Know, Known, Lesson,
    Lessons, MAX_CHALLENGES, MAX_SAMPLES, Message, Naming, Namings, Outcome, Question, RobotId, RoundId,
    SampleId, SampleSeries, Samples, SharedSample, Signature, SignedWord, Stamp, Status, Terms, Vector,
    VocabularyId, Vote, Word,
};
use rand::{Rng, RngExt};

/// Numbers at which something may break.
const BORDERS: [u32; 10] = [0, 1, 2, 127, 128, 255, 16_384, 1 << 24, u32::MAX - 1, u32::MAX];

/// A number: mostly a small one, now and then at a border.
pub fn number(rng: &mut impl Rng) -> u32 {
    match rng.random_range(0..8) {
        0 => BORDERS[rng.random_range(0..BORDERS.len())],
        1 => rng.random(),
        _ => rng.random_range(0..6),
    }
}

/// A robot: mostly one of few.
pub fn robot(rng: &mut impl Rng) -> RobotId {
    RobotId(number(rng))
}

/// A round: mostly one of few.
pub fn round(rng: &mut impl Rng) -> RoundId {
    RoundId { counter: number(rng), opener: robot(rng), life: number(rng) }
}

/// A stamp.
pub fn stamp(rng: &mut impl Rng) -> Stamp {
    Stamp { boot: number(rng), sequence: number(rng) }
}

/// A class of a small vocabulary.
pub fn class(rng: &mut impl Rng) -> ClassId {
    ClassId(rng.random_range(0..3))
}

/// An instructor: mostly one of few.
pub fn instructor(rng: &mut impl Rng) -> InstructorId {
    let names = ["ada", "bob", "A-_9", "abcdefghijklmnopqrstuvwxyz012345"];
    names[rng.random_range(0..names.len())].parse().expect("names of that form")
}

fn maybe<R: Rng, T>(rng: &mut R, make: impl FnOnce(&mut R) -> T) -> Option<T> {
    rng.random::<bool>().then(|| make(rng))
}

fn some<R: Rng, T>(rng: &mut R, most: usize, mut make: impl FnMut(&mut R) -> T) -> Vec<T> {
    (0..rng.random_range(0..=most)).map(|_| make(rng)).collect()
}

/// A signature of nobody's.
pub fn signature(rng: &mut impl Rng) -> Signature {
    Signature::from_bytes(std::array::from_fn(|_| rng.random()))
}

/// The list of gestures that most votes are about.
pub const VOCABULARY: VocabularyId = VocabularyId(9);

/// A vote over that many gestures, or of one who saw nothing.
pub fn vote(rng: &mut impl Rng, round: RoundId, classes: usize) -> Vote {
    let evidence: Vec<f32> = (0..classes).map(|_| rng.random_range(-6.0..6.0)).collect();
    let looks = if evidence.is_empty() { 0.0 } else { rng.random_range(0.5..4.0) };
    let unknown = if evidence.is_empty() { None } else { maybe(rng, |rng| rng.random_range(-6.0..6.0)) };
    let mut vote = Vote { round, vocabulary: VOCABULARY, evidence, looks, unknown, named: vec![] };
    if classes >= 2 && rng.random_range(0..4) == 0 {
        vote.evidence.push(rng.random_range(-6.0..6.0));
        vote.named.push(ClassId::named(&instructor(rng), "circle"));
    }
    vote
}

fn held_vote(rng: &mut impl Rng, round: RoundId, classes: usize) -> HeldVote {
    let vote = vote(rng, round, classes);
    HeldVote { robot: robot(rng), stamp: stamp(rng), vote, signature: maybe(rng, signature) }
}

/// A decision as its author might have drawn it, of no votes that belong to it.
pub fn decision(rng: &mut impl Rng) -> Decision {
    let (round, classes) = (round(rng), 3);
    let mut held = some(rng, 4, |rng| held_vote(rng, round, classes));
    held.sort_by_key(|held| held.robot);
    held.dedup_by_key(|held| held.robot);
    let mut others = held.split_off(held.len() / 2);
    others.iter_mut().for_each(|other| other.vote.evidence.clear());
    let counted = |held: HeldVote| CountedVote {
        robot: held.robot,
        stamp: held.stamp,
        class: ClassId(0),
        weight: 1.0,
        vote: held.vote,
        signature: held.signature,
    };
    Decision {
        round,
        class: maybe(rng, class),
        confidence: rng.random(),
        author: robot(rng),
        is_final: rng.random(),
        certificate: Certificate {
            vocabulary: VOCABULARY,
            rule: FusionRule::ALL[rng.random_range(0..5)],
            pool: None,
            probabilities: vec![0.25, 0.5, 0.25],
            unknown: None,
            votes: held.into_iter().map(counted).collect(),
            others,
            robots: number(rng),
            quorum: number(rng),
            elapsed_ms: number(rng),
            named: vec![],
            terms: Terms::default(),
        },
    }
}

/// What a robot says it holds.
pub fn holding(rng: &mut impl Rng) -> Holding {
    decision(rng).holding(rng.random())
}

/// The same, passed on.
pub fn holder(rng: &mut impl Rng) -> Holder {
    let (robot, stamp, holding) = (robot(rng), stamp(rng), holding(rng));
    Holder { robot, stamp, holding, signature: maybe(rng, signature) }
}

/// What somebody announces.
pub fn announcement(rng: &mut impl Rng) -> Announcement {
    let (decision, announcer, stamp) = (decision(rng), robot(rng), stamp(rng));
    let label = maybe(rng, |_| "thrée\n".to_owned());
    Announcement { decision, label, announcer, stamp, signature: maybe(rng, signature) }
}

/// What a swarm asks.
pub fn question(rng: &mut impl Rng) -> Question {
    let ask = match rng.random_range(0..3) {
        0 => Ask::Between { classes: [class(rng), class(rng)] },
        1 => Ask::Again { nearest: class(rng) },
        _ => Ask::Name { nearest: maybe(rng, class) },
    };
    let labels = ask.classes().iter().map(|_| "thrée\n".to_owned()).collect();
    Question {
        round: round(rng),
        ask,
        labels,
        entropy: rng.random(),
        disagreement: rng.random(),
        robot: robot(rng),
        stamp: stamp(rng),
        signature: maybe(rng, signature),
    }
}

/// A digest.
pub fn digest(rng: &mut impl Rng) -> Digest {
    Digest { key: rng.random(), samples: rng.random(), lessons: rng.random() }
}

/// A sample of that name, in that space, of so many components.
pub fn sample(rng: &mut impl Rng, id: SampleId, components: usize) -> SharedSample {
    let mut component = || rng.random_range(-1.0_f32..1.0);
    let vector = match id.number % 3 {
        0 => Vector::F32((0..components).map(|_| component()).collect()),
        1 => Vector::F16((0..components).flat_map(|_| [(component() * 99.0) as u8, 0x38]).collect()),
        _ => Vector::I8((0..components).map(|_| (component() * 100.0) as i8).collect()),
    };
    SharedSample { id, class: class(rng), round: round(rng), vector }
}

/// Samples of one space as a neighbour passes them on, in a batch for each series, signed by nobody.
pub fn samples(space: FeatureSpaceId, samples: Vec<SharedSample>) -> Message {
    let mut samples = samples;
    samples.sort_by_key(|sample| sample.id);
    samples.dedup_by_key(|sample| sample.id);
    let of_one_series = samples.chunk_by(|a, b| a.id.series() == b.id.series());
    let batches = of_one_series.flat_map(|series| series.chunks(MAX_SAMPLES)).map(|batch| {
        let first = batch[0].id;
        let stamp = Stamp { boot: 1, sequence: first.number };
        let samples = Samples { space, samples: batch.to_vec() };
        HeldBatch { robot: first.author, stamp, samples, signature: None }
    });
    Message::Batches(Batches { batches: batches.collect() })
}

/// Samples of one series, as their author shares them.
fn batch(rng: &mut impl Rng) -> Message {
    let (author, life, first) = (robot(rng), number(rng), number(rng).clamp(1, 1 << 30));
    let space = FeatureSpaceId(rng.random());
    let samples = (0..rng.random_range(1..4)).map(|n| sample(rng, sample_id(author, life, first + 2 * n), 4));
    Message::Samples(Samples { space, samples: samples.collect() })
}

/// The name of a sample.
pub fn sample_id(author: RobotId, life: u32, number: u32) -> SampleId {
    SampleId { author, life, number }
}

/// What an instructor said.
pub fn lesson(rng: &mut impl Rng, round: RoundId) -> Lesson {
    let word = match rng.random_range(0..3) {
        0 => Word::Was(class(rng)),
        1 => Word::Not(class(rng)),
        _ => Word::Retracted,
    };
    let (count, at) = (u64::from(number(rng)), u64::from(number(rng)));
    let said = maybe(rng, signed_word);
    Lesson { round, instructor: instructor(rng), count, at, word, said }
}

/// A word with somebody's signature.
pub fn signed_word(rng: &mut impl Rng) -> SignedWord {
    let word = serde_json::to_vec(&instruction(rng)).expect("a word is JSON");
    SignedWord { word, attachment: some(rng, 77, |rng| rng.random()) }
}

/// What instructors said.
pub fn lessons(lessons: Vec<Lesson>) -> Message {
    Message::Lessons(Lessons { lessons })
}

/// What a robot knows, in short.
pub fn know(rng: &mut impl Rng) -> Message {
    let mut known = some(rng, 3, |rng| {
        let first = number(rng).clamp(1, 1 << 30);
        let numbers = vec![(first, first + 1), (first + 3, first + 9)];
        Known { series: SampleSeries { author: robot(rng), life: number(rng) }, numbers }
    });
    known.sort_by_key(|known| known.series);
    known.dedup_by_key(|known| known.series);
    let lessons = some(rng, 3, |rng| (round(rng), rng.random()));
    let (digest, nothing_for) = (digest(rng), maybe(rng, digest));
    Message::Know(Know { samples: known, lessons, digest, answer: rng.random(), nothing_for, named: 0 })
}

/// What a robot has of the newest round.
pub fn have(rng: &mut impl Rng) -> Message {
    let votes = some(rng, 4, |rng| (robot(rng), stamp(rng)));
    let decision = maybe(rng, |rng| decision(rng).rank());
    let (round, knowledge) = (maybe(rng, round), maybe(rng, digest));
    Message::Have(Have { round, decision, holders: rng.random(), votes, knowledge, answer: rng.random() })
}

/// What a neighbour was found to lack.
pub fn give(decision: Option<Decision>, votes: Vec<HeldVote>, holders: Vec<Holder>) -> Message {
    Message::Give(Give { decision, votes, holders })
}

/// Any message between robots.
pub fn message(rng: &mut impl Rng) -> Message {
    let about = round(rng);
    match rng.random_range(0..11) {
        10 => Envelope::from(question(rng)).message,
        7 => Message::Holding(holding(rng)),
        8 => Envelope::from(announcement(rng)).message,
        0 => Message::Vote(vote(rng, about, 3)),
        1 => have(rng),
        2 => {
            let votes = some(rng, 3, |rng| held_vote(rng, about, 3));
            let decision = maybe(rng, decision);
            give(decision, votes, some(rng, 3, |rng| holder(rng)))
        }
        3 => {
            let all = some(rng, 3, |rng| {
                let id = sample_id(robot(rng), number(rng), number(rng).max(1));
                sample(rng, id, 4)
            });
            samples(FeatureSpaceId(rng.random()), all)
        }
        4 => know(rng),
        5 => batch(rng),
        9 => Message::Namings(Namings { namings: some(rng, 3, naming) }),
        _ => lessons(some(rng, 3, |rng| lesson(rng, about))),
    }
}

/// A message with a robot's name on it.
pub fn envelope(rng: &mut impl Rng) -> Envelope {
    Envelope {
        author: robot(rng),
        stamp: stamp(rng),
        message: message(rng),
        signature: maybe(rng, signature),
    }
}

/// What a human says.
pub fn instruction(rng: &mut impl Rng) -> Instruction {
    let round = round(rng);
    let of = if rng.random() { Gesture::Class(class(rng)) } else { Gesture::Label("thrée\n".to_owned()) };
    match rng.random_range(0..9) {
        0 => Instruction::Open,
        5 => Instruction::New { label: "circle".to_owned(), round: rng.random::<bool>().then_some(round) },
        6 => Instruction::Same { class: of.clone(), of },
        7 => Instruction::Retire { class: of },
        8 => Instruction::Restore { class: of },
        1 => Instruction::Was { round, class: of },
        2 => Instruction::Right { round, of },
        3 => Instruction::Wrong { round, of },
        _ => Instruction::Retract { round },
    }
}

/// A word on a gesture's name.
pub fn naming(rng: &mut impl Rng) -> Naming {
    let fate = match rng.random_range(0..3) {
        0 => Fate::InUse,
        1 => Fate::Same(ClassId::named(&instructor(rng), "circle")),
        _ => Fate::Retired,
    };
    let (by, said_by, said) = (instructor(rng), instructor(rng), maybe(rng, signed_word));
    Naming {
        by,
        label: "circle".to_owned(),
        count: number(rng).into(),
        at: rng.random(),
        said_by,
        fate,
        said,
    }
}

/// What the swarm answers.
pub fn answer(rng: &mut impl Rng) -> Answer {
    Answer {
        robot: robot(rng),
        at: rng.random(),
        to: instruction(rng),
        outcome: Outcome::Learned,
        class: maybe(rng, class),
        samples: number(rng),
        looks_like: None,
    }
}

/// What a robot tells of itself.
pub fn status(rng: &mut impl Rng) -> Status {
    let mut status = Status::new(robot(rng), "a \"name\"".to_owned(), number(rng));
    status.counters.insert("refused_forged".to_owned(), rng.random());
    status.round = maybe(rng, round);
    status.vocabulary = vec!["open".to_owned(), "fünf".to_owned()];
    status
}

/// What travels beside a frame, or in answer to one; in an open swarm or a sealed one.
pub fn beside_a_frame(rng: &mut impl Rng) -> Vec<u8> {
    let signature = signature(rng);
    if rng.random() {
        let header = FrameHeader {
            nonce: rng.random(),
            sequence: number(rng),
            age_us: number(rng),
            encoding: if rng.random() { ImageEncoding::Jpeg } else { ImageEncoding::Png },
            fps: rng.random_range(0.1..1000.0),
            camera: "Foot-bot, omnidirectional".to_owned(),
        };
        let challenges = (0..rng.random_range(0..=MAX_CHALLENGES)).map(|_| rng.random()).collect();
        let proof = rng.random::<bool>().then_some(FrameProof { challenges, signature });
        return proof.map_or_else(|| header.encode(), |proof| header.encode_proven(&proof));
    }
    let taken = FrameTaken { nonce: rng.random(), sequence: number(rng), round: maybe(rng, round) };
    let asked = FrameChallenge { by: robot(rng), challenge: rng.random(), signature };
    if rng.random() { taken.encode() } else { taken.encode_challenging(&asked) }
}
