//! What a host may want to know of the rounds, and to show.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{Decision, RobotId, RoundId, Stamp};

use super::rounds::Rounds;
use crate::ballot::Ballot;
use crate::classify::Classify;
use crate::config::RoundsConfig;
use crate::refusal::{Refusal, Refusals};

impl Rounds {
    /// Whose rounds they are.
    #[must_use]
    pub fn me(&self) -> RobotId {
        self.me
    }

    /// Which life of that robot this is.
    #[must_use]
    pub fn boot(&self) -> u32 {
        self.stamp.boot
    }

    /// Their parameters.
    #[must_use]
    pub fn config(&self) -> &RoundsConfig {
        &self.config
    }

    /// The time of the latest input.
    #[must_use]
    pub fn now(&self) -> Duration {
        self.now
    }

    /// Whether this robot signs what it stands by.
    #[must_use]
    pub fn signs(&self) -> bool {
        self.signer.is_some()
    }

    /// Those of the living that said nothing through a whole round: they count for nobody until they do.
    #[must_use]
    pub fn silent(&self) -> &BTreeSet<RobotId> {
        self.electorate.silent()
    }

    /// The newest round known.
    #[must_use]
    pub fn round(&self) -> Option<RoundId> {
        self.round.as_ref().map(|round| round.id)
    }

    /// Whether that is a name of it: it may have come to be called by a smaller one since somebody spoke of it.
    #[must_use]
    pub fn is_newest(&self, round: RoundId) -> bool {
        self.round.as_ref().is_some_and(|newest| newest.is_named(round))
    }

    /// Whether this robot takes part in that round by looking and voting.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.round.as_ref().is_some_and(|round| round.open)
    }

    /// The round this robot looks at, which may be decided: from [`Output::Opened`](super::Output::Opened) to
    /// [`Output::Closed`](super::Output::Closed).
    #[must_use]
    pub fn looking(&self) -> Option<RoundId> {
        self.looking
    }

    /// The decision held for the newest round.
    #[must_use]
    pub fn held(&self) -> Option<&Decision> {
        self.round.as_ref()?.agreement.held()
    }

    /// The votes known in that round.
    #[must_use]
    pub fn ballot(&self) -> Option<&Ballot> {
        self.round.as_ref().map(|round| &round.ballot)
    }

    /// What judges this robot's frames.
    #[must_use]
    pub fn classifier(&self) -> Option<&Arc<dyn Classify>> {
        self.classifier.as_ref()
    }

    /// The other robots alive, guests among them, ascending.
    pub fn alive(&self) -> impl Iterator<Item = RobotId> + '_ {
        self.alive.iter()
    }

    /// The robots this one is directly linked to.
    pub fn neighbours(&self) -> impl ExactSizeIterator<Item = RobotId> {
        self.partners.neighbours()
    }

    /// What was refused so far, by cause.
    #[must_use]
    pub fn refusals(&self) -> &Refusals {
        &self.refusals
    }

    /// Counts what whoever follows the rounds refused.
    pub fn note_refusal(&mut self, refusal: Refusal) {
        self.refusals.add(refusal);
    }

    /// The stamp on the latest message that another robot said under this robot's id: give one of the two
    /// another id.
    #[must_use]
    pub fn duplicate(&self) -> Option<Stamp> {
        self.duplicate
    }
}
