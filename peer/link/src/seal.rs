//! A sealed swarm: its robots sign their votes, and believe those of each other alone.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use gestalt_protocol::{Decision, Envelope, Give, HeldVote, RobotId, Signature};
use gestalt_strategies::Sign;
use gestalt_trust::{Budget, Distrust, Identity, Roster, SwarmId, Verifier, statement};
use thiserror::Error;

/// What makes a robot one of a sealed swarm. Votes are signed, so decisions are as well, which are made of them; samples and the words
/// of instructors are not.
#[derive(Clone, Debug)]
pub struct Seal {
    /// The robot's own key.
    pub identity: Arc<Identity>,
    /// The members of the swarm.
    pub roster: Roster,
    /// The keys of robots that are looked for here, and vote through this one.
    pub guests: BTreeMap<RobotId, Arc<Identity>>,
}

/// A seal that does not fit the robot.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum SealError {
    /// The roster of another swarm.
    #[error(
        "the roster is of the swarm \"{roster}\", and the robot of \"{robot}\": give it the roster of its own swarm"
    )]
    OtherSwarm {
        /// The swarm that the roster names.
        roster: String,
        /// The robot's own.
        robot: String,
    },
    /// A robot that the roster does not name, or names with another key.
    #[error(
        "robot {0} is not on the roster with the key that it has here: enrol it with this key, or bring the newest roster"
    )]
    NotEnrolled(RobotId),
}

impl Seal {
    pub(crate) fn check(&self, me: RobotId, swarm: &str) -> Result<(), SealError> {
        let members = self.roster.members();
        if members.swarm != swarm {
            return Err(SealError::OtherSwarm { roster: members.swarm.clone(), robot: swarm.to_owned() });
        }
        let guests = self.guests.iter().map(|(robot, identity)| (*robot, identity));
        for (robot, identity) in guests.chain([(me, &self.identity)]) {
            if members.robots.get(&robot) != Some(&identity.public_key()) {
                return Err(SealError::NotEnrolled(robot));
            }
        }
        Ok(())
    }

    /// Who signs for this robot.
    pub(crate) fn signer(&self) -> Arc<dyn Sign> {
        self.signer_with(&self.identity)
    }

    /// Who signs for a robot that votes through this one, if its key is here.
    pub(crate) fn signer_of(&self, guest: RobotId) -> Option<Arc<dyn Sign>> {
        Some(self.signer_with(self.guests.get(&guest)?))
    }

    fn signer_with(&self, identity: &Arc<Identity>) -> Arc<dyn Sign> {
        Arc::new(Signer { identity: identity.clone(), swarm: self.roster.swarm_id() })
    }
}

#[derive(Debug)]
struct Signer {
    identity: Arc<Identity>,
    swarm: SwarmId,
}

impl Sign for Signer {
    fn sign(&self, statement: &[u8]) -> Signature {
        statement::sign(&self.identity, &self.swarm, statement)
    }
}

/// Lets in what members of the swarm signed.
#[derive(Debug)]
pub(crate) struct Gate {
    verifier: Mutex<Verifier>,
    started: Instant,
}

impl Gate {
    pub fn new(seal: &Seal, started: Instant) -> Self {
        Self { verifier: Mutex::new(Verifier::new(seal.roster.clone(), Budget::default())), started }
    }

    /// Whether the author said that.
    pub fn envelope(&self, envelope: &Envelope) -> Result<(), Distrust> {
        let mut verifier = self.verifier.lock().unwrap_or_else(PoisonError::into_inner);
        verifier.check(self.started.elapsed(), &envelope.statement(), envelope.signature.as_ref())
    }

    /// Whether all the votes that a decision rests on were cast.
    pub fn decision(&self, decision: &Decision) -> Result<(), Distrust> {
        let certificate = &decision.certificate;
        let votes = certificate.votes.iter().map(gestalt_protocol::CountedVote::held);
        votes.chain(certificate.others.iter().cloned()).try_for_each(|held| self.held(held))
    }

    /// What of a gift was really said, and why the rest is not believed.
    pub fn give(&self, give: &mut Give) -> Option<Distrust> {
        let mut refused = None;
        give.votes.retain(|held| match self.held(held.clone()) {
            Ok(()) => true,
            Err(distrust) => {
                refused = Some(distrust);
                false
            }
        });
        if let Some(Err(distrust)) = give.decision.as_ref().map(|decision| self.decision(decision)) {
            give.decision = None;
            refused = Some(distrust);
        }
        refused
    }

    fn held(&self, held: HeldVote) -> Result<(), Distrust> {
        self.envelope(&held.into())
    }
}
