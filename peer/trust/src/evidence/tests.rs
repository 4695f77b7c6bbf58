//! What evidence proves, against whom, and what it does not.

use super::*;
use crate::testing::{authority, batch, decision, have, members, robot, roster, vote};

fn signed(statement: Vec<u8>, by: u32) -> Signed {
    let signature = statement::sign(&robot(by), &roster(1).swarm_id(), &statement);
    Signed { statement, signature }
}

fn lie() -> Evidence {
    Evidence::of_two(signed(vote(2, 5, 1.0), 2), signed(vote(2, 5, -1.0), 2))
}

#[test]
fn whoever_reads_of_a_lie_reads_which_it_is() {
    let told = [Lie::TwoThings, Lie::Unfounded, Lie::TwoSamples].map(|lie| lie.to_string());
    assert!(told[0].contains("two things under one stamp"), "{told:?}");
    assert!(told[1].contains("does not follow from its votes"), "{told:?}");
    assert!(told[2].contains("two samples under one number"), "{told:?}");
}

#[test]
fn it_convicts_the_key_that_lied() {
    let stamp = Stamp { boot: 1, sequence: 5 };
    let key = robot(2).public_key();
    assert_eq!(
        lie().check(&roster(1), |_| false),
        Ok(Conviction { robot: RobotId(2), key, stamp, lie: Lie::TwoThings })
    );
    // After the robot was enrolled anew, it proves nothing against the new key.
    let mut later = members(2);
    later.robots.insert(RobotId(2), robot(22).public_key());
    assert_eq!(
        lie().check(&later.sign(&authority()).unwrap(), |_| false),
        Err(EvidenceError::Forged(RobotId(2)))
    );
    let mut gone = members(2);
    gone.robots.remove(&RobotId(2));
    assert_eq!(
        lie().check(&gone.sign(&authority()).unwrap(), |_| false),
        Err(EvidenceError::Stranger(RobotId(2)))
    );
}

#[test]
fn nobody_can_make_an_honest_robot_look_like_a_liar() {
    let said = signed(vote(2, 5, 1.0), 2);
    let check = |other| Evidence::of_two(said.clone(), other).check(&roster(1), |_| false);
    assert_eq!(check(said.clone()), Err(EvidenceError::Repeated));
    assert_eq!(check(signed(vote(2, 6, -1.0), 2)), Err(EvidenceError::Unrelated));
    assert_eq!(check(signed(vote(3, 5, -1.0), 3)), Err(EvidenceError::Unrelated));
    assert_eq!(check(signed(vote(2, 5, -1.0), 3)), Err(EvidenceError::Forged(RobotId(2))));
    // A second valid signature under the same statement is no second statement.
    let again = Signed { signature: Signature::from_bytes([1; 64]), ..said.clone() };
    assert_eq!(check(again), Err(EvidenceError::Repeated));
    let junk = Signed { statement: vec![1, 2, 3], ..said.clone() };
    assert!(matches!(check(junk), Err(EvidenceError::Malformed(_))));
    // Said in another swarm under the same stamp.
    let elsewhere = gestalt_protocol::Envelope::decode(&vote(2, 5, -1.0)).unwrap().encode();
    let swarm = statement::SwarmId::new(&authority().public_key(), "other");
    let signature = statement::sign(&robot(2), &swarm, &elsewhere);
    let elsewhere = Signed { statement: elsewhere, signature };
    assert_eq!(check(elsewhere), Err(EvidenceError::Forged(RobotId(2))));
}

/// What that robot gives, decided by nobody; of so many milliseconds, which say here whether it follows.
fn gives(author: u32, elapsed_ms: u32) -> Vec<u8> {
    let message =
        Message::Give(Give { decision: Some(decision(elapsed_ms)), votes: Vec::new(), holders: Vec::new() });
    let stamp = Stamp { boot: 1, sequence: 7 };
    gestalt_protocol::Envelope { author: RobotId(author), stamp, message, signature: None }.statement()
}

fn refutes(decision: &Decision) -> bool {
    decision.certificate.elapsed_ms == 13
}

