//! Who belongs to the swarm, by the word of its authority.

use std::collections::BTreeMap;

use gestalt_protocol::{RobotId, Signature};

use crate::distrust::Distrust;
use crate::document::Document;
use crate::identity::Identity;
use crate::membership::Membership;
use crate::public_key::PublicKey;
use crate::roster_error::{Member, RosterError};
use crate::scheme::{Ed25519, Scheme};
use crate::statement::{self, Heading, SwarmId};

impl Membership {
    /// The roster of these members, by that authority.
    ///
    /// # Errors
    /// [`RosterError`] for members that no robot would accept, whoever signed for them.
    pub fn sign<S: Scheme>(self, authority: &Identity<S>) -> Result<Roster<S>, RosterError> {
        let signature = authority.sign(&self.signed_bytes(&authority.public_key()));
        let roster = Roster::checked(self, authority.public_key(), signature)?;
        let length = roster.to_json().len();
        if length > Roster::<S>::MAX_LENGTH {
            return Err(RosterError::TooLong { length, limit: Roster::<S>::MAX_LENGTH });
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
    /// The longest roster accepted, in bytes of JSON: 512 KiB, in which [`MAX_ROBOTS`](gestalt_protocol::MAX_ROBOTS) robots find room.
    pub const MAX_LENGTH: usize = 512 * 1024;

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
        if let Some((name, _)) = members.instructors.iter().find(|(_, key)| S::key(key).is_none()) {
            return Err(bad(Member::Instructor(name.clone())));
        }
        let swarm = SwarmId::new(&authority, &members.swarm);
        Ok(Self { members, authority, signature, swarm, keys })
    }

    /// Reads the JSON of a roster, of at most [`Roster::MAX_LENGTH`] bytes, and checks all of it.
    ///
    /// # Errors
    /// [`RosterError`] for what is no roster, was not signed by the authority it names, or has members that exclude each other.
    pub fn parse(json: &[u8]) -> Result<Self, RosterError> {
        if json.len() > Self::MAX_LENGTH {
            return Err(RosterError::TooLong { length: json.len(), limit: Self::MAX_LENGTH });
        }
        let document: Document =
            serde_json::from_slice(json).map_err(|error| RosterError::Malformed(error.to_string()))?;
        let (members, authority, signature) = document.into_parts();
        Self::checked(members, authority, signature)
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

    /// Whose statement it claims to be, and the key that it must be signed with.
    pub(crate) fn author(&self, statement: &[u8]) -> Result<(Heading, &S::Key), Distrust> {
        let heading = statement::heading(statement).map_err(|_| Distrust::Malformed)?;
        match self.keys.get(&heading.author) {
            Some(key) => Ok((heading, key)),
            None if self.members.expelled.contains_key(&heading.author) => Err(Distrust::Expelled),
            None => Err(Distrust::Stranger),
        }
    }
}
