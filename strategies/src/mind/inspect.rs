//! What a host may want to know of a mind, and to show.

use gestalt_protocol::{Decision, Digest, Heeded, RobotId, RoundId, Stamp};
use gestalt_rounds::{Ballot, Refusals, RoundsConfig, Vocabulary};

use super::machine::Mind;
use crate::learning::{Learning, TrainingChange};
use crate::training_set::TrainingSet;

impl Mind {
    /// Whose mind it is.
    #[must_use]
    pub fn me(&self) -> RobotId {
        self.rounds.me()
    }

    /// Its parameters.
    #[must_use]
    pub fn config(&self) -> &RoundsConfig {
        self.rounds.config()
    }

    /// The newest round known.
    #[must_use]
    pub fn round(&self) -> Option<RoundId> {
        self.rounds.round()
    }

    /// Whether this robot takes part in that round by looking and voting.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.rounds.is_open()
    }

    /// Whether its own evidence is asked for in that round, see [`Rounds::votes`](gestalt_rounds::Rounds::votes).
    #[must_use]
    pub fn votes(&self) -> bool {
        self.rounds.votes()
    }

    /// The decision held for that round.
    #[must_use]
    pub fn held(&self) -> Option<&Decision> {
        self.rounds.held()
    }

    /// Whether what another robot announced last stands, see [`Rounds::announcement_stands`](gestalt_rounds::Rounds::announcement_stands).
    #[must_use]
    pub fn announcement_stands(&self) -> bool {
        self.rounds.announcement_stands()
    }

    /// What the gesture of a decision is called, see [`Rounds::label_of`](gestalt_rounds::Rounds::label_of).
    #[must_use]
    pub fn label_of(&self, decision: &Decision) -> Option<&str> {
        self.rounds.label_of(decision)
    }

    /// The votes known in that round.
    #[must_use]
    pub fn ballot(&self) -> Option<&Ballot> {
        self.rounds.ballot()
    }

    /// The vocabulary of its classifier.
    #[must_use]
    pub fn vocabulary(&self) -> Option<&Vocabulary> {
        self.rounds.classifier().map(|classifier| classifier.vocabulary())
    }

    /// What it has learned from; `None` for one that does not learn.
    #[must_use]
    pub fn learned(&self) -> Option<gestalt_protocol::LearningStatus> {
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

    /// What makes a new learner learn what this robot trains on.
    #[must_use]
    pub fn training(&self) -> Vec<TrainingChange> {
        self.learning.as_ref().map_or(Vec::new(), Learning::training_anew)
    }

    /// Of each other robot: how many of its samples it holds, and how many of these it trains on.
    #[must_use]
    pub fn heeded(&self) -> Vec<Heeded> {
        self.learning.as_ref().map_or(Vec::new(), Learning::heeded)
    }

    /// What it refused so far, by cause.
    #[must_use]
    pub fn refusals(&self) -> &Refusals {
        self.rounds.refusals()
    }

    /// The stamp on the latest message that another robot said under this robot's id: give one of the two
    /// another id.
    #[must_use]
    pub fn duplicate(&self) -> Option<Stamp> {
        self.rounds.duplicate()
    }

    /// The robots this one is directly linked to.
    pub fn neighbours(&self) -> impl ExactSizeIterator<Item = RobotId> {
        self.rounds.neighbours()
    }
}