#[test]
fn what_does_not_follow_convicts_who_gave_it_and_nobody_else() {
    let check = |statement: Vec<u8>, by| {
        let signed = signed(statement, by);
        let evidence = Evidence::of_decision(signed.statement, signed.signature);
        assert_eq!(Evidence::decode(&evidence.encode()), Ok(evidence.clone()));
        evidence.check(&roster(1), refutes)
    };
    let (stamp, key) = (Stamp { boot: 1, sequence: 7 }, robot(2).public_key());
    let proven = Conviction { robot: RobotId(2), key, stamp, lie: Lie::Unfounded };
    assert_eq!(check(gives(2, 13), 2), Ok(proven));
    assert_eq!(check(gives(2, 12), 2), Err(EvidenceError::Founded), "it may well follow");
    // By the author of the decision, which is robot 0, nothing of it was given.
    assert_eq!(check(gives(2, 13), 3), Err(EvidenceError::Forged(RobotId(2))));
    assert_eq!(check(gives(0, 13), 2), Err(EvidenceError::Forged(RobotId(0))));
    assert_eq!(check(gives(77, 13), 77), Err(EvidenceError::Stranger(RobotId(77))));
    assert_eq!(check(vote(2, 5, 1.0), 2), Err(EvidenceError::Undecided));
    assert!(matches!(check(vec![1, 2, 3], 2), Err(EvidenceError::Malformed(_))));
    // In a longer spelling it is not what was signed.
    let mut longer = gives(2, 13);
    longer.splice(1..2, [0x82, 0x00]);
    assert!(matches!(check(longer, 2), Err(EvidenceError::Malformed(_))));
}

#[test]
fn two_samples_under_one_number_convict_who_shared_them_and_nobody_else() {
    let check = |one: HeldBatch, other: HeldBatch| {
        let evidence = Evidence::of_batches(one.clone(), other.clone()).unwrap();
        assert_eq!(Evidence::of_batches(other, one), Some(evidence.clone()), "in whichever order");
        assert_eq!(Evidence::decode(&evidence.encode()), Ok(evidence.clone()));
        let json = serde_json::to_string(&evidence).unwrap();
        assert_eq!(serde_json::from_str::<Evidence>(&json).unwrap(), evidence);
        assert_eq!(evidence.lie(), Lie::TwoSamples);
        evidence.check(&roster(1), |_| true).map(|proven| (proven.robot, proven.lie))
    };
    let held = batch(2, 5, &[(1, 10), (2, 20)]);
    let proven = Ok((RobotId(2), Lie::TwoSamples));
    assert_eq!(check(held.clone(), batch(2, 6, &[(2, 21)])), proven);
    let mut elsewhere = batch(2, 6, &[(2, 20)]);
    elsewhere.samples.space = gestalt_protocol::FeatureSpaceId(5);
    let said = Envelope::from(HeldBatch { signature: None, ..elsewhere.clone() }).statement();
    elsewhere.signature = Some(signed(said, 2).signature);
    assert_eq!(check(held.clone(), elsewhere), proven, "in another feature space it is another sample");
    // The same again, by itself or among others, and others beside it.
    for honest in [batch(2, 6, &[(2, 20)]), held.clone(), batch(2, 6, &[(3, 30)])] {
        assert_eq!(check(held.clone(), honest), Err(EvidenceError::Compatible));
    }
    assert_eq!(check(held.clone(), batch(3, 6, &[(2, 21)])), Err(EvidenceError::Unrelated));
    let framed = HeldBatch { signature: batch(3, 6, &[(2, 21)]).signature, ..batch(2, 6, &[(2, 21)]) };
    assert_eq!(check(held.clone(), framed), Err(EvidenceError::Forged(RobotId(2))));
    assert_eq!(Evidence::of_batches(held.clone(), HeldBatch { signature: None, ..held }), None);
}

