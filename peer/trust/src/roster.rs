//! Who belongs to the swarm, by the word of its authority.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use gestalt_protocol::{RobotId, Signature};
use sha2::{Digest, Sha256};

use crate::distrust::Distrust;
use crate::document::Document;
use crate::identity::Identity;
use crate::membership::Membership;
use crate::public_key::PublicKey;
use crate::roster_error::{Member, RosterError};
use crate::scheme::{Ed25519, Scheme};
use crate::statement::{self, Heading, SwarmId};

/// The longest roster accepted, in bytes of JSON: 512 KiB, in which [`MAX_ROBOTS`](gestalt_protocol::MAX_ROBOTS) robots find
/// room.
pub const MAX_ROSTER: usize = 512 * 1024;

impl Membership {
    /// The roster of these members, by that authority.
    ///
    /// # Errors
    /// [`RosterError`] for members that no robot would accept, whoever signed for them.
    pub fn sign<S: Scheme>(self, authority: &Identity<S>) -> Result<Roster<S>, RosterError> {
        let signature = authority.sign(&self.signed_bytes(&authority.public_key()));
        let roster = Roster::checked(self, authority.public_key(), signature)?;
        let length = roster.to_json().len();
        if length > MAX_ROSTER {
            return Err(RosterError::TooLong { length, limit: MAX_ROSTER });
        }
        Ok(roster)
    }
}

/// Who belongs to a swarm, in one epoch: checked, and signed by an authority.
///
/// It proves that *its* authority wrote it, not that this authority is the right one: compare [`Roster::swarm_id`] with the one
/// the robot was enrolled in, before the first roster is taken. All later ones are compared by
/// [`Verifier::adopt`](crate::Verifier::adopt).
#[derive(Clone, Debug, PartialEq)]
pub struct Roster<S: Scheme = Ed25519> {
    members: Membership,
    authority: PublicKey,
    signature: Signature,
    swarm: SwarmId,
    keys: BTreeMap<RobotId, S::Key>,
}

impl<S: Scheme> Roster<S> {
    pub(crate) fn checked(
        members: Membership,
        authority: PublicKey,
        signature: Signature,
    ) -> Result<Self, RosterError> {
        let signer = S::key(&authority).ok_or(RosterError::Key { member: Member::Authority })?;
        // First of all: what somebody else made up is not worth a further look.
        if !S::verify(&signer, &members.signed_bytes(&authority), &signature) {
            return Err(RosterError::Forged);
        }
        members.check()?;
        let bad = |member| RosterError::Key { member };
        let keys = members.robots.iter().map(|(robot, key)| {
            S::key(key).map(|key| (*robot, key)).ok_or_else(|| bad(Member::Robot(*robot)))
        });
        let keys = keys.collect::<Result<_, _>>()?;
        if let Some((name, _)) = members.instructors.iter().find(|(_, it)| S::key(&it.key).is_none()) {
            return Err(bad(Member::Instructor(name.clone())));
        }
        let swarm = SwarmId::new(&authority, &members.swarm);
        Ok(Self { members, authority, signature, swarm, keys })
    }

    /// Reads the JSON of a roster, of at most [`MAX_ROSTER`] bytes, and checks all of it.
    ///
    /// # Errors
    /// [`RosterError`] for what is no roster, was not signed by the authority it names, or has members that exclude each other.
    pub fn parse(json: &[u8]) -> Result<Self, RosterError> {
        let (members, authority, signature) = Self::unchecked(json)?;
        Self::checked(members, authority, signature)
    }

    /// Reads the JSON of a roster that came from anywhere, if it is to take the place of this one; `None` for this one again.
    ///
    /// What is of another swarm, or older, is told apart before any signature or key is looked at, so repeating it and making it up
    /// costs a robot little.
    ///
    /// # Errors
    /// [`RosterError::OtherSwarm`], [`RosterError::Older`], [`RosterError::Contradiction`], and those of [`Roster::parse`].
    pub fn successor(&self, json: &[u8]) -> Result<Option<Self>, RosterError> {
        self.successor_if(json, || true)
    }

