//! Which statements a robot believes.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use gestalt_protocol::{RobotId, Signature, Stamp};
use sha2::{Digest, Sha256};

use crate::budget::{Bucket, Budget, Way, Ways};
use crate::distrust::Distrust;
use crate::evidence::{Conviction, Evidence, EvidenceError, Refutes};
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
/// own: a flood in robot 7's name costs robot 7 alone. What is spared beside these lets robot 7 be heard in the midst of it; and
/// what others pass on has budgets apart from what is said under its author's own key, one of them each robot's own that passes
/// something on: a flood on one way leaves the other open, and who passes on what was never said keeps nobody else from being heard.
///
/// Memory is bounded by the roster: up to a kilobyte for each robot on it, none for anybody else.
#[derive(Clone, Debug)]
pub struct Verifier<S: Scheme = Ed25519> {
    roster: Roster<S>,
    budget: Budget,
    authors: BTreeMap<RobotId, Account>,
    spare: Spare,
    convicted: BTreeSet<RobotId>,
}

/// What is remembered of one author.
#[derive(Clone, Debug)]
struct Account {
    left: Ways,
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
        Self { left: Ways::new(budget, now), verified: VecDeque::new() }
    }
}

/// What is left for authors whose own budgets are used up.
#[derive(Clone, Debug, Default)]
struct Spare {
    /// For all together; `None` before anything was checked.
    of_all: Option<Ways>,
    /// For what each robot passes on.
    of_each: BTreeMap<RobotId, Bucket>,
}

impl Spare {
    /// Takes one check out by that way, if there is one.
    fn take<S: Scheme>(&mut self, way: Way, budget: &Budget, roster: &Roster<S>, now: Duration) -> bool {
        let Way::PassedOn(by) = way else {
            let of_all = budget.of_all();
            return self.of_all.get_or_insert_with(|| Ways::new(&of_all, now)).take(way, &of_all, now);
        };
        let of_one = budget.of_one_that_passes_on();
        let new = || Bucket::new(&of_one, now);
        let is_member = roster.members().robots.contains_key(&by);
        is_member && self.of_each.entry(by).or_insert_with(new).take(&of_one, now)
    }
}

impl<S: Scheme> Verifier<S> {
    /// One that believes the robots of that roster, which must be of the swarm that this robot was enrolled in.
    #[must_use]
    pub fn new(roster: Roster<S>, budget: Budget) -> Self {
        Self { roster, budget, authors: BTreeMap::new(), spare: Spare::default(), convicted: BTreeSet::new() }
    }

    /// The roster it goes by.
    #[must_use]
    pub fn roster(&self) -> &Roster<S> {
        &self.roster
    }

    /// Whether to believe a statement, the bytes of `Envelope::encode`, that arrived with that signature. Repeated bytes are
    /// believed again, at no cost: votes repeat by design.
    ///
    /// A statement that is believed is its author's word, nothing more: it may be old, and it may be a lie. What it says, and whether
    /// it can be passed on, [`statement::read`] finds.
    ///
    /// # Errors
    /// The [`Distrust`] that it meets.
    pub fn check(
        &mut self,
        now: Duration,
        statement: &[u8],
        signature: Option<&Signature>,
    ) -> Result<(), Distrust> {
        self.check_by(Way::Said, now, statement, signature)
    }

    /// The same of a statement that this robot passes on, or rests a decision on: however many are made up under the author's own key, or passed on by
    /// others, and refused as too many, that way has budgets of its own. Who passes it on has to be known: it is a robot on the roster that was shown to say so.
    ///
    /// # Errors
    /// The [`Distrust`] that it meets.
    pub fn check_passed_on(
        &mut self,
        by: RobotId,
        now: Duration,
        statement: &[u8],
        signature: Option<&Signature>,
    ) -> Result<(), Distrust> {
        self.check_by(Way::PassedOn(by), now, statement, signature)
    }

    fn check_by(
        &mut self,
        way: Way,
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
        if !account.left.take(way, &self.budget, now)
            && !self.spare.take(way, &self.budget, &self.roster, now)
        {
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
        if !self.roster.is_succeeded_by(&roster)? {
            return Ok(false);
        }
        let keeps_key = |robot: &RobotId| roster.keeps_key(&self.roster, *robot);
        self.authors.retain(|robot, _| keeps_key(robot));
        self.spare.of_each.retain(|robot, _| keeps_key(robot));
        self.convicted.retain(keeps_key);
        self.roster = roster;
        Ok(true)
    }

    /// Stops believing a robot that the evidence convicts, until a roster gives it a new key. Evidence has a budget of its own, as
    /// large as the one for statements, and as much is spared beside: nobody hides it in a flood of statements. Who starts again hands in again what evidence it kept.
    ///
    /// # Errors
    /// [`EvidenceError`] for evidence that proves nothing against any robot on the roster.
    pub fn convict(
        &mut self,
        now: Duration,
        evidence: &Evidence,
        refutes: Refutes,
    ) -> Result<Conviction, EvidenceError> {
        let claimed = evidence.heading()?;
        let on_roster = self.roster.members().robots.get(&claimed.author);
        let key: PublicKey = *on_roster.ok_or(EvidenceError::Stranger(claimed.author))?;
        if self.convicted.contains(&claimed.author) {
            return Ok(Conviction { robot: claimed.author, key, stamp: claimed.stamp, lie: evidence.lie() });
        }
        let new = || Account::new(&self.budget, now);
        let account = self.authors.entry(claimed.author).or_insert_with(new);
        if !account.left.take(Way::Evidence, &self.budget, now)
            && !self.spare.take(Way::Evidence, &self.budget, &self.roster, now)
        {
            return Err(EvidenceError::TooFast(claimed.author));
        }
        let conviction = evidence.check(&self.roster, refutes)?;
        self.believe_no_more(conviction.robot);
        Ok(conviction)
    }

    /// The same of a robot that was found here to lie, whatever was made up against it before.
    pub(crate) fn believe_no_more(&mut self, robot: RobotId) {
        self.convicted.insert(robot);
    }

    /// Whether that robot was convicted.
    #[must_use]
    pub fn is_convicted(&self, robot: RobotId) -> bool {
        self.convicted.contains(&robot)
    }

    /// The robots on the roster that were convicted.
    pub fn convicted(&self) -> impl Iterator<Item = RobotId> + '_ {
        self.convicted.iter().copied()
    }
}

#[cfg(test)]
mod tests;
