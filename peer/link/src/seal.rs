//! A sealed swarm: its robots sign their votes, and believe those of each other alone.

use std::collections::BTreeMap;
use std::sync::Arc;

use gestalt_protocol::{RobotId, Signature};
use gestalt_strategies::Sign;
use gestalt_trust::{Identity, Roster, SwarmId, statement};
use thiserror::Error;

/// What makes a robot one of a sealed swarm. Its robots sign their votes, and so the decisions that are made of them; their samples, under
/// which their signature stays whoever passes them on; and what they pass on of instructors, who have no keys.
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
