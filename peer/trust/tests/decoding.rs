//! Whatever arrives, reading it gives a value or an error.

use std::time::Duration;

use gestalt_protocol::{Envelope, RobotId, Signature};
use gestalt_trust::{
    Budget, Evidence, Identity, Membership, PublicKey, Roster, RosterError, Verifier, Witness, statement,
};
use proptest::prelude::*;

fn roster() -> Roster {
    let robots = [(RobotId(1), Identity::from_bytes(&[1; 32]).public_key())].into();
    let members = Membership { swarm: "demo".to_owned(), epoch: 1, robots, ..Membership::default() };
    members.sign(&Identity::from_bytes(&[2; 32])).unwrap()
}

fn bytes() -> impl Strategy<Value = Vec<u8>> {
    let any = prop::collection::vec(any::<u8>(), 0..400);
    // Half of them get past the version bytes.
    (any, prop::option::of(prop::sample::select(vec![1_u8, 3]))).prop_map(|(mut bytes, version)| {
        if let (Some(version), Some(first)) = (version, bytes.first_mut()) {
            *first = version;
        }
        bytes
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4096, ..ProptestConfig::default() })]

    #[test]
    fn any_bytes_give_a_value_or_an_error(bytes in bytes(), signature in any::<[u8; 32]>()) {
        let signature = Signature::from_bytes([signature, signature].concat().try_into().unwrap());
        if let Ok(envelope) = statement::read(&bytes) {
            prop_assert_eq!(envelope.encode(), bytes.clone());
            prop_assert_eq!(statement::heading(&bytes).unwrap().author, envelope.author);
        }
        let _ = postcard::from_bytes::<Signature>(&bytes);
        let _ = postcard::from_bytes::<PublicKey>(&bytes);
        prop_assert!(Roster::<gestalt_trust::Ed25519>::parse(&bytes).is_err());
        if let Ok(evidence) = Evidence::decode(&bytes) {
            prop_assert!(evidence.check(&roster(), |_| true).is_err());
        }
        let mut verifier = Verifier::new(roster(), Budget::default());
        prop_assert!(verifier.check(Duration::ZERO, &bytes, Some(&signature)).is_err());
        let mut witness = Witness::new(&roster());
        prop_assert_eq!(witness.observe(&bytes, &signature), None);
    }

    #[test]
    fn any_text_gives_a_value_or_an_error(text in ".{0,200}", hex in "[0-9a-f]{0,130}") {
        for text in [&text, &hex] {
            if let Ok(key) = text.parse::<PublicKey>() {
                prop_assert_eq!(&key.to_string(), text);
            }
            if let Ok(signature) = text.parse::<Signature>() {
                prop_assert_eq!(&signature.to_string(), text);
            }
            let _ = serde_json::from_str::<Evidence>(text);
        }
    }

    #[test]
    fn a_roster_with_a_byte_changed_is_the_same_one_or_none(place in any::<prop::sample::Index>(), to in any::<u8>()) {
        let mut json = roster().to_json().into_bytes();
        let place = place.index(json.len());
        json[place] = to;
        let read: Result<Roster, RosterError> = Roster::parse(&json);
        if let Ok(read) = read {
            prop_assert_eq!(read, roster());
        }
    }
}

#[test]
fn what_robots_say_reads_as_it_was_written() {
    let envelope = Envelope {
        author: RobotId(7),
        stamp: gestalt_protocol::Stamp { boot: 300, sequence: u32::MAX },
        message: gestalt_protocol::Message::Give(gestalt_protocol::Give {
            decision: None,
            votes: Vec::new(),
            holders: Vec::new(),
        }),
        signature: None,
    };
    assert_eq!(statement::read(&envelope.encode()), Ok(envelope));
}
