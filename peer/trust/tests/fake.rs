//! Emulated swarms take the same paths as real ones.

use std::time::Duration;

use gestalt_protocol::{Envelope, Give, Have, Message, RobotId, Stamp};
use gestalt_trust::{Budget, Distrust, Fake, Identity, Membership, Roster, Verifier, Witness, statement};

fn said(sequence: u32, other: bool) -> Vec<u8> {
    let stamp = Stamp { boot: 1, sequence };
    let give = Message::Give(Give { decision: None, votes: Vec::new(), holders: Vec::new() });
    let have =
        Have { round: None, decision: None, holders: 0, votes: Vec::new(), knowledge: None, answer: false };
    let message = if other { give } else { Message::Have(have) };
    Envelope { author: RobotId(1), stamp, message, signature: None }.encode()
}

#[test]
fn a_fake_swarm_believes_doubts_and_convicts() {
    let robots = (0..3).map(|n| (RobotId(n), Identity::<Fake>::fake(n.into()).public_key())).collect();
    let members = Membership { swarm: "demo".to_owned(), epoch: 1, robots, ..Membership::default() };
    let roster = members.sign(&Identity::<Fake>::fake(99)).unwrap();
    assert_eq!(Roster::<Fake>::parse(roster.to_json().as_bytes()).unwrap(), roster);
    // What is signed here is nothing to a robot.
    assert!(Roster::<gestalt_trust::Ed25519>::parse(roster.to_json().as_bytes()).is_err());

    let swarm = roster.swarm_id();
    let mut witness = Witness::new(&roster);
    let mut verifier = Verifier::new(roster, Budget::default());
    let liar = Identity::<Fake>::fake(1);
    let both = [said(1, false), said(1, true)];
    let found = both.each_ref().map(|said| {
        let signature = statement::sign(&liar, &swarm, said);
        verifier.check(Duration::ZERO, said, Some(&signature)).unwrap();
        witness.observe(said, &signature)
    });
    let evidence = found[1].clone().expect("two statements under one stamp");
    verifier.convict(Duration::ZERO, &evidence, |_| false).unwrap();
    let more = said(2, false);
    let signature = statement::sign(&liar, &swarm, &more);
    assert_eq!(verifier.check(Duration::ZERO, &more, Some(&signature)), Err(Distrust::Convicted));
}
