//! A sealed swarm: its robots sign their votes, and believe those of each other alone.

use std::collections::BTreeMap;
use std::num::NonZeroU32;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use gestalt_protocol::{Batches, Decision, Envelope, Give, HeldVote, Message, RobotId, Signature};
use gestalt_strategies::Sign;
use gestalt_trust::{
    Budget, Conviction, Distrust, Evidence, EvidenceError, Identity, Roster, SwarmId, Verifier, Witness,
    statement,
};
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

/// How many batches of samples of one author are checked: a late joiner is given all that a swarm knows.
const OF_SAMPLES: Budget = {
    const fn number(of: u32) -> NonZeroU32 {
        NonZeroU32::new(of).expect("not zero")
    }
    Budget { burst: number(512), per_second: number(64), spare: number(1000) }
};

/// Lets in what members of the swarm signed, and finds out who of them says two things.
#[derive(Debug)]
pub(crate) struct Gate {
    judge: Mutex<Judge>,
    started: Instant,
}

#[derive(Debug)]
struct Judge {
    /// For votes and lessons, and for samples: neither keeps the other waiting.
    verifier: Verifier,
    of_samples: Verifier,
    witness: Witness,
    /// Against whom, as it is told to others; those found here are yet to be.
    evidence: BTreeMap<RobotId, Evidence>,
    untold: Vec<RobotId>,
}

impl Judge {
    fn check(&mut self, now: Duration, envelope: &Envelope) -> Result<(), Distrust> {
        let statement = envelope.statement();
        let signature = envelope.signature.as_ref().ok_or(Distrust::Unsigned)?;
        let samples = matches!(envelope.message, Message::Samples(_));
        let verifier = if samples { &mut self.of_samples } else { &mut self.verifier };
        verifier.check(now, &statement, Some(signature))?;
        let Some(evidence) = self.witness.observe(&statement, signature) else { return Ok(()) };
        // What proves nothing is no reason to refuse it.
        let Ok(conviction) = self.convict(now, evidence) else { return Ok(()) };
        self.untold.push(conviction.robot);
        Err(Distrust::Convicted)
    }

    fn convict(&mut self, now: Duration, evidence: Evidence) -> Result<Conviction, EvidenceError> {
        let conviction = self.verifier.convict(now, &evidence)?;
        self.of_samples.convict(now, &evidence)?;
        self.evidence.entry(conviction.robot).or_insert(evidence);
        Ok(conviction)
    }
}

impl Gate {
    pub fn new(seal: &Seal, started: Instant) -> Self {
        let judge = Judge {
            verifier: Verifier::new(seal.roster.clone(), Budget::default()),
            of_samples: Verifier::new(seal.roster.clone(), OF_SAMPLES),
            witness: Witness::new(&seal.roster),
            evidence: BTreeMap::new(),
            untold: Vec::new(),
        };
        Self { judge: Mutex::new(judge), started }
    }

    fn judge(&self) -> MutexGuard<'_, Judge> {
        self.judge.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether the author said that.
    pub fn envelope(&self, envelope: &Envelope) -> Result<(), Distrust> {
        self.judge().check(self.started.elapsed(), envelope)
    }

    /// Takes in evidence; says against whom, if that is news.
    pub fn evidence(&self, evidence: Evidence) -> Result<Option<RobotId>, EvidenceError> {
        let mut judge = self.judge();
        let known = judge.evidence.len();
        let conviction = judge.convict(self.started.elapsed(), evidence)?;
        Ok((judge.evidence.len() > known).then_some(conviction.robot))
    }

    /// The evidence that was found here and is to be told to all, each once.
    pub fn untold(&self) -> Vec<(RobotId, Evidence)> {
        let judge = &mut *self.judge();
        let untold = std::mem::take(&mut judge.untold).into_iter();
        untold.filter_map(|robot| Some((robot, judge.evidence.get(&robot)?.clone()))).collect()
    }

    /// Somebody is here who was not: all evidence is told again.
    pub fn tell_again(&self) {
        let judge = &mut *self.judge();
        judge.untold = judge.evidence.keys().copied().collect();
    }

    /// Whether all the votes that a decision rests on were cast.
    pub fn decision(&self, decision: &Decision) -> Result<(), Distrust> {
        let certificate = &decision.certificate;
        let votes = certificate.votes.iter().map(gestalt_protocol::CountedVote::held);
        votes.chain(certificate.others.iter().cloned()).try_for_each(|held| self.held(held))
    }

    /// What of a gift was really said, and why the rest is not believed. The rest of it may be true: who passes on what it was
    /// told is no liar.
    pub fn give(&self, give: &mut Give) -> Option<Distrust> {
        let mut refused = self.retain(&mut give.votes);
        if let Some(Err(distrust)) = give.decision.as_ref().map(|decision| self.decision(decision)) {
            give.decision = None;
            refused = Some(distrust);
        }
        refused
    }

    /// Which samples their authors shared, and why the others are not believed.
    pub fn batches(&self, batches: &mut Batches) -> Option<Distrust> {
        self.retain(&mut batches.batches)
    }

    fn retain<T: Clone + Into<Envelope>>(&self, held: &mut Vec<T>) -> Option<Distrust> {
        let mut refused = None;
        held.retain(|held| match self.envelope(&held.clone().into()) {
            Ok(()) => true,
            Err(distrust) => {
                refused = Some(distrust);
                false
            }
        });
        refused
    }

    fn held(&self, held: HeldVote) -> Result<(), Distrust> {
        self.envelope(&held.into())
    }
}
