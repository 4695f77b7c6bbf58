//! A sealed swarm: its robots show each other certificates, sign what they say, and believe those of each other alone.

use std::path::PathBuf;
use std::sync::Arc;

use gestalt_protocol::{RobotId, Signature};
use gestalt_strategies::Sign;
use gestalt_trust::{Identity, Roster, SwarmId, statement};
use thiserror::Error;

use crate::tls::{Bearer, Certificate, CertificateError, Credentials};

/// What makes a robot one of a sealed swarm. Its links are TLS, to members alone. Its robots sign their votes, and so the decisions that are
/// made of them; their samples, under which their signature stays whoever passes them on; and what they pass on of instructors.
#[derive(Clone, Debug)]
pub struct Seal {
    /// The robot's own key.
    pub identity: Arc<Identity>,
    /// What the robot shows to be let in.
    pub certificate: Certificate,
    /// The members of the swarm, as it knows them at its start.
    pub roster: Roster,
    /// The file that a newer roster is kept in; `None`: it is asked for anew at every start.
    pub roster_file: Option<PathBuf>,
}

/// A seal that does not fit the robot.
#[derive(Debug, Error)]
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
    /// A certificate that is not the robot's.
    #[error(transparent)]
    Certificate(#[from] CertificateError),
}

impl Seal {
    /// That of a robot on the roster, certified here and now by the authority: for swarms whose keys are all in one hand.
    ///
    /// # Errors
    /// [`CertificateError::Make`].
    pub fn issue(
        authority: &Identity,
        roster: Roster,
        robot: RobotId,
        identity: Arc<Identity>,
    ) -> Result<Self, CertificateError> {
        let (swarm, key) = (&roster.members().swarm, identity.public_key());
        let certificate = Certificate::issue(authority, swarm, Bearer::Robot(robot), &key)?;
        Ok(Self { identity, certificate, roster, roster_file: None })
    }

    /// What the robot shows to be let in.
    ///
    /// # Errors
    /// [`CertificateError`] for a certificate that is not the robot's.
    pub fn credentials(&self, robot: RobotId) -> Result<Credentials, CertificateError> {
        Credentials::new(&self.roster, Bearer::Robot(robot), self.identity.clone(), self.certificate.clone())
    }

    pub(crate) fn check(&self, me: RobotId, swarm: &str) -> Result<(), SealError> {
        let members = self.roster.members();
        if members.swarm != swarm {
            return Err(SealError::OtherSwarm { roster: members.swarm.clone(), robot: swarm.to_owned() });
        }
        match members.robots.get(&me) == Some(&self.identity.public_key()) {
            true => Ok(()),
            false => Err(SealError::NotEnrolled(me)),
        }
    }

    /// Who signs for this robot.
    pub(crate) fn signer(&self) -> Arc<dyn Sign> {
        Arc::new(Signer { identity: self.identity.clone(), swarm: self.roster.swarm_id() })
    }

    /// That of a robot with this key that votes through this one.
    pub(crate) fn of_guest(&self, identity: Arc<Identity>) -> Self {
        Self { identity, ..self.clone() }
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