    /// The same, where one that follows by its own words is checked only if it may be: that costs more than all before it.
    ///
    /// # Errors
    /// As [`Roster::successor`]; [`RosterError::TooFast`] if it may not be.
    pub fn successor_if(
        &self,
        json: &[u8],
        may_check: impl FnOnce() -> bool,
    ) -> Result<Option<Self>, RosterError> {
        let (members, authority, signature) = Self::unchecked(json)?;
        let swarm = SwarmId::new(&authority, &members.swarm);
        if !self.precedes(swarm, &members, None)? {
            return Ok(None);
        }
        if !may_check() {
            return Err(RosterError::TooFast);
        }
        let offered = Self::checked(members, authority, signature)?;
        Ok(self.is_succeeded_by(&offered)?.then_some(offered))
    }

    /// Whether that roster is to take the place of this one; not if it is this one again.
    pub(crate) fn is_succeeded_by(&self, offered: &Self) -> Result<bool, RosterError> {
        let contradiction = RosterError::Contradiction { epoch: offered.members.epoch };
        self.precedes(offered.swarm, &offered.members, Some(contradiction))
    }

    /// The same of members that may not be signed yet: until they are, two versions of one epoch contradict nobody.
    fn precedes(
        &self,
        swarm: SwarmId,
        members: &Membership,
        contradiction: Option<RosterError>,
    ) -> Result<bool, RosterError> {
        let (held, offered) = (self.members.epoch, members.epoch);
        if swarm != self.swarm {
            return Err(RosterError::OtherSwarm);
        }
        match offered.cmp(&held) {
            Ordering::Less => Err(RosterError::Older { held, offered }),
            Ordering::Greater => Ok(true),
            Ordering::Equal if *members == self.members => Ok(false),
            Ordering::Equal => contradiction.map_or(Ok(true), Err),
        }
    }

    fn unchecked(json: &[u8]) -> Result<(Membership, PublicKey, Signature), RosterError> {
        if json.len() > MAX_ROSTER {
            return Err(RosterError::TooLong { length: json.len(), limit: MAX_ROSTER });
        }
        let document: Document =
            serde_json::from_slice(json).map_err(|error| RosterError::Malformed(error.to_string()))?;
        Ok(document.into_parts())
    }

    /// The roster as JSON, one member a line.
    #[must_use]
    pub fn to_json(&self) -> String {
        let document = Document::new(&self.members, self.authority, self.signature);
        serde_json::to_string_pretty(&document).expect("names and hexadecimal digits are JSON") + "\n"
    }

    /// The members.
    #[must_use]
    pub fn members(&self) -> &Membership {
        &self.members
    }

    /// Who signed it.
    #[must_use]
    pub fn authority(&self) -> PublicKey {
        self.authority
    }

    /// The swarm it is of: its authority and its name.
    #[must_use]
    pub fn swarm_id(&self) -> SwarmId {
        self.swarm
    }

    /// Tells rosters of one epoch apart in a robot's status: the first 32 bits of the SHA-256 of what is signed.
    #[must_use]
    pub fn checksum(&self) -> u32 {
        let [a, b, c, d, ..]: [u8; 32] = Sha256::digest(self.members.signed_bytes(&self.authority)).into();
        u32::from_be_bytes([a, b, c, d])
    }

    /// Whether it is of the same swarm, under the same authority, and of a higher epoch: a swarm never goes back.
    #[must_use]
    pub fn newer_than(&self, held: &Self) -> bool {
        self.swarm == held.swarm && self.members.epoch > held.members.epoch
    }

