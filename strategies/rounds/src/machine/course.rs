//! The course of a round: when it opens, how long a robot looks, when it closes.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::RoundId;

use super::follow::{Follow, TAUGHT_AHEAD};
use super::output::Output;
use super::rounds::{Effects, Rounds};
use crate::classify::Classify;
use crate::observation::Observation;
use crate::refusal::Refusal;
use crate::round::Round;

impl Rounds {
    pub(super) fn on_open(&mut self, effects: &mut Effects<'_>) {
        if self.is_open() || self.now < self.refractory_until() {
            return;
        }
        self.open_next(effects);
    }

    /// Opens a round under the next count; one that is open is over. Names of rounds to come can be guessed, and one of which an instructor spoke is over:
    /// who speaks of them keeps nobody from opening one.
    pub(super) fn open_next(&mut self, effects: &mut Effects<'_>) {
        let Some(next) = self.last_counter().map_or(Some(1), |last| last.checked_add(1)) else {
            return self.refusals.add(Refusal::CountersUsedUp);
        };
        let named = |counter| RoundId { counter, opener: self.me, life: self.nonce };
        let last = next.saturating_add(TAUGHT_AHEAD);
        let is_free = |id: &RoundId| !effects.follower.taught(id.counter).contains(id);
        let id = (next..=last).map(named).find(is_free).unwrap_or_else(|| named(last));
        self.join(id, effects);
    }

    /// When the newest round began that this robot took part in, or in which something was decided. That others came to nothing in another is anybody's word, and keeps
    /// nobody from opening one.
    fn last_showing(&self) -> Option<Duration> {
        let decided = self.round.as_ref().filter(|round| round.has_decided());
        decided.map(|round| round.since).max(self.took_part)
    }

    /// Until when a request to open a round may be a copy of the one for the newest round.
    fn refractory_until(&self) -> Duration {
        self.last_showing().map_or(Duration::ZERO, |since| since + self.config.refractory)
    }

    /// When a round is to be opened for the gesture shown; never for one that has had its round, and not before the
    /// round of an earlier gesture is over.
    pub(super) fn showing(&self) -> Option<Duration> {
        let began = self.shown?;
        let waits = !self.is_open() && self.last_showing().is_none_or(|since| since < began);
        waits.then(|| self.refractory_until())
    }

    pub(super) fn on_left(&mut self) {
        self.shown = None;
        if let Some(round) = self.round.as_mut().filter(|round| round.open) {
            round.end_early(self.now, &self.config);
        }
    }

    pub(super) fn on_blind(&mut self, blind: bool) {
        if self.blind != blind
            && let Some(round) = &mut self.round
        {
            round.outdate();
        }
        self.blind = blind;
    }

    pub(super) fn on_observed(&mut self, observation: &Observation, learns: bool) {
        if !self.votes() {
            return;
        }
        let Some(round) = self.round.as_mut().filter(|round| round.open) else { return };
        let Some(classifier) = &self.classifier else {
            // Who learns has none until it was taught.
            if !learns {
                self.refusals.add(Refusal::NoClassifier);
            }
            return;
        };
        if !round.observe(self.now, observation, &**classifier, &self.config) {
            self.refusals.add(Refusal::Unclassified);
        }
    }

    pub(super) fn on_learned(&mut self, classifier: Arc<dyn Classify>) {
        let before = self.classifier.as_ref().map(|old| old.vocabulary());
        if let Some(round) = self.round.as_mut().filter(|_| before != Some(classifier.vocabulary())) {
            round.look_afresh();
        }
        self.classifier = Some(classifier);
    }

    /// When the open round closes: what is decided is left a while to meet what others decided.
    pub(super) fn closing(&self) -> Option<Duration> {
        let round = self.round.as_ref().filter(|round| round.open)?;
        Some(round.agreement.held_since()? + self.config.settle)
    }

