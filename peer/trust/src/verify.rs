//! Which statements a robot believes.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use gestalt_protocol::{RobotId, Signature, Stamp};
use sha2::{Digest, Sha256};

use crate::budget::{Bucket, Budget};
use crate::distrust::Distrust;
use crate::evidence::{Conviction, Evidence, EvidenceError};
use crate::public_key::PublicKey;
use crate::roster::Roster;
use crate::roster_error::RosterError;
use crate::scheme::{Ed25519, Scheme};
use crate::statement;

/// How many statements of one author are known again without a check.
const REMEMBERED: usize = 16;

/// Decides which statements a robot believes, by the newest roster it knows.
///
/// Pure: time is an argument, counted from any point that stays the same. Checking a signature is the last and only costly step;
/// before it, strangers, the expelled and what was verified before are told apart, and every author named has a [`Budget`] of its
/// own: a flood in robot 7's name costs robot 7 alone.
///
/// Memory is bounded by the roster: up to a kilobyte for each robot on it, none for anybody else.
#[derive(Clone, Debug)]
pub struct Verifier<S: Scheme = Ed25519> {
    roster: Roster<S>,
    budget: Budget,
    authors: BTreeMap<RobotId, Account>,
    convicted: BTreeSet<RobotId>,
}

/// What is remembered of one author.
#[derive(Clone, Debug)]
struct Account {
    statements: Bucket,
    evidence: Bucket,
    verified: VecDeque<Seen>,
}

/// A statement with its signature that was verified. The signature is a part of it: the same statement under another one may be
/// true, but who passed it on would be refused.
#[derive(Clone, Debug, PartialEq)]
struct Seen {
    stamp: Stamp,
    digest: [u8; 32],
}

impl Account {
    fn new(budget: &Budget, now: Duration) -> Self {
        Self {
            statements: Bucket::new(budget, now),
            evidence: Bucket::new(budget, now),
            verified: VecDeque::new(),
        }
    }
}

impl<S: Scheme> Verifier<S> {
    /// One that believes the robots of that roster, which must be of the swarm that this robot was enrolled in.
    #[must_use]
    pub fn new(roster: Roster<S>, budget: Budget) -> Self {
        Self { roster, budget, authors: BTreeMap::new(), convicted: BTreeSet::new() }
    }

    /// The roster it goes by.
    #[must_use]
    pub fn roster(&self) -> &Roster<S> {
        &self.roster
    }

    /// Whether to believe a statement, the bytes of `Envelope::encode`, that arrived with that signature. Repeated bytes are
    /// believed again, at no cost: votes repeat by design.
    ///
    /// A statement that is believed is its author's word, nothing more: it may be old, and it may be a lie.
    ///
    /// # Errors
    /// The [`Distrust`] that it meets.
    pub fn check(
        &mut self,
        now: Duration,
        statement: &[u8],
        signature: Option<&Signature>,
    ) -> Result<(), Distrust> {
        let signature = signature.ok_or(Distrust::Unsigned)?;
        let (heading, key) = self.roster.author(statement)?;
        if self.convicted.contains(&heading.author) {
            return Err(Distrust::Convicted);
        }
        let new = || Account::new(&self.budget, now);
        let account = self.authors.entry(heading.author).or_insert_with(new);
        // Hashed only if a statement of that stamp was verified: junk is not worth it.
        let digest =
            || Sha256::new().chain_update(signature.as_bytes()).chain_update(statement).finalize().into();
        if account.verified.iter().any(|seen| seen.stamp == heading.stamp) {
            let seen = Seen { stamp: heading.stamp, digest: digest() };
            if account.verified.contains(&seen) {
                return Ok(());
            }
        }
        if !account.statements.take(&self.budget, now) {
            return Err(Distrust::TooFast);
        }
        if !statement::is_signed::<S>(key, &self.roster.swarm_id(), statement, signature) {
            return Err(Distrust::Forged);
        }
        if account.verified.len() == REMEMBERED {
            account.verified.pop_front();
        }
        account.verified.push_back(Seen { stamp: heading.stamp, digest: digest() });
        Ok(())
    }

    /// Goes by that roster from now on, if it is newer than the one held; whether it is. Robots whose key is the same keep their
    /// budget and their convictions, those with a new key begin anew.
    ///
    /// # Errors
    /// [`RosterError::OtherSwarm`], [`RosterError::Older`] and [`RosterError::Contradiction`]; the roster held stays.
    pub fn adopt(&mut self, roster: Roster<S>) -> Result<bool, RosterError> {
        let (held, offered) = (self.roster.members().epoch, roster.members().epoch);
        if roster.swarm_id() != self.roster.swarm_id() {
            return Err(RosterError::OtherSwarm);
        }
        if offered < held {
            return Err(RosterError::Older { held, offered });
        }
        if !roster.newer_than(&self.roster) {
            let same = roster.members() == self.roster.members();
            return if same { Ok(false) } else { Err(RosterError::Contradiction { epoch: held }) };
        }
        let (before, after) = (&self.roster.members().robots, &roster.members().robots);
        let stays = |robot: &RobotId| after.contains_key(robot) && after.get(robot) == before.get(robot);
        self.authors.retain(|robot, _| stays(robot));
        self.convicted.retain(stays);
        self.roster = roster;
        Ok(true)
    }

    /// Stops believing a robot that the evidence convicts, until a roster gives it a new key. Evidence has a budget of its own, as
    /// large as the one for statements.
    ///
    /// # Errors
    /// [`EvidenceError`] for evidence that proves nothing against any robot on the roster.
    pub fn convict(&mut self, now: Duration, evidence: &Evidence) -> Result<Conviction, EvidenceError> {
        let claimed = evidence.heading()?;
        let on_roster = self.roster.members().robots.get(&claimed.author);
        let key: PublicKey = *on_roster.ok_or(EvidenceError::Stranger(claimed.author))?;
        if self.convicted.contains(&claimed.author) {
            return Ok(Conviction { robot: claimed.author, key, stamp: claimed.stamp });
        }
        let new = || Account::new(&self.budget, now);
        let account = self.authors.entry(claimed.author).or_insert_with(new);
        if !account.evidence.take(&self.budget, now) {
            return Err(EvidenceError::TooFast(claimed.author));
        }
        let conviction = evidence.check(&self.roster)?;
        self.convicted.insert(conviction.robot);
        Ok(conviction)
    }

    /// The robots on the roster that were convicted.
    pub fn convicted(&self) -> impl Iterator<Item = RobotId> + '_ {
        self.convicted.iter().copied()
    }
}
