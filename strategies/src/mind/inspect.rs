//! What a host may want to know of a mind, and to show.

use gestalt_protocol::{Decision, Digest, RobotId, RoundId, Stamp};

use super::learning::Learning;
use super::{Mind, MindConfig, Refusals};
use crate::{Ballot, TrainingSet, Vocabulary};

impl Mind {
    /// Whose mind it is.
    #[must_use]
    pub fn me(&self) -> RobotId {
        self.me
    }

    /// Its parameters.
    #[must_use]
    pub fn config(&self) -> &MindConfig {
        &self.config
    }

    /// The newest round known.
    #[must_use]
    pub fn round(&self) -> Option<RoundId> {
        self.round.as_ref().map(|round| round.id)
    }

    /// Whether this robot takes part in that round by looking and voting.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.round.as_ref().is_some_and(|round| round.open)
    }

    /// The decision held for that round.
    #[must_use]
    pub fn held(&self) -> Option<&Decision> {
        self.round.as_ref()?.agreement.held()
    }

    /// The votes known in that round.
    #[must_use]
    pub fn ballot(&self) -> Option<&Ballot> {
        self.round.as_ref().map(|round| &round.ballot)
    }

    /// The vocabulary of its classifier.
    #[must_use]
    pub fn vocabulary(&self) -> Option<&Vocabulary> {
        self.classifier.as_ref().map(|classifier| classifier.vocabulary())
    }

    /// What it has learned from; `None` for one that does not learn.
    #[must_use]
    pub fn learned(&self) -> Option<gestalt_protocol::Learning> {
        self.learning.as_ref().map(Learning::status)
    }

    /// What tells that something was learned since: it changes with every sample taken in or out, and every lesson.
    #[must_use]
    pub fn learned_so_far(&self) -> Option<(u64, usize, Digest)> {
        let learning = self.learning.as_ref()?;
        Some((learning.set().next_key(), learning.set().len(), learning.digest()))
    }

    /// The samples it holds.
    #[must_use]
    pub fn training_set(&self) -> Option<&TrainingSet> {
        self.learning.as_ref().map(Learning::set)
    }

    /// What it refused so far, by cause.
    #[must_use]
    pub fn refusals(&self) -> &Refusals {
        &self.refusals
    }

    /// The stamp on the latest message that another robot said under this robot's id: give one of the two
    /// another id.
    #[must_use]
    pub fn duplicate(&self) -> Option<Stamp> {
        self.duplicate
    }
}
