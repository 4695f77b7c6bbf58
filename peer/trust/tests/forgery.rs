//! Nothing but the author's own words passes: every bit of a statement, a signature and a key counts.

use std::time::Duration;

use gestalt_protocol::{Envelope, Give, Message, RobotId, RoundId, Signature, Stamp, VocabularyId, Vote};
use gestalt_trust::{
    Budget, Distrust, Ed25519, Identity, Membership, PublicKey, Roster, Scheme, Verifier, statement,
};
use proptest::prelude::*;

fn robot(number: u8) -> Identity {
    Identity::from_bytes(&[number; 32])
}

fn roster(swarm: &str) -> Roster {
    let robots = (0..4).map(|number| (RobotId(number.into()), robot(number).public_key())).collect();
    let members = Membership { swarm: swarm.to_owned(), epoch: 1, robots, ..Membership::default() };
    members.sign(&robot(200)).unwrap()
}

fn vote(evidence: Vec<f32>) -> Message {
    let round = RoundId { counter: 3, opener: RobotId(1), life: 77 };
    Message::Vote(Vote {
        round,
        vocabulary: VocabularyId(5),
        evidence,
        looks: 2.0,
        unknown: None,
        named: vec![],
    })
}

fn said(author: u8, message: Message) -> Vec<u8> {
    let stamp = Stamp { boot: 2, sequence: 300 };
    Envelope { author: RobotId(author.into()), stamp, message, signature: None }.encode()
}

/// All neighbours of these bytes: one bit each.
fn flipped(bytes: &[u8]) -> impl Iterator<Item = Vec<u8>> {
    (0..8 * bytes.len()).map(|bit| {
        let mut flipped = bytes.to_vec();
        flipped[bit / 8] ^= 1 << (bit % 8);
        flipped
    })
}

#[test]
fn every_bit_counts() {
    let roster = roster("demo");
    let said = said(1, vote(vec![1.5, -0.5, -1.0]));
    let signature = statement::sign(&robot(1), &roster.swarm_id(), &said);
    assert!(roster.check(&said, &signature).is_ok());
    for other in flipped(&said) {
        assert!(roster.check(&other, &signature).is_err(), "{other:?}");
    }
    for other in flipped(signature.as_bytes()) {
        let other = Signature::from_bytes(other.try_into().unwrap());
        assert_eq!(roster.check(&said, &other), Err(Distrust::Forged), "{other}");
    }
    for other in flipped(robot(1).public_key().as_bytes()) {
        let other = PublicKey::from_bytes(other.try_into().unwrap());
        let Some(key) = Ed25519::key(&other) else { continue };
        assert!(!statement::is_signed::<Ed25519>(&key, &roster.swarm_id(), &said, &signature), "{other}");
    }
}

#[test]
fn nothing_can_be_added_or_taken_away() {
    let roster = roster("demo");
    let said = said(1, vote(vec![]));
    let signature = statement::sign(&robot(1), &roster.swarm_id(), &said);
    for other in [&said[..said.len() - 1], &[said.as_slice(), &[0]].concat()] {
        assert!(roster.check(other, &signature).is_err());
    }
}

#[test]
fn one_kind_of_message_is_not_taken_for_another() {
    let roster = roster("demo");
    let said = said(1, Message::Give(Give { decision: None, votes: Vec::new(), holders: Vec::new() }));
    let signature = statement::sign(&robot(1), &roster.swarm_id(), &said);
    assert!(roster.check(&said, &signature).is_ok());
    // The kind is the byte behind author, boot and a sequence of two bytes.
    for kind in (0..=u8::MAX).filter(|kind| *kind != said[5]) {
        let mut other = said.clone();
        other[5] = kind;
        assert_eq!(roster.check(&other, &signature), Err(Distrust::Forged), "{kind}");
    }
}

proptest! {
    #[test]
    fn only_the_author_speaks_in_its_name_and_only_in_its_swarm(
        author in 0..4_u8, signer in 0..6_u8, swarms in any::<(bool, bool)>(), names in any::<(u8, u8)>(),
        evidence in prop::collection::vec(-6.0..6.0_f32, 2..7),
    ) {
        let name = |other, number| if other { format!("swarm{number}") } else { "demo".to_owned() };
        let (signed_in, heard_in) = (roster(&name(swarms.0, names.0)), roster(&name(swarms.1, names.1)));
        let said = said(author, vote(evidence));
        let signature = statement::sign(&robot(signer), &signed_in.swarm_id(), &said);
        let believed = author == signer && signed_in.swarm_id() == heard_in.swarm_id();
        let mut verifier = Verifier::new(heard_in, Budget::default());
        let answer = verifier.check(Duration::ZERO, &said, Some(&signature));
        prop_assert_eq!(answer, if believed { Ok(()) } else { Err(Distrust::Forged) });
    }
}