    /// Whether one of its robots said that in its swarm; the robot and the place of the statement among all it says.
    ///
    /// Takes as long as one signature does, however often it is asked; what comes from a network is asked of a
    /// [`Verifier`](crate::Verifier).
    ///
    /// # Errors
    /// The [`Distrust`] that the statement, the bytes of `Envelope::encode`, meets.
    pub fn check(&self, statement: &[u8], signature: &Signature) -> Result<Heading, Distrust> {
        let (heading, key) = self.author(statement)?;
        if statement::is_signed::<S>(key, &self.swarm, statement, signature) {
            Ok(heading)
        } else {
            Err(Distrust::Forged)
        }
    }

    /// Whether that robot is on this roster with the key that it had before.
    pub(crate) fn keeps_key(&self, before: &Self, robot: RobotId) -> bool {
        let key = self.members.robots.get(&robot);
        key.is_some() && key == before.members.robots.get(&robot)
    }

    /// Whose statement it claims to be, and the key that it must be signed with.
    pub(crate) fn author(&self, statement: &[u8]) -> Result<(Heading, &S::Key), Distrust> {
        let heading = statement::heading(statement).map_err(|_| Distrust::Malformed)?;
        Ok((heading, self.key(heading.author)?))
    }

    /// The key of that robot, as it is ready to check signatures with.
    ///
    /// # Errors
    /// [`Distrust::Expelled`] and [`Distrust::Stranger`].
    pub fn key(&self, robot: RobotId) -> Result<&S::Key, Distrust> {
        match self.keys.get(&robot) {
            Some(key) => Ok(key),
            None if self.members.expelled.contains_key(&robot) => Err(Distrust::Expelled),
            None => Err(Distrust::Stranger),
        }
    }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::MAX_ROBOTS;

    use super::*;
    use crate::membership::{Instructor, MAX_INSTRUCTORS};
    use crate::roles::{Role, Roles};
    use crate::testing::{authority, members, robot, roster, vote};

    fn instructor(number: u32) -> Instructor {
        Instructor { key: robot(number).public_key(), roles: Roles::up_to(Role::Teach) }
    }

    #[track_caller]
    fn refused(members: Membership) -> RosterError {
        members.sign(&authority()).expect_err("members that do not go together")
    }

    #[test]
    fn what_is_written_is_read() {
        let mut members = members(3);
        members.instructors.insert("ada".parse().unwrap(), instructor(90));
        members.local = Roles::up_to(Role::Open);
        members.expelled.insert(RobotId(2), robot(91).public_key());
        let roster = members.sign(&authority()).unwrap();
        let json = roster.to_json();
        assert_eq!(Roster::parse(json.as_bytes()).unwrap(), roster);
        assert!(json.contains(&format!("\"2\": \"{}\"", robot(2).public_key())), "{json}");
        assert!(json.starts_with("{\n  \"swarm\": \"demo\",\n  \"authority\": "), "{json}");
    }

    #[test]
    fn rosters_of_one_epoch_are_told_apart() {
        let mut other = members(3);
        other.expelled.insert(RobotId(2), other.robots.remove(&RobotId(2)).unwrap());
        let other = other.sign(&authority()).unwrap().checksum();
        let read = Roster::<Ed25519>::parse(roster(3).to_json().as_bytes()).unwrap();
        assert_eq!(read.checksum(), roster(3).checksum());
        assert!(other != roster(3).checksum() && roster(4).checksum() != roster(3).checksum());
    }

    #[test]
    fn the_signature_never_changes() {
        // Of the domain, the authority and the members in postcard, by another program.
        assert_eq!(
            roster(1).signature.to_string(),
            "f1c1c6eee48a65321e61ac1f4c1f11a4404d10def3848bdd352ad07e8a6deab79b22a6475bda54fb9f726bf20c913a1005fa914251267996cc8c4c2ba6d5f107"
        );
    }

