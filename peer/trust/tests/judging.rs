//! What a judge lets in follows its roster, in all of its parts.

use std::collections::BTreeMap;
use std::time::Duration;

use gestalt_protocol::{
    Batches, ClassId, DecodeError, Envelope, FeatureSpaceId, HeldBatch, MAX_MESSAGE, Message, RobotId,
    RoundId, SampleId, Samples, SharedSample, Stamp, Vector, VocabularyId, Vote,
};
use gestalt_trust::{Distrust, Identity, Judge, MAX_ROSTER, Membership, Roster, RosterError, statement};

const NOW: Duration = Duration::from_secs(1000);
const ROUND: RoundId = RoundId { counter: 3, opener: RobotId(1), life: 77 };

fn robot(number: u8) -> Identity {
    Identity::from_bytes(&[number; 32])
}

/// Robots 1 to 3; in the second epoch robot 3 has another key.
fn roster(epoch: u64) -> Roster {
    let key = |number: u8| robot(if epoch > 1 && number == 3 { 33 } else { number }).public_key();
    let robots = (1..4).map(|number| (RobotId(number.into()), key(number))).collect();
    let expelled = match epoch {
        1 => BTreeMap::new(),
        _ => BTreeMap::from([(RobotId(3), robot(3).public_key())]),
    };
    let members = Membership { swarm: "demo".to_owned(), epoch, robots, expelled, ..Membership::default() };
    members.sign(&robot(200)).unwrap()
}

fn signed(author: u32, sequence: u32, message: Message, by: u8) -> Envelope {
    let stamp = Stamp { boot: 1, sequence };
    let said = Envelope { author: RobotId(author), stamp, message, signature: None };
    let signature = statement::sign(&robot(by), &roster(1).swarm_id(), &said.statement());
    Envelope { signature: Some(signature), ..said }
}

fn vote(author: u32, sequence: u32, evidence: f32, by: u8) -> Envelope {
    let (vocabulary, evidence) = (VocabularyId(5), vec![evidence, -evidence]);
    let vote = Vote { round: ROUND, vocabulary, evidence, looks: 1.0, unknown: None, named: vec![] };
    signed(author, sequence, Message::Vote(vote), by)
}

fn batch(author: u32, sequence: u32, by: u8) -> HeldBatch {
    let id = SampleId { author: RobotId(author), life: 7, number: sequence };
    let vector = Vector::F32(vec![0.5, 1.5]);
    let samples = vec![SharedSample { id, class: ClassId(1), round: ROUND, vector }];
    let samples = Samples { space: FeatureSpaceId(9), samples };
    let said = signed(author, sequence, Message::Samples(samples.clone()), by);
    HeldBatch { robot: said.author, stamp: said.stamp, samples, signature: said.signature }
}

#[test]
fn a_newer_roster_is_gone_by_everywhere_and_no_other() {
    let mut judge = Judge::new(roster(1), |_| false);
    assert!(judge.is_member(RobotId(3)) && !judge.is_member(RobotId(4)));
    assert_eq!(judge.envelope(NOW, &vote(3, 1, 1.0, 3)), Ok(()));
    // It said two things by its old key.
    assert_eq!(judge.envelope(NOW, &vote(3, 1, 2.0, 3)), Err(Distrust::Convicted));
    assert!(!judge.adopt(roster(1)).unwrap(), "no newer");
    assert_eq!(judge.envelope(NOW, &vote(3, 2, 1.0, 3)), Err(Distrust::Convicted));

    assert!(judge.adopt(roster(2)).unwrap());
    assert_eq!(judge.roster(), &roster(2));
    assert!(matches!(judge.adopt(roster(1)), Err(RosterError::Older { held: 2, offered: 1 })));
    // What the old key did is forgotten with it; votes and samples are the new one's.
    assert!(judge.untold(NOW).is_empty());
    assert!(judge.envelope(NOW, &vote(3, 3, 1.0, 3)).is_err());
    assert_eq!(judge.envelope(NOW, &vote(3, 1, 3.0, 33)), Ok(()));
    let stamp = Stamp { boot: 1, sequence: 20 };
    let batches = vec![batch(3, 8, 3), batch(3, 9, 33), batch(2, 9, 2)];
    let message = Message::Batches(Batches { batches });
    let mut given = Envelope { author: RobotId(1), stamp, message, signature: None };
    assert!(judge.passed_on(NOW, &mut given).is_some(), "the first is the old key's");
    assert_eq!(given.message, Message::Batches(Batches { batches: vec![batch(3, 9, 33), batch(2, 9, 2)] }));
    assert_eq!(judge.passed_on(NOW, &mut given), None);
}

