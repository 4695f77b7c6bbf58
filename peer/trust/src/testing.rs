//! A small swarm for tests.

use gestalt_protocol::{
    Certificate, ClassId, Decision, Envelope, FeatureSpaceId, FusionRule, Have, HeldBatch, Message, RobotId,
    RoundId, SampleId, Samples, SharedSample, Stamp, Terms, Vector, VocabularyId, Vote,
};

use crate::identity::Identity;
use crate::membership::Membership;
use crate::roster::Roster;
use crate::statement;

/// Who enrols the robots.
pub(crate) fn authority() -> Identity {
    Identity::from_bytes(&[0xff; 32])
}

/// The identity that robot is enrolled with.
pub(crate) fn robot(number: u32) -> Identity {
    let mut secret = [1; 32];
    secret[..4].copy_from_slice(&number.to_le_bytes());
    Identity::from_bytes(&secret)
}

/// Robots 0 to 3 of the swarm `demo`.
pub(crate) fn members(epoch: u64) -> Membership {
    let robots = (0..4).map(|number| (RobotId(number), robot(number).public_key())).collect();
    Membership { swarm: "demo".to_owned(), epoch, robots, ..Membership::default() }
}

/// Those, enrolled.
pub(crate) fn roster(epoch: u64) -> Roster {
    members(epoch).sign(&authority()).expect("members that go together")
}

/// A vote of that robot.
pub(crate) fn vote(author: u32, sequence: u32, evidence: f32) -> Vec<u8> {
    let round = RoundId { counter: 1, opener: RobotId(0), life: 7 };
    let evidence = vec![evidence, -evidence];
    said(
        author,
        sequence,
        Message::Vote(Vote {
            round,
            vocabulary: VocabularyId(9),
            evidence,
            looks: 1.0,
            unknown: None,
            named: vec![],
        }),
    )
}

/// Another kind of message of that robot.
pub(crate) fn have(author: u32, sequence: u32) -> Vec<u8> {
    let have =
        Have { round: None, decision: None, holders: 0, votes: Vec::new(), knowledge: None, answer: false };
    said(author, sequence, Message::Have(have))
}

/// A batch of that robot under a stamp, with these samples: a number and a coordinate each.
pub(crate) fn batch(author: u32, sequence: u32, samples: &[(u32, i8)]) -> HeldBatch {
    let round = RoundId { counter: 1, opener: RobotId(0), life: 7 };
    let sample = |(number, at): &(u32, i8)| SharedSample {
        id: SampleId { author: RobotId(author), life: 9, number: *number },
        class: ClassId(0),
        round,
        vector: Vector::I8(vec![*at]),
    };
    let samples = Samples { space: FeatureSpaceId(4), samples: samples.iter().map(sample).collect() };
    let stamp = Stamp { boot: 1, sequence };
    let unsigned = HeldBatch { robot: RobotId(author), stamp, samples, signature: None };
    let statement = Envelope::from(unsigned.clone()).statement();
    let signature = statement::sign(&robot(author), &roster(1).swarm_id(), &statement);
    HeldBatch { signature: Some(signature), ..unsigned }
}

/// That nothing was decided, of no vote, in so many milliseconds.
pub(crate) fn decision(elapsed_ms: u32) -> Decision {
    let round = RoundId { counter: 1, opener: RobotId(0), life: 7 };
    let certificate = Certificate {
        vocabulary: VocabularyId(9),
        rule: FusionRule::LogPool,
        pool: None,
        probabilities: vec![],
        unknown: None,
        named: vec![],
        votes: vec![],
        others: vec![],
        robots: 1,
        quorum: 1,
        elapsed_ms,
        terms: Terms::default(),
    };
    Decision { round, class: None, confidence: 0.5, author: RobotId(0), is_final: true, certificate }
}

fn said(author: u32, sequence: u32, message: Message) -> Vec<u8> {
    Envelope { author: RobotId(author), stamp: Stamp { boot: 1, sequence }, message, signature: None }
        .encode()
}