    #[test]
    fn every_change_after_signing_is_found() {
        let json = roster(3).to_json();
        let (one, other) = (robot(1).public_key().to_string(), robot(9).public_key().to_string());
        for (from, to) in [("\"demo\"", "\"demo2\""), ("\"epoch\": 3", "\"epoch\": 4"), (&one, &other)] {
            assert!(json.contains(from));
            let error = Roster::<Ed25519>::parse(json.replace(from, to).as_bytes()).unwrap_err();
            assert!(matches!(error, RosterError::Forged), "{error}");
        }
        let other = json.replace(&authority().public_key().to_string(), &robot(9).public_key().to_string());
        assert!(matches!(Roster::<Ed25519>::parse(other.as_bytes()), Err(RosterError::Forged)));
    }

    #[test]
    fn a_key_is_one_members() {
        let mut twice = members(1);
        twice.robots.insert(RobotId(9), robot(1).public_key());
        assert!(matches!(refused(twice), RosterError::SharedKey { .. }));
        let mut robot_teaches = members(1);
        robot_teaches.instructors.insert("ada".parse().unwrap(), instructor(1));
        assert!(matches!(refused(robot_teaches), RosterError::SharedKey { .. }));
        let mut back = members(1);
        back.expelled.insert(RobotId(77), robot(1).public_key());
        assert!(matches!(
            refused(back),
            RosterError::ExpelledKey { member: Member::Robot(RobotId(1)), robot: RobotId(77) }
        ));
    }

    #[test]
    fn a_key_that_nobody_should_trust_is_named() {
        for bad in [PublicKey::from_bytes([0; 32]), PublicKey::from_bytes([2; 32])] {
            let mut weak = members(1);
            weak.robots.insert(RobotId(2), bad);
            let error = refused(weak);
            assert!(error.to_string().contains("robot 2"), "{error}");
            let mut weak = members(1);
            weak.instructors.insert("ada".parse().unwrap(), Instructor { key: bad, ..instructor(1) });
            let error = refused(weak);
            assert!(error.to_string().contains("instructor ada"), "{error}");
        }
    }

    #[test]
    fn what_is_no_roster_is_refused() {
        let json = roster(1).to_json();
        let robot_1 = format!("\"1\": \"{}\"", robot(1).public_key());
        for bad in [
            String::new(),
            "{}".to_owned(),
            json.replace("\"epoch\": 1", "\"epoch\": -1"),
            json.replace("\"epoch\": 1", "\"epoch\": 1, \"epoch\": 1"),
            json.replace("\"epoch\"", "\"more\": 1, \"epoch\""),
            // A second key for robot 1, and a second spelling of it.
            json.replace(&robot_1, &format!("{robot_1}, {robot_1}")),
            json.replace("\"1\":", "\"01\":"),
            json.replace("\"1\":", "\"+1\":"),
            json.replace("\"1\":", "\"4294967296\":"),
            json.clone() + "{}",
        ] {
            assert!(
                matches!(Roster::<Ed25519>::parse(bad.as_bytes()), Err(RosterError::Malformed(_))),
                "{bad}"
            );
        }
        assert!(matches!(
            refused(Membership { swarm: "a/b".to_owned(), ..members(1) }),
            RosterError::Name(_)
        ));
    }

