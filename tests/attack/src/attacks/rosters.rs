//! Rosters that the authority did not write, or wrote twice.

use std::collections::BTreeMap;

use gestalt_protocol::RobotId;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::attack::{Attack, Counted, Played, Setting, Tier};
use crate::swarm::world::{authority, key, members};
use crate::trust::{Budget, MAX_ROSTER, Membership, PublicKey, Roster, RosterError, Verifier};

/// The members that the robots hold.
const HELD: u64 = 5;

pub const ALL: &[Attack] = &[
    Attack {
        number: "13",
        what: "offers rosters: an older one, by another authority, with a weak key, with one robot or key twice, of 100,000 robots",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: "nothing, and each cause is named",
        counted: Counted::Some(&[
            "Older",
            "OtherSwarm",
            "Forged",
            "Key",
            "SharedKey",
            "ExpelledKey",
            "Malformed",
            "TooLong",
            "TooMany",
        ]),
        gap: None,
        play: offered,
    },
    Attack {
        number: "13",
        what: "offers two rosters of one epoch, both truly signed",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "the one that was there first stays, and the operator is told",
        counted: Counted::Some(&["Contradiction"]),
        gap: None,
        play: twice_one_epoch,
    },
    Attack {
        number: "13",
        what: "flips one bit of every byte of a roster",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: "none is another roster",
        counted: Counted::Some(&["Malformed"]),
        gap: None,
        play: flipped,
    },
];

fn name(error: &RosterError) -> String {
    let words = format!("{error:?}");
    words.split([' ', '(', '{']).next().unwrap_or_default().to_owned()
}

/// Offers all of them; none may be taken.
fn refused(offers: impl IntoIterator<Item = Vec<u8>>) -> Played {
    let held: Roster = members(5, HELD).sign(&authority()).expect("members that go together");
    let mut verifier = Verifier::new(held.clone(), Budget::default());
    let (mut refused, mut reached) = (BTreeMap::<String, u64>::new(), Ok(()));
    for json in offers {
        let answer = verifier.roster().successor(&json).and_then(|offered| match offered {
            Some(offered) => verifier.adopt(offered),
            None => Ok(false),
        });
        match answer {
            Err(error) => *refused.entry(name(&error)).or_default() += 1,
            Ok(false) => {}
            Ok(true) => reached = Err(format!("taken: {}", String::from_utf8_lossy(&json))),
        }
    }
    if *verifier.roster() != held {
        reached = Err("the roster held is another one".to_owned());
    }
    Played { reached, refused, silent: 0 }
}

fn json(members: Membership, by: u32) -> Option<Vec<u8>> {
    Some(members.sign(&key(by)).ok()?.to_json().into_bytes())
}

fn offered(seed: u64) -> Played {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let newer = members(5, HELD + 1);
    let truly = String::from_utf8(json(newer.clone(), 1000).unwrap_or_default()).unwrap_or_default();
    let robot = |n: u32| key(n).public_key().to_string();
    let twice = truly.replace("\"robots\": {", &format!("\"robots\": {{\n    \"3\": \"{}\",", robot(90)));
    let some = robot(1);
    let crowd: Vec<String> = (0..100_000).map(|n| format!("\"{n}\":\"{some}\"")).collect();
    let crowd = format!("{{\"swarm\":\"attacked\",\"robots\":{{{}}}}}", crowd.join(","));
    let offers = [
        json(members(5, rng.random_range(0..HELD)), 1000),
        json(newer.clone(), 2000),
        // By somebody who names the true authority.
        Some(truly.replace("\"epoch\": 6", "\"epoch\": 7").into_bytes()),
        Some(truly.replace(&robot(2), &robot(91)).into_bytes()),
        Some(twice.into_bytes()),
        Some(crowd.into_bytes()),
        Some(vec![b' '; MAX_ROSTER + 1]),
        Some(Vec::new()),
    ];
    let mut played = refused(offers.into_iter().flatten());
    // What not even the authority can sign.
    let mut shared = newer.clone();
    shared.robots.insert(RobotId(9), key(1).public_key());
    let mut back = newer.clone();
    back.expelled.insert(RobotId(9), key(1).public_key());
    let mut weakened = newer.clone();
    weakened.robots.insert(RobotId(9), PublicKey::from_bytes([0; 32]));
    let mut large = newer;
    let mut some_key = || PublicKey::from_bytes(rng.random());
    large.robots.extend((10..5000).map(|n| (RobotId(n), some_key())));
    for members in [shared, back, weakened, large] {
        match members.sign(&authority()) {
            Err(error) => *played.refused.entry(name(&error)).or_default() += 1,
            Ok(_) => played.reached = Err("members that do not go together were signed".to_owned()),
        }
    }
    played
}

fn twice_one_epoch(_: u64) -> Played {
    let mut other = members(5, HELD);
    other.robots.insert(RobotId(6), key(6).public_key());
    refused(json(other, 1000))
}

fn flipped(seed: u64) -> Played {
    let truly = json(members(3, HELD + 1), 1000).unwrap_or_default();
    let bit = 1 << (seed % 8);
    let flips = (0..truly.len()).map(|place| {
        let mut json = truly.clone();
        json[place] ^= bit;
        json
    });
    let read = |json: &Vec<u8>| Roster::parse(json).ok();
    let original = read(&truly);
    // White space may be another white space: that is the same roster.
    let others = flips.filter(|json| read(json).is_none_or(|roster| Some(roster) != original));
    refused(others.collect::<Vec<_>>())
}
