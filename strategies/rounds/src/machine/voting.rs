//! What a robot says itself: its vote, the decision it holds, and, when it is its turn, that of the swarm.

use std::collections::BTreeSet;
use std::time::Duration;

use gestalt_protocol::RobotId;

use super::output::Output;
use super::rounds::{Effects, Rounds};
use crate::ballot::Scale;

impl Rounds {
    pub(super) fn on_alive(&mut self, robots: BTreeSet<RobotId>) {
        self.alive = &robots | &self.guests;
        self.alive.remove(&self.me);
        // This robot speaks for its guests too: its turn is that of the smallest of them all.
        let first = self.guests.first().map_or(self.me, |guest| self.me.min(*guest));
        self.turns = u32::try_from(self.alive.range(..first).count()).unwrap_or(u32::MAX);
    }

    pub(super) fn on_guests(&mut self, robots: BTreeSet<RobotId>) {
        let others: BTreeSet<RobotId> = self.alive.difference(&self.guests).copied().collect();
        self.guests = robots;
        self.on_alive(others);
    }

    /// Says this robot's vote when it is due.
    pub(super) fn speak(&mut self, effects: &mut Effects<'_>) {
        let vocabulary = self.classifier.as_ref().map(|classifier| classifier.vocabulary().id());
        let Some(round) = self.round.as_mut() else { return };
        let said = round.speak(self.now, self.me, &mut self.stamp, vocabulary, self.blind, &self.config);
        effects.out.extend(said.map(Output::Broadcast));
    }

    /// Concludes when the votes suffice or the time is over, and holds the greatest decision known.
    pub(super) fn decide(&mut self, effects: &mut Effects<'_>) {
        let own_scale = self.own_scale();
        let Some(round) = self.round.as_mut() else { return };
        let concludes = round.open && round.agreement.held().is_none();
        let scale = own_scale.or_else(|| concludes.then(|| round.ballot.prevailing_scale())?);
        round.conclude(self.now, self.me, &self.alive, scale, &*self.fusion, &self.config);
        // While the votes may still suffice, the "no decision" of a robot that heard less ends nothing.
        let or_none = !round.open || self.now >= round.patience_and_deadline(&self.config).1;
        if let Some(decision) = round.agreement.settle(self.now, or_none) {
            effects.out.push(Output::Hold(decision.clone()));
        }
    }

    /// How long this robot leaves to those before it whatever one robot is to say for all: the live robot of the smallest
    /// id speaks first, each next one waits a while longer for the one before.
    #[must_use]
    pub fn turn(&self) -> Duration {
        self.config.takeover.saturating_mul(self.turns)
    }

    /// When this robot, as the spokesrobot or in its place, is to announce the decision it holds.
    pub(super) fn announcement(&self) -> Option<Duration> {
        let wait = self.config.settle.saturating_add(self.turn());
        self.round.as_ref()?.agreement.announcement(wait)
    }

    pub(super) fn announce(&mut self, effects: &mut Effects<'_>) {
        let Some(agreement) = self.round.as_mut().map(|round| &mut round.agreement) else { return };
        if let Some(decision) = agreement.held().cloned() {
            agreement.note_announced(self.now, decision.class);
            effects.out.push(Output::Announce(decision));
        }
    }

    pub(super) fn own_scale(&self) -> Option<Scale> {
        let vocabulary = self.classifier.as_ref()?.vocabulary();
        Some(Scale { vocabulary: vocabulary.id(), classes: vocabulary.classes() })
    }
}