    #[test]
    fn a_roster_has_bounds() {
        let key = |number: usize| {
            let mut bytes = [1; 32];
            bytes[..8].copy_from_slice(&number.to_le_bytes());
            PublicKey::from_bytes(bytes)
        };
        let robots = |count: usize| (0..count).map(|n| (RobotId(n as u32), key(n))).collect();
        let many = Membership { robots: robots(MAX_ROBOTS + 1), ..members(1) };
        assert!(matches!(refused(many.clone()), RosterError::TooMany { what: "robots", .. }));
        let json =
            serde_json::to_string(&Document::new(&many, key(0), Signature::from_bytes([0; 64]))).unwrap();
        let why = Roster::<Ed25519>::parse(json.as_bytes()).unwrap_err().to_string();
        let expected =
            format!("length {}, expected at most {MAX_ROBOTS} members and their keys", MAX_ROBOTS + 1);
        assert!(why.contains(&expected), "{why}");
        let many = Membership { expelled: robots(MAX_ROBOTS + 1), ..members(1) };
        assert!(matches!(refused(many), RosterError::TooMany { what: "expelled robots", .. }));
        let instructor = |n| Instructor { key: key(n), ..instructor(1) };
        let instructors =
            (0..=MAX_INSTRUCTORS).map(|n| (format!("i{n}").parse().unwrap(), instructor(n))).collect();
        let many = Membership { instructors, ..members(1) };
        assert!(matches!(refused(many), RosterError::TooMany { what: "instructors", .. }));
        let long = vec![b' '; MAX_ROSTER + 1];
        assert!(matches!(Roster::<Ed25519>::parse(&long), Err(RosterError::TooLong { .. })));
    }

    #[test]
    fn the_largest_swarm_finds_room() {
        use crate::fake::Fake;
        let robots = (0..MAX_ROBOTS as u32)
            .map(|n| (RobotId(u32::MAX - n), Identity::<Fake>::fake(n.into()).public_key()))
            .collect();
        let members = Membership { robots, ..members(u64::MAX) };
        let roster = members.sign(&Identity::<Fake>::fake(u64::MAX)).unwrap();
        assert!(Roster::<Fake>::parse(roster.to_json().as_bytes()).is_ok());
    }

    #[test]
    fn only_a_higher_epoch_of_the_same_swarm_is_newer() {
        let (first, second) = (roster(1), roster(2));
        assert!(second.newer_than(&first));
        assert!(!first.newer_than(&second) && !first.newer_than(&first));
        let usurper = members(9).sign(&robot(7)).unwrap();
        assert!(!usurper.newer_than(&first));
        let renamed = Membership { swarm: "other".to_owned(), ..members(9) };
        assert!(!renamed.sign(&authority()).unwrap().newer_than(&first));
    }

    #[test]
    fn a_roster_from_anywhere_takes_the_place_only_of_what_it_follows() {
        let held = roster(5);
        let offer = |members: Membership, by: &Identity| {
            let json = members.sign(by).unwrap().to_json();
            held.successor(json.as_bytes())
        };
        assert_eq!(offer(members(6), &authority()).unwrap(), Some(roster(6)));
        assert_eq!(offer(members(5), &authority()).unwrap(), None);
        assert!(matches!(offer(members(4), &authority()), Err(RosterError::Older { held: 5, offered: 4 })));
        assert!(matches!(offer(members(6), &robot(1)), Err(RosterError::OtherSwarm)));
        let mut other = members(5);
        other.robots.remove(&RobotId(0));
        assert!(matches!(offer(other, &authority()), Err(RosterError::Contradiction { epoch: 5 })));
        // A contradiction that the authority never signed is none.
        let unsigned = held
            .to_json()
            .replace("\"robots\": {", "\"robots\": { \"9\": \"00\",")
            .replace("\"00\"", &format!("\"{}\"", robot(9).public_key()));
        assert!(matches!(held.successor(unsigned.as_bytes()), Err(RosterError::Forged)));
    }

    #[test]
    fn a_statement_counts_in_its_swarm_alone() {
        let roster = roster(1);
        let other = Membership { swarm: "other".to_owned(), ..members(1) }.sign(&authority()).unwrap();
        let said = vote(2, 1, 1.0);
        let signature = statement::sign(&robot(2), &roster.swarm_id(), &said);
        assert_eq!(roster.check(&said, &signature), Ok(statement::heading(&said).unwrap()));
        assert_eq!(other.check(&said, &signature), Err(Distrust::Forged));
        // The same bytes signed for another purpose.
        let signature = robot(2).sign(&said);
        assert_eq!(roster.check(&said, &signature), Err(Distrust::Forged));
    }
}