    pub(super) fn close(&mut self, effects: &mut Effects<'_>) {
        if let Some(round) = self.round.as_mut().filter(|round| round.open) {
            round.open = false;
            // Where most of the swarm cannot be seen its members were to say nothing, also if they can be by the time that silence is judged.
            let asked = self.committee.is_none() || self.electorate.sees_most();
            round.lasted = asked && self.now >= round.since + self.config.patience;
        }
        if self.looking_until(effects.follower).is_none() {
            self.stop_looking(effects);
        }
    }

    /// Until when this robot looks at a round that is over: it saw something, and is to learn from more of it.
    pub(super) fn looking_until(&self, follower: &dyn Follow) -> Option<Duration> {
        let round = self.round.as_ref().filter(|round| !round.open)?;
        if self.looking.is_none() || !follower.learns() {
            return None;
        }
        let (_, deadline) = round.patience_and_deadline(&self.config);
        let more = self.now < deadline && follower.wants_more(round.id);
        Some(if more { deadline } else { self.now })
    }

    pub(super) fn stop_looking(&mut self, effects: &mut Effects<'_>) {
        if self.looking.take().is_some()
            && let Some(round) = &self.round
        {
            // Under the name it ended with: it may have merged with one of a smaller name meanwhile.
            (effects.carry_out)(Output::Closed(round.id));
        }
    }

    /// Takes part in a round from now on, unless it was shown before; an older one that is still open is over.
    pub(super) fn join(&mut self, id: RoundId, effects: &mut Effects<'_>) {
        self.enter(id, true, effects);
        if !self.is_open() {
            return;
        }
        (effects.carry_out)(Output::Opened(id));
        self.partners.hurry(self.now, self.config.repair_busy);
        self.speak();
    }

    /// Makes this the newest round known, with or without taking part in it. What an instructor spoke of was shown before, and is over: whoever says
    /// otherwise would have what is shown now learned as that.
    pub(super) fn enter(&mut self, id: RoundId, open: bool, effects: &mut Effects<'_>) {
        self.close(effects);
        self.stop_looking(effects);
        self.judge_silence();
        self.highest = self.highest.max(Some(id.counter));
        self.electorate.forget(self.now, self.config.lately, &self.alive);
        self.took_part = self.last_showing();
        let before = self.round.take().filter(|before| before.id.counter == id.counter);
        match &before {
            Some(before) if before.has_decided() => self.past.extend(before.names()),
            Some(_) => {}
            None => self.past.clear(),
        }
        let taught = effects.follower.taught(id.counter);
        let mut round = Round::new(id, self.now, open && !taught.contains(&id));
        if let Some(before) = before {
            round.agreement.follow(before.agreement);
        }
        if self.may_have_been_in(&round) {
            round.agreement.note_restart(self.me);
        }
        let open = round.open;
        if open {
            self.took_part = Some(self.now);
        }
        self.past.extend(taught);
        self.past.remove(&id);
        self.round = Some(round);
        self.committee = None;
        self.draw(&BTreeSet::new());
        self.looking = open.then_some(id);
        effects.follower.entered(id);
    }

    /// Who said nothing in the round before counts no more from now on. Not from its end: it is still to be made final by as many as there were when it was
    /// decided, and whether somebody was silent or cut off shows a while later.
    fn judge_silence(&mut self) {
        if let Some(round) = self.round.as_ref().filter(|round| round.lasted) {
            let since = round.since;
            self.electorate.round_over(since);
            self.note_silence();
        }
    }

    /// Whether this robot may have counted for a gesture of that round in an earlier life, which it has forgotten: where it heard of it soon after its start, or when it was
    /// over. Of one that it opens nobody has heard before; but others of its count may be one with it.
    fn may_have_been_in(&mut self, round: &Round) -> bool {
        let mine = round.id.opener == self.me && round.id.life == self.nonce;
        let started = self.began.1.unwrap_or(self.now);
        self.afresh &= !(round.open && self.now > started.saturating_add(self.config.deadline));
        self.afresh && !mine
    }
}
