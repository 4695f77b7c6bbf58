//! What is said aloud for the swarm: by this robot when it is its turn, and by others.

use std::time::Duration;

use gestalt_protocol::{Announced, Announcement, Decision, Message};

use super::hearing::Heard;
use super::output::Output;
use super::rounds::{Effects, Rounds};
use crate::agreement::Agreement;
use crate::refusal::Refusal;

impl Rounds {
    pub(super) fn on_announced(&mut self, announcement: Announcement, effects: &mut Effects<'_>) {
        let Announcement { decision, announcer, label, .. } = announcement;
        self.announcement_stands = false;
        if !self.may_hear(&decision, announcer, false) {
            return;
        }
        // Clients act on the word. What is said under a false one was not said: this robot says it itself.
        if !self.may_be_called(&decision, label.as_deref()) {
            return self.refusals.add(Refusal::Label);
        }
        let (id, class, is_final) = (decision.round, decision.class, decision.is_final);
        // Who has no list of gestures announces without a label, and a liar may do so to keep it from all clients: who knows one still says it in its turn.
        let lacks_its_label = label.is_none() && self.label_of(&decision).is_some();
        let heard = self.hear_decision(decision, announcer, effects);
        // What nobody would decide, nobody announced.
        let is_said = heard != Heard::Refused && !lacks_its_label;
        self.announcement_stands = is_said && heard != Heard::Doubted;
        if is_said
            && self.is_this_round(id)
            && let Some(round) = &mut self.round
        {
            // Clients heard it, and are to hear what is held here. If that comes to be this, it is still to be said that it is final.
            round.agreement.note_announced(self.now, class, is_final && self.announcement_stands);
        }
    }

    /// Whether what another robot [announced](crate::machine::Input::Announced) last stands: this robot found nothing against it, and it is no older than what it
    /// is in. What does not is to be told to nobody who acts on it.
    #[must_use]
    pub fn announcement_stands(&self) -> bool {
        self.announcement_stands
    }

    /// How long this robot leaves to those before it whatever one robot is to say for all: the live robot of the smallest
    /// id speaks first, each next one waits a while longer for the one before.
    #[must_use]
    pub fn turn(&self) -> Duration {
        self.config.takeover.saturating_mul(self.turns)
    }

    /// Before when it announces nothing, whatever the others hold.
    pub(super) fn earliest_announcement(&self) -> Option<Duration> {
        let wait = self.config.settle.saturating_add(self.turn());
        Some(self.round.as_ref()?.agreement.unsettled()?.saturating_add(wait))
    }

    /// Whether it is time to announce the decision held. Asked at every input: how many hold it is counted only once there is nothing else to wait for.
    pub(super) fn is_to_announce(&self) -> bool {
        let is_due = |due: Duration| self.now >= due;
        self.earliest_announcement().is_some_and(is_due) && self.announcement().is_some_and(is_due)
    }

    /// When this robot, as the spokesrobot or in its place, is to announce the decision it holds.
    pub(super) fn announcement(&self) -> Option<Duration> {
        let wait = self.config.settle.saturating_add(self.turn());
        let agreement = &self.round.as_ref()?.agreement;
        // Asked at every input: that many hold it is counted only while there is something to announce.
        if agreement.held().is_none() || agreement.is_announced() {
            return None;
        }
        agreement.announcement(wait, self.is_final(agreement), self.config.deadline)
    }

    pub(super) fn announce(&mut self, effects: &mut Effects<'_>) {
        let is_final = self.round.as_ref().is_some_and(|round| self.is_final(&round.agreement));
        let Some(agreement) = self.round.as_mut().map(|round| &mut round.agreement) else { return };
        if let Some(decision) = agreement.held().cloned() {
            agreement.note_announced(self.now, decision.class, is_final);
            let said = self.aloud(Decision { is_final, ..decision });
            let announcement = Announcement::of(self.stamped(said));
            if let Some(announcement) = announcement {
                (effects.carry_out)(Output::Announce(announcement));
            }
        }
    }

    /// The decision held as this robot says it to whoever asks; `None` while it holds none. It has its stamp and no signature yet: few ask, and a
    /// signature takes longer than all else of it.
    #[must_use]
    pub fn held_aloud(&mut self) -> Option<Announcement> {
        let agreement = &self.round.as_ref()?.agreement;
        let (is_final, decision) = (self.is_final(agreement), agreement.held()?.clone());
        let said = self.aloud(Decision { is_final, ..decision });
        Announcement::of(self.unsigned(said))
    }

    /// What its gesture is called, if this robot has the vocabulary that it was decided by.
    #[must_use]
    pub fn label_of(&self, decision: &Decision) -> Option<&str> {
        let known = self.classifier.as_ref().map(|classifier| classifier.vocabulary());
        let vocabulary = known.or(self.vocabulary.as_ref())?;
        let class = decision.class.filter(|_| vocabulary.id() == decision.certificate.vocabulary)?;
        vocabulary.label(class).or_else(|| self.names.get(&class).map(|called| called.title.as_str()))
    }

    /// Whether a decision may be announced under that label, as far as this robot knows what its gesture is called. Two robots may call one that was
    /// named differently for a while.
    pub(super) fn may_be_called(&self, decision: &Decision, label: Option<&str>) -> bool {
        let Some(label) = label else { return true };
        let Some(class) = decision.class else { return false };
        let Some(known) = self.label_of(decision) else { return true };
        known == label || self.names.get(&class).is_some_and(|called| called.also.contains(label))
    }

    /// A decision in this robot's own words.
    fn aloud(&self, decision: Decision) -> Message {
        let label = self.label_of(&decision).map(str::to_owned);
        Message::Announced(Announced { decision, label })
    }

    pub(super) fn is_final(&self, agreement: &Agreement) -> bool {
        let holders = self.config.holders(self.electorate.count());
        agreement.is_final(holders, self.me, &self.guests, |robot| self.counts(robot))
    }
}
