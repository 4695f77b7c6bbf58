//! Messages as an adversary makes them up. What robots come to sign is signed here too, in one place for each kind.

use gestalt_protocol::{
    Batches, Certificate, ClassId, CountedVote, Decision, Envelope, Give, HeldBatch, HeldVote, Instruction,
    Lesson, Lessons, MAX_SAMPLES, Message, RobotId, RoundId, SampleId, Samples, SharedSample, SignedWord,
    Stamp, Vector, Vote, Word,
};
use gestalt_strategies::fusion::fuse;
use gestalt_strategies::{Fuse, MindConfig, decode_vector};

use crate::swarm::world::{CLASSES, instructor, key, space, vocabulary};
use crate::trust::{Identity, Speaker, SwarmId, WordHeading, statement, word};

/// The highest stamp there is.
pub const LAST: Stamp = Stamp { boot: u32::MAX, sequence: u32::MAX };

/// A vote that is as sure of that class as can be said.
pub fn vote(round: RoundId, class: u32, looks: f32) -> Vote {
    vote_of(round, class, 6.0, looks)
}

/// A vote for that class of so many nats.
pub fn vote_of(round: RoundId, class: u32, nats: f32, looks: f32) -> Vote {
    let mut evidence = vec![-nats / (CLASSES - 1) as f32; CLASSES as usize];
    evidence[class as usize] = nats;
    Vote { round, vocabulary: vocabulary().id(), evidence, looks, unknown: None, named: vec![] }
}

/// A vote of one who has seen nothing.
pub fn null_vote(round: RoundId) -> Vote {
    Vote {
        round,
        vocabulary: vocabulary().id(),
        evidence: Vec::new(),
        looks: 0.0,
        unknown: None,
        named: vec![],
    }
}

/// A vote in the name of that robot, signed by nobody.
pub fn said(robot: u32, stamp: Stamp, vote: Vote) -> Envelope {
    Envelope { author: RobotId(robot), stamp, message: Message::Vote(vote), signature: None }
}

/// The same, signed.
pub fn signed(envelope: Envelope, by: &Identity, swarm: &SwarmId) -> Envelope {
    Envelope { signature: Some(statement::sign(by, swarm, &envelope.statement())), ..envelope }
}

/// A vote as one passes it on.
pub fn held(envelope: Envelope) -> HeldVote {
    let Envelope { author: robot, stamp, message, signature } = envelope;
    let Message::Vote(vote) = message else { unreachable!("only votes are passed on") };
    HeldVote { robot, stamp, vote, signature }
}

/// What honest robots would conclude from these votes, in that robot's name.
pub fn decision(round: RoundId, votes: Vec<HeldVote>, author: u32) -> Decision {
    let mut votes = votes;
    votes.sort_by_key(|held| held.robot);
    let (votes, others): (Vec<HeldVote>, _) =
        votes.into_iter().partition(|held| !held.vote.evidence.is_empty());
    let counted: Vec<CountedVote> = votes.into_iter().map(counted).collect();
    let rows = counted.iter().map(|counted| counted.vote.evidence.as_slice());
    let fusion = fuse(MindConfig::default().rule, MindConfig::default().clip, CLASSES as usize, rows);
    let (probabilities, top) =
        fusion.map_or((vec![0.0; CLASSES as usize], ClassId(0)), |fusion| (fusion.probabilities, fusion.top));
    let robots = (counted.len() + others.len()) as u32;
    Decision {
        round,
        class: Some(top),
        confidence: probabilities[top.index()],
        author: RobotId(author),
        is_final: true,
        certificate: Certificate {
            vocabulary: vocabulary().id(),
            rule: MindConfig::default().rule,
            pool: MindConfig::default().rule.pool(),
            probabilities,
            unknown: None,
            votes: counted,
            others,
            robots,
            quorum: MindConfig::default().needs(robots),
            elapsed_ms: 10,
            named: vec![],
            terms: MindConfig::default().terms(),
        },
    }
}

/// A decision as one robot gives it to another.
pub fn given(decision: Decision) -> Message {
    Message::Give(Give { decision: Some(decision), votes: Vec::new(), holders: Vec::new() })
}

fn counted(held: HeldVote) -> CountedVote {
    let HeldVote { robot, stamp, vote, signature } = held;
    let top = (0..CLASSES).rev().max_by(|a, b| {
        let of = |class: &u32| vote.evidence.get(*class as usize).copied().unwrap_or(f32::MIN);
        of(a).total_cmp(&of(b))
    });
    CountedVote { robot, stamp, class: ClassId(top.unwrap_or(0)), weight: 1.0, vote, signature }
}

/// A sample that somebody may have shared: its components in parts of their spread.
pub fn sample(id: SampleId, class: u32, round: RoundId, at: &[f32]) -> SharedSample {
    let space = space();
    let components = space.spread().iter().zip(at.iter().cycle());
    let vector = Vector::F32(components.map(|(spread, at)| spread * at).collect());
    debug_assert!(decode_vector(&vector, &space).is_ok() || at.iter().any(|at| at.abs() > 10.0));
    SharedSample { id, class: ClassId(class), round, vector }
}

/// Samples of the swarm's own feature space as a neighbour passes them on, signed by nobody.
pub fn samples(samples: Vec<SharedSample>) -> Message {
    let mut samples = samples;
    samples.sort_by_key(|sample| sample.id);
    let of_one_series = samples.chunk_by(|a, b| a.id.series() == b.id.series());
    let batches = of_one_series.flat_map(|series| series.chunks(MAX_SAMPLES)).map(|batch| {
        let first = batch[0].id;
        let stamp = Stamp { boot: 9, sequence: first.number };
        let samples = Samples { space: space().id(), samples: batch.to_vec() };
        HeldBatch { robot: first.author, stamp, samples, signature: None }
    });
    Message::Batches(Batches { batches: batches.collect() })
}

/// A lesson that somebody may have heard, and cannot show.
pub fn lesson(round: RoundId, by: &str, count: u64, word: Word) -> Lesson {
    Lesson { round, instructor: instructor(by), count, at: count, word, said: None }
}

/// A lesson made of that word, whoever signed it, for whichever round.
pub fn lesson_of(said: SignedWord, round: RoundId, by: &str, count: u64, word: Word) -> Lesson {
    Lesson { said: Some(said), ..lesson(round, by, count, word) }
}

/// A word that the robot of that number signs for somebody of that name.
pub fn vouched(robot: u32, swarm: &SwarmId, by: &str, count: u64, instruction: &Instruction) -> SignedWord {
    let word = serde_json::to_vec(instruction).expect("a word is JSON");
    let heading = WordHeading { speaker: Speaker::For(RobotId(robot)), count };
    let attachment = word::sign(&key(robot), swarm, &instructor(by), &heading, &word);
    SignedWord { word, attachment }
}

/// Lessons as they travel.
pub fn lessons(lessons: Vec<Lesson>) -> Message {
    Message::Lessons(Lessons { lessons })
}
