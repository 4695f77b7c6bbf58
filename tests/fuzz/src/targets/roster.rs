//! Who belongs to the swarm.

use std::collections::BTreeMap;

use gestalt_protocol::{RobotId, hex};
use gestalt_trust::{
    Budget, Ed25519, Fake, MAX_ROSTER, Membership, PublicKey, ROSTER_DOMAIN, Roles, Roster, RosterError,
    Scheme, Verifier,
};
use serde_json::{Map, Value};

use crate::memory::bounded;
use crate::swarm;

/// A roster is read as it was written, has members that can be members together, and takes the place of an older one alone. Nobody
/// but its authority wrote it.
///
/// # Panics
/// If not.
pub fn run(bytes: &[u8]) {
    if let Ok(roster) = bounded(bytes, || Roster::<Ed25519>::parse(bytes)) {
        accepted(&roster, bytes);
    }
    if let Ok(roster) = bounded(bytes, || Roster::<Fake>::parse(bytes)) {
        accepted(&roster, bytes);
        succeeds(&roster, bytes);
    }
    let Some(signed) = sign(bytes) else { return };
    match bounded(&signed, || Roster::<Fake>::parse(&signed)) {
        Ok(roster) => {
            accepted(&roster, &signed);
            succeeds(&roster, &signed);
        }
        Err(error) => assert!(!matches!(error, RosterError::Forged), "its authority did sign it"),
    }
}

fn accepted<S: Scheme>(roster: &Roster<S>, json: &[u8]) {
    assert!(json.len() <= MAX_ROSTER);
    assert_eq!(&Roster::<S>::parse(roster.to_json().as_bytes()).expect("it is one"), roster);
    let Membership { robots, instructors, expelled, .. } = roster.members();
    let keys: BTreeMap<&PublicKey, ()> =
        robots.values().chain(instructors.values().map(|it| &it.key)).map(|key| (key, ())).collect();
    assert_eq!(keys.len(), robots.len() + instructors.len(), "a key is one member's");
    assert!(expelled.values().all(|key| !keys.contains_key(key)));
}

fn succeeds(roster: &Roster<Fake>, json: &[u8]) {
    let held = swarm::roster();
    let newer = roster.newer_than(held);
    assert_eq!(matches!(held.successor(json), Ok(Some(_))), newer);
    let mut verifier = Verifier::new(held.clone(), Budget::default());
    assert_eq!(verifier.adopt(roster.clone()).unwrap_or(false), newer);
    assert_eq!(verifier.roster(), if newer { roster } else { held });
}

/// The JSON of a roster with the swarm's authority and its signature put in, if it has members to sign for.
fn sign(json: &[u8]) -> Option<Vec<u8>> {
    let mut value: Value = serde_json::from_slice(json).ok()?;
    let document = value.as_object_mut()?;
    let authority = swarm::authority();
    let members = Membership {
        swarm: document.get("swarm")?.as_str()?.to_owned(),
        epoch: document.get("epoch")?.as_u64()?,
        robots: entries(document.get("robots"))?,
        instructors: entries(document.get("instructors"))?,
        local: document
            .get("local")
            .map_or(Some(Roles::NONE), |roles| serde_json::from_value(roles.clone()).ok())?,
        expelled: entries(document.get("expelled"))?,
    };
    let signed = postcard::to_extend(&(authority.public_key(), &members), ROSTER_DOMAIN.to_vec()).ok()?;
    let signature = Fake::sign(&Fake::secret(&authority.to_bytes()), &signed);
    document.insert("authority".to_owned(), authority.public_key().to_string().into());
    document.insert("signature".to_owned(), hex::Hex(signature.as_bytes()).to_string().into());
    serde_json::to_vec(&value).ok()
}

fn entries<K, V>(map: Option<&Value>) -> Option<BTreeMap<K, V>>
where
    K: Ord + std::str::FromStr,
    V: serde::de::DeserializeOwned,
{
    let empty = Map::new();
    let map = map.map_or(Some(&empty), Value::as_object)?;
    let entry = |(name, entry): (&String, &Value)| {
        Some((name.parse().ok()?, serde_json::from_value(entry.clone()).ok()?))
    };
    map.iter().map(entry).collect()
}

/// A roster to begin with: the swarm's own, of another epoch, without some of its members or with one more.
pub fn seed(rng: &mut impl rand::Rng) -> Vec<u8> {
    let mut members = swarm::members();
    members.epoch = u64::from(crate::values::number(rng));
    match crate::values::number(rng) {
        0 => members.robots.clear(),
        1 => members.instructors.clear(),
        2 => drop(members.expelled.pop_first()),
        other => {
            let robot = RobotId(100 + other % 10);
            members.robots.insert(robot, swarm::identity(robot).public_key());
        }
    }
    members.sign(&swarm::authority()).expect("members that go together").to_json().into_bytes()
}
