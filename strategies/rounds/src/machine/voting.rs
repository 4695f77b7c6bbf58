//! What a robot says itself: its vote, and the decision it holds.

use std::collections::BTreeSet;
use std::sync::Arc;

use gestalt_protocol::{Envelope, Holder, Message, Pool, RobotId};

use super::members::expected;
use super::output::Output;
use super::rounds::{Effects, Rounds};
use crate::ballot::Scale;
use crate::others::Others;
use crate::round::{Round, Speaker, View};

/// However many rounds a pool is said to rest on, one that rests on so many is as good: the newest of them counts.
const MOST_ROUNDS: u16 = 64;

impl Rounds {
    pub(super) fn on_alive(&mut self, robots: Arc<BTreeSet<RobotId>>) {
        let all = if self.guests.is_subset(&robots) { robots } else { Arc::new(&*robots | &self.guests) };
        let before = std::mem::replace(&mut self.alive, Others::new(self.me, all));
        self.electorate.change(&before, &self.alive, self.now);
        self.draw(&self.alive.since(&before).collect());
        self.forget_accounts();
        // This robot speaks for its guests too: its turn is that of the smallest of them all.
        let first = self.guests.first().map_or(self.me, |guest| self.me.min(*guest));
        self.turns = u32::try_from(self.alive.below(first)).unwrap_or(u32::MAX);
    }

    pub(super) fn on_guests(&mut self, robots: BTreeSet<RobotId>) {
        let others = self.alive.iter().filter(|robot| !self.guests.contains(robot)).collect();
        self.guests = robots;
        self.on_alive(Arc::new(others));
    }

    /// Casts this robot's vote when it is due. Others are told of it by [`say_votes`](Self::say_votes).
    pub(super) fn speak(&mut self) {
        let vocabulary = self.classifier.as_ref().map(|classifier| classifier.vocabulary());
        let Some(round) = self.round.as_mut() else { return };
        let signer = self.signer.as_deref();
        let mut speaker =
            Speaker { me: self.me, stamp: &mut self.stamp, vocabulary, blind: self.blind, signer };
        self.unsaid.extend(round.speak(self.now, &mut speaker, &self.config));
    }

    pub(super) fn say_votes(&mut self, effects: &mut Effects<'_>) {
        for vote in self.unsaid.drain(..) {
            (effects.carry_out)(Output::Broadcast(vote));
        }
    }

    /// Concludes when the votes suffice or the time is over, and holds the greatest decision known.
    pub(super) fn decide(&mut self, effects: &mut Effects<'_>) {
        self.conclude(effects);
        let holds = self.settle(effects);
        // The program around this robot does not wait until others are told: that takes as long as all that is done with a vote, as signing does.
        self.say_votes(effects);
        if holds {
            self.say_holding(effects);
        }
    }

    /// Holds the greatest decision known; whether that is another one than before.
    fn settle(&mut self, effects: &mut Effects<'_>) -> bool {
        let Some(round) = self.round.as_mut() else { return false };
        // While the votes may still suffice, the "no decision" of a robot that heard less ends nothing.
        let or_none = !round.open || self.now >= round.patience_and_deadline(&self.config).1;
        let Some(decision) = round.agreement.settle(self.now, or_none) else { return false };
        // One for nothing need not convince by the pool that it states.
        let is_anothers = decision.class.is_some() && decision.author != self.me;
        if let Some(pool) = decision.certificate.pool.filter(|pool| is_anothers && pool.rounds > 0) {
            let stated = Pool { rounds: pool.rounds.min(MOST_ROUNDS), ..pool };
            self.heard_pool.take_if(|(_, heard)| heard.rounds <= stated.rounds);
            self.heard_pool.get_or_insert((decision.author, stated));
        }
        effects.follower.settled(decision, self.config.clip);
        (effects.carry_out)(Output::Hold(decision.clone()));
        true
    }

    fn conclude(&mut self, effects: &mut Effects<'_>) {
        // Asked at every input: what goes into a conclusion is looked up while there is none.
        if !self.round.as_ref().is_some_and(Round::is_unconcluded) {
            return;
        }
        let scale = self.own_scale();
        let expected = expected(self.committee.as_ref(), &self.electorate, &self.alive);
        let committee = self.committee.as_ref().map(|committee| &committee.members);
        let robots = self.electorate.count();
        let view = View { me: self.me, expected, robots, committee, scale };
        let Some(round) = self.round.as_mut() else { return };
        // Where liars are expected nothing that anybody said moves the rule by which they are judged.
        let (found, heard) = match self.config.liars {
            0 => (effects.follower.pool(), self.heard_pool.map(|(_, pool)| pool)),
            _ => (None, None),
        };
        // Who has lived through few rounds, or does not learn, would be surer than all others, and the surest decision is the one that all hold.
        let heard = heard.filter(|heard| found.is_none_or(|found| found.rounds < heard.rounds));
        // Nobody goes by what is only repeated: when who found it is expelled, nothing of it is left.
        let own_rounds = found.map_or(0, |found| found.rounds);
        let repeated = heard.map(|heard| Pool { rounds: own_rounds, ..heard });
        let learned = repeated.or(found);
        let fitted = learned.and_then(|pool| self.fusion.with(pool));
        let rule = fitted.as_deref().unwrap_or(&*self.fusion);
        round.conclude(self.now, &view, rule, &self.config);
    }

    /// Says which gesture this robot holds, unless that is what it said last: a greater decision for the same is news to nobody.
    pub(super) fn say_holding(&mut self, effects: &mut Effects<'_>) {
        // Of those who were drawn that is counted; what all others hold they can tell by that.
        let counts = self.counts(self.me) || self.guests.iter().any(|guest| self.counts(*guest));
        let round = self.round.as_ref().filter(|_| counts);
        let Some(agreement) = round.map(|round| &round.agreement) else { return };
        let Some(holding) = agreement.held().map(|held| held.holding(agreement.has_changed(self.me))) else {
            return;
        };
        let said = agreement.holder(self.me).map(|own| (own.holding.class, own.holding.changed));
        if said == Some((holding.class, holding.changed)) {
            return;
        }
        let envelope = self.stamped(Message::Holding(holding.clone()));
        let Envelope { author: robot, stamp, signature, .. } = envelope;
        if let Some(round) = &mut self.round {
            round.agreement.note_holder(Holder { robot, stamp, holding, signature });
        }
        (effects.carry_out)(Output::Broadcast(envelope));
    }

    pub(super) fn own_scale(&self) -> Option<Scale> {
        let vocabulary = self.classifier.as_ref()?.vocabulary();
        Some(Scale { vocabulary: vocabulary.id(), classes: vocabulary.labels().len() })
    }
}