#[test]
fn evidence_against_who_keeps_its_key_outlives_a_newer_roster() {
    let mut judge = Judge::new(roster(1), |_| false);
    assert_eq!(judge.envelope(NOW, &vote(2, 1, 1.0, 2)), Ok(()));
    assert_eq!(judge.envelope(NOW, &vote(2, 1, 2.0, 2)), Err(Distrust::Convicted));
    assert!(judge.adopt(roster(2)).unwrap());
    assert_eq!(judge.untold(NOW).len(), 1);
    assert_eq!(judge.envelope(NOW, &vote(2, 2, 1.0, 2)), Err(Distrust::Convicted));
}

#[test]
fn what_is_as_long_as_it_may_be_is_read() {
    let mut statement = vote(1, 1, 1.0, 1).statement();
    statement.resize(MAX_MESSAGE, 0);
    assert!(gestalt_trust::statement::heading(&statement).is_ok());
    statement.push(0);
    let limit = MAX_MESSAGE;
    let too_long = DecodeError::TooLong { length: limit + 1, limit };
    assert_eq!(gestalt_trust::statement::heading(&statement).unwrap_err(), too_long);
}

/// Members whose roster has so many bytes of JSON: mostly the keys of robots that were expelled.
fn of_length(length: usize) -> Membership {
    let mut members = Membership { swarm: "d".to_owned(), epoch: 1, ..Membership::default() };
    let written = |members: &Membership| members.clone().sign(&robot(200)).unwrap().to_json().len();
    let key = |number: u32| {
        let mut secret = [9; 32];
        secret[..4].copy_from_slice(&number.to_le_bytes());
        Identity::<gestalt_trust::Ed25519>::from_bytes(&secret).public_key()
    };
    members.expelled.extend((1000..1002).map(|number| (RobotId(number), key(number))));
    let two = written(&members);
    members.expelled.insert(RobotId(1002), key(1002));
    let line = written(&members) - two;
    let robots = u32::try_from((length - two) / line).unwrap();
    let most = 4000;
    members.expelled.extend((1003..1002 + robots.min(most)).map(|number| (RobotId(number), key(number))));
    members.robots.extend((1002 + most..1002 + robots).map(|number| (RobotId(number), key(number))));
    // The rest of less than a line: a longer name, and a later epoch.
    let name = (length - written(&members)).min(63);
    members.swarm += &"x".repeat(name);
    let digits = u32::try_from(length - written(&members)).unwrap();
    members.epoch = 10_u64.pow(digits);
    assert_eq!(written(&members).min(MAX_ROSTER), length.min(MAX_ROSTER));
    members
}

#[test]
fn a_roster_may_be_as_long_as_it_may() {
    let longest = of_length(MAX_ROSTER).sign(&robot(200)).unwrap();
    assert_eq!(longest.to_json().len(), MAX_ROSTER);
    assert_eq!(Roster::<gestalt_trust::Ed25519>::parse(longest.to_json().as_bytes()).unwrap(), longest);
    let too_long = |error: RosterError| {
        assert!(matches!(error, RosterError::TooLong { length, .. } if length == MAX_ROSTER + 1), "{error}");
    };
    let members = Membership { epoch: 10 * longest.members().epoch, ..longest.members().clone() };
    too_long(members.sign(&robot(200)).unwrap_err());
    too_long(Roster::<gestalt_trust::Ed25519>::parse((longest.to_json() + " ").as_bytes()).unwrap_err());
}