#[test]
fn it_travels_in_bytes_and_in_text() {
    let bytes = lie().encode();
    assert_eq!(Evidence::decode(&bytes), Ok(lie()));
    assert_eq!(bytes.len(), 2 + 2 * (1 + vote(2, 5, 1.0).len() + 64));
    let json = serde_json::to_string(&lie()).unwrap();
    assert_eq!(serde_json::from_str::<Evidence>(&json).unwrap(), lie());
    assert!(serde_json::from_str::<Evidence>(&json.replace("\"03", "\"3")).is_err());
    for cut in 0..bytes.len() {
        assert!(Evidence::decode(&bytes[..cut]).is_err(), "{cut}");
    }
    assert_eq!(Evidence::decode(&[bytes.as_slice(), &[0]].concat()), Err(DecodeError::Trailing(1)));
    assert!(matches!(Evidence::decode(&[1]), Err(DecodeError::Impossible(_))));
}

#[test]
fn it_is_bounded() {
    let mut statement = vote(2, 5, 1.0);
    statement.resize(MAX_EVIDENT, 0);
    let two = |statement: &[u8]| Evidence::of_two(signed(statement.to_vec(), 2), signed(vote(2, 5, 1.0), 2));
    assert_eq!(Evidence::decode(&two(&statement).encode()), Ok(two(&statement)));
    statement.push(0);
    assert!(Evidence::decode(&two(&statement).encode()).is_err());
    assert!(serde_json::from_str::<Evidence>(&serde_json::to_string(&two(&statement)).unwrap()).is_err());
    // Two batches may be twice as long.
    let other = signed(vec![0], 2);
    for (length, is_taken) in [(64 * 1024, true), (64 * 1024 + 1, false)] {
        let first = signed(vec![1; length], 2);
        let proof = Proof::TwoSamples { first, second: other.clone() };
        assert_eq!(Evidence::decode(&Evidence(proof).encode()).is_ok(), is_taken, "{length}");
    }
    // A decision may be almost as long as a message.
    let one = |statement: &[u8]| {
        Evidence::of_decision(statement.to_vec(), Signature::from_bytes([7; Signature::LENGTH]))
    };
    statement.resize(MAX_SIGNED, 0);
    let largest = one(&statement).encode();
    assert!(largest.len() <= Evidence::MAX_LENGTH);
    assert_eq!(Evidence::decode(&largest), Ok(one(&statement)));
    statement.push(0);
    assert!(Evidence::decode(&one(&statement).encode()).is_err());
    assert!(serde_json::from_str::<Evidence>(&serde_json::to_string(&one(&statement)).unwrap()).is_err());
    let mut long = vec![VERSION; Evidence::MAX_LENGTH + 1];
    assert!(matches!(Evidence::decode(&long), Err(DecodeError::TooLong { .. })));
    long.pop();
    assert!(matches!(Evidence::decode(&long), Err(DecodeError::Trailing(_))));
}

#[test]
fn a_decision_that_does_not_fit_in_a_message_is_not_looked_into() {
    let of_length = |length| {
        let mut statement = vote(2, 5, 1.0);
        statement.resize(length, 0);
        Evidence::of_decision(statement, Signature::from_bytes([7; Signature::LENGTH])).heading()
    };
    let heading = Heading { author: RobotId(2), stamp: Stamp { boot: 1, sequence: 5 } };
    assert_eq!(of_length(MAX_SIGNED), Ok(heading));
    for length in [MAX_SIGNED + 1, MAX_SIGNED + 2] {
        let too_long = DecodeError::TooLong { length, limit: MAX_SIGNED };
        assert_eq!(of_length(length), Err(EvidenceError::Malformed(too_long)));
    }
}

#[test]
fn two_statements_are_the_same_evidence_in_whichever_order_they_were_met() {
    let (one, other) = (signed(vote(2, 5, 1.0), 2), signed(have(2, 5), 2));
    assert_eq!(Evidence::of_two(one.clone(), other.clone()), Evidence::of_two(other.clone(), one.clone()));
    let Proof::TwoThings { first, second } = Evidence::of_two(one.clone(), other.clone()).0 else {
        unreachable!()
    };
    assert!(first < second, "by their bytes");
    let length = one.statement.len() + other.statement.len();
    assert_eq!(Evidence::of_two(one, other.clone()).length(), length);
    assert_eq!(
        Evidence::of_decision(other.statement.clone(), other.signature).length(),
        other.statement.len()
    );
}
