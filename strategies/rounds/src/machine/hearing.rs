//! What a robot makes of what the others say: of their votes, their decisions, and the rounds that these are about.

use std::cmp::Ordering;
use std::time::Duration;

use gestalt_protocol::{
    ClassId, Decision, Envelope, Give, HeldVote, Holder, Holding, Message, RobotId, Stamp, Vote,
};

use super::members::expected;
use super::placing::newer;
use super::rounds::{Effects, Rounds};
use super::wanted::Wanted;
use crate::ballot::{Cast, Scale};
use crate::proof::{follows, is_consistent, said};
use crate::quorum::Quorum;
use crate::refusal::Refusal;
use crate::round::{Round, View};

/// Who lacks a decision that another holds asks for it after this long: most have the votes, and conclude it themselves.
const ASK_AFTER: Duration = Duration::from_millis(100);

/// And this many times at most.
const ASKED: u8 = 4;

impl Rounds {
    pub(super) fn on_received(&mut self, envelope: Envelope, effects: &mut Effects<'_>) {
        let Envelope { author, stamp, message, signature } = envelope;
        if author == self.me {
            // The own words may come back; words never said are another's.
            if stamp.boot != self.stamp.boot || stamp > self.stamp {
                self.meet_duplicate(stamp);
            }
            return;
        }
        match message {
            Message::Vote(vote) => {
                self.hear_vote(HeldVote { robot: author, stamp, vote, signature }, effects);
            }
            Message::Have(have) => self.on_have(author, &have, effects),
            Message::Give(give) => self.on_give(author, give, effects),
            Message::Holding(holding) => {
                let word = Holder { robot: author, stamp, holding, signature };
                self.note_holder(word.clone(), effects);
                self.want(author, word.holding);
            }
            // That comes as what it is, an announcement.
            Message::Announced(_) => {}
            // And that as a question, to whoever follows the rounds.
            Message::Asked(_) => {}
            // Whoever follows the rounds to learn from them takes these in.
            Message::Samples(_)
            | Message::Batches(_)
            | Message::Know(_)
            | Message::Lessons(_)
            | Message::Namings(_) => {}
        }
    }

    /// Hears what a robot says that it holds, itself or by way of another. Says whether it was news.
    pub(super) fn note_holder(&mut self, holder: Holder, effects: &mut Effects<'_>) -> bool {
        if !self.is_this_round(holder.holding.round) {
            let Holder { robot, stamp, holding: Holding { round: id, class, .. }, .. } = holder;
            if let Some(round) = self.round.as_mut().filter(|round| round.id.counter == id.counter) {
                round.agreement.note_elsewhere(robot, stamp, class);
            }
            return false;
        }
        if holder.robot == self.me {
            if holder.stamp.boot < self.stamp.boot {
                self.note_restart(holder.robot);
                self.say_holding(effects);
            }
            return false;
        }
        self.round.as_mut().is_some_and(|round| round.agreement.note_holder(holder))
    }

    /// The newest round was one before that robot started.
    fn note_restart(&mut self, robot: RobotId) {
        if let Some(round) = &mut self.round {
            round.agreement.note_restart(robot);
        }
    }

    /// Asks a robot for what it says that it holds, if that is lacking here. That is a hint: what it then gives is looked into.
    fn want(&mut self, holder: RobotId, holding: Holding) {
        let greater = self.wanted.as_ref().is_none_or(|wanted| {
            (holding.round.counter, holding.rank) > (wanted.holding.round.counter, wanted.holding.rank)
        });
        if greater && self.lacks(&holding) {
            let due = self.wanted.as_ref().map_or(self.now + ASK_AFTER, |wanted| wanted.due);
            self.wanted = Some(Wanted { holder, holding, due, asked: 0 });
        }
    }

    /// Whether that is a decision of a newer round than this robot knows, or a greater one of the newest, for another gesture. A greater one
    /// for the same comes by repair.
    fn lacks(&self, holding: &Holding) -> bool {
        if holding.class.is_none() {
            return false;
        }
        match &self.round {
            Some(round) if self.is_this_round(holding.round) => {
                let (held, rank) = (round.agreement.held(), round.agreement.rank());
                let greater = |held: &Decision| held.class != holding.class && rank < Some(holding.rank);
                held.is_none_or(|held| greater(held) && !self.have_settled_on(held.class))
            }
            Some(round) => newer(holding.round, Some(true), round).is_gt(),
            None => true,
        }
    }

    /// Asks for a decision that is lacking here, if it still is when its time has come; and again, as a question may be lost.
    pub(super) fn ask_when_due(&mut self, effects: &mut Effects<'_>) {
        let Some(wanted) = self.wanted.take_if(|wanted| self.now >= wanted.due) else { return };
        if self.lacks(&wanted.holding) {
            self.tell_have(wanted.holder, false, effects);
            let (due, asked) = (self.now + self.config.repair_busy, wanted.asked + 1);
            self.wanted = (asked < ASKED).then_some(Wanted { due, asked, ..wanted });
        }
    }

    /// Lets a robot that opened a round under a count which belongs to an earlier one know of that.
    fn answer_displaced(&mut self, held: &HeldVote, effects: &mut Effects<'_>) {
        let opened = held.vote.round.opener == held.robot && held.vote.evidence.is_empty();
        let over = |round: &Round| !round.open && round.id.counter == held.vote.round.counter;
        if opened && self.round.as_ref().is_some_and(over) {
            self.tell_have(held.robot, false, effects);
        }
    }

    /// Counts a robot's vote, by whichever way it came. Says whether it was news.
    pub(super) fn hear_vote(&mut self, held: HeldVote, effects: &mut Effects<'_>) -> bool {
        let HeldVote { robot, stamp, ref vote, .. } = held;
        if robot == self.me {
            // From an earlier life it is merely old.
            if stamp > self.stamp {
                self.meet_duplicate(stamp);
            } else if stamp.boot < self.stamp.boot && self.is_this_round(vote.round) {
                self.note_restart(robot);
                self.say_holding(effects);
            }
            return false;
        }
        if vote.check().is_err() {
            self.refusals.add(Refusal::Impossible);
            return false;
        }
        if is_of_another_list(vote, self.own_scale()) {
            self.refusals.add(Refusal::Vocabulary);
            self.hear_of(robot);
            return false;
        }
        let this = self.is_this_round(vote.round);
        if !this && self.has_come_here(&held) {
            self.hear_of(robot);
            return false;
        }
        let order = match self.place((vote.round, None), this, robot, effects) {
            Err(refusal) => {
                self.hear_of(robot);
                if refusal == Refusal::TooSoon {
                    self.keep_waiting(held);
                }
                return false;
            }
            Ok(Ordering::Less) => {
                if self.round.as_ref().is_some_and(|round| round.id.counter == vote.round.counter) {
                    self.hear_of(robot);
                }
                self.answer_displaced(&held, effects);
                return false;
            }
            Ok(order) => order,
        };
        if order.is_gt() {
            self.join(vote.round, effects);
        }
        let Some(round) = self.round.as_mut() else { return false };
        let of_other_life = round.ballot.of(robot).filter(|known| known.stamp.boot != stamp.boot).cloned();
        if of_other_life.is_some() {
            round.agreement.note_restart(robot);
        }
        let is_news = match round.ballot.cast(effects.follower.keep(held)) {
            Cast::Counted => {
                self.electorate.hear(robot, self.now);
                if !self.alive.contains(robot) {
                    self.electorate.hear_absent(robot, self.now);
                }
                self.draw_if_the_size_calls_for_it();
                true
            }
            Cast::Known => false,
            Cast::Full => {
                self.refusals.add(Refusal::BallotFull);
                false
            }
        };
        if order.is_gt() {
            self.hear_waiting(effects);
        }
        if let Some(earlier) = of_other_life.filter(|known| known.stamp < stamp) {
            self.tell_of_other_life(earlier, effects);
        }
        is_news
    }

    /// Whether a robot has said since that vote what it holds of the round known here. It called that by another name then, or has left another for it: it is in
    /// none of that name.
    fn has_come_here(&self, vote: &HeldVote) -> bool {
        self.round.as_ref().is_some_and(|round| {
            round.id.counter == vote.vote.round.counter
                && round.agreement.holder(vote.robot).is_some_and(|holder| vote.stamp < holder.stamp)
        })
    }

    /// A robot that is there votes, if not in the round that this one is in: it says something, and counts as one that does. Whoever took it for a name
    /// without a robot would come to be a majority of its own.
    fn hear_of(&mut self, robot: RobotId) {
        if self.alive.contains(robot) {
            self.electorate.hear(robot, self.now);
        }
    }

    /// Whether a decision is to be looked into, which takes work: that of the votes it rests on. It comes from that robot, `given` or announced.
    /// The one that is held may be repeated.
    pub(super) fn may_hear(&mut self, decision: &Decision, from: RobotId, given: bool) -> bool {
        let held = self.round.as_ref().and_then(|round| round.agreement.held());
        let repeated =
            held.is_some_and(|held| held.round == decision.round && held.rank() == decision.rank());
        let known = self.known(from);
        let allowance = if given { &mut self.given } else { &mut self.announced };
        let allowed = repeated || allowance.take(self.now, known);
        if !allowed {
            self.refusals.add(Refusal::DecisionTooOften);
        }
        allowed
    }

    /// Takes in a decision that comes from that robot, `given` or announced.
    pub(super) fn hear_decision(
        &mut self,
        decision: Decision,
        from: RobotId,
        effects: &mut Effects<'_>,
    ) -> Heard {
        let decision = Decision { is_final: false, ..decision };
        if decision.check().is_err() {
            self.refusals.add(Refusal::Impossible);
            return Heard::Refused;
        }
        let opened_at_once = self.is_this_round(decision.round) && self.is_as_old(&decision);
        let this = opened_at_once || self.is_counted_in(&decision, effects);
        let held = self.round.as_ref().filter(|_| this).and_then(|round| round.agreement.held());
        if held == Some(&decision) {
            return Heard::Known;
        }
        let most_hold = self.most_have_settled_on(&decision).filter(|_| this);
        let gives_way = most_hold == Some(true);
        if let Err(refusal) = self.judge(&decision, this && !gives_way) {
            self.refusals.add(refusal);
            self.note_counted_elsewhere(decision.round.counter, from);
            return Heard::Refused;
        }
        if gives_way {
            // Its votes may be of a round that was gone through here before this one, which is one with it for all others.
            said(&decision.certificate).for_each(|(_, _, vote)| _ = self.past.remove(&vote.round));
        }
        let displaced = !this && self.is_displaced_by(decision.round);
        match self.place((decision.round, Some(decision.class.is_some())), this, from, effects) {
            Err(_) | Ok(Ordering::Less) => return Heard::Refused,
            // The gesture of a round of this robot's own is still shown.
            Ok(Ordering::Greater) if displaced => {
                self.open_next(effects);
                return Heard::Known;
            }
            // What is decided elsewhere needs no looking.
            Ok(Ordering::Greater) => self.enter(decision.round, false, effects),
            Ok(Ordering::Equal) => {}
        }
        self.cast_known(&decision, effects);
        let expected = expected(self.committee.as_ref(), &self.electorate, &self.alive);
        let committee = self.committee.as_ref().map(|committee| &committee.members);
        let (scale, robots) = (self.own_scale(), self.electorate.count());
        let Some(round) = self.round.as_mut() else { return Heard::Refused };
        let view = View { me: self.me, expected, robots, committee, scale };
        if self.config.liars > 0
            && decision.class.is_some()
            && !round.bears_out(self.now, &decision, &view, &*self.fusion, &self.config)
        {
            // Its votes were heard; what they are worth, this robot finds itself.
            return Heard::Doubted;
        }
        // Where that is no name of this round by now, it had as many: it is a decision of this by any of one count.
        let id = if round.is_named(decision.round) { decision.round } else { round.id };
        let decision = Decision { round: id, ..decision };
        let news = match most_hold {
            Some(true) => round.agreement.give_way(decision),
            Some(false) => return Heard::Doubted,
            None => round.agreement.believe(decision),
        };
        if news { Heard::News } else { Heard::Known }
    }

    /// Takes in the votes that come with a decision, those that it rests on and the others that were known. A robot whose vote was lost on its way here
    /// says something all the same: whoever took it for a name without a robot would draw another committee than all others, or be a majority of its own.
    fn cast_known(&mut self, decision: &Decision, effects: &mut Effects<'_>) {
        let own = self.own_scale();
        let Some(round) = self.round.as_mut() else { return };
        let (mut earlier, mut lived_before) = (Vec::new(), false);
        for held in decision.certificate.held_votes() {
            let (robot, stamp, vote) = (held.robot, held.stamp, &held.vote);
            if robot == self.me {
                lived_before |= stamp.boot < self.stamp.boot;
                continue;
            }
            if self.past.contains(&vote.round) {
                continue;
            }
            let known = round.ballot.of(robot).filter(|known| known.stamp.boot != stamp.boot);
            if let Some(known) = known {
                round.agreement.note_restart(robot);
                earlier.extend((known.stamp < stamp).then(|| known.clone()));
            }
            // Who judges by another list of gestures counts for nothing, and is there.
            let is_news = is_of_another_list(vote, own) || round.ballot.cast(held) == Cast::Counted;
            if is_news && self.alive.contains(robot) {
                self.electorate.hear(robot, self.now);
            }
        }
        if lived_before {
            round.agreement.note_restart(self.me);
            self.say_holding(effects);
        }
        earlier.into_iter().for_each(|vote| self.tell_of_other_life(vote, effects));
        self.draw_if_the_size_calls_for_it();
    }

    /// Lets a robot know of a vote that it said before it started: it does not know that it was in this round before, and would count itself.
    fn tell_of_other_life(&mut self, earlier: HeldVote, effects: &mut Effects<'_>) {
        let robot = earlier.robot;
        let give = Give { decision: None, votes: vec![earlier], holders: Vec::new() };
        self.tell(robot, Message::Give(give), effects);
    }

    /// Whether most hold the gesture of that decision where this robot holds another (`true`), or the other (`false`), long after its round was over.
    fn most_have_settled_on(&self, decision: &Decision) -> Option<bool> {
        let round = self.round.as_ref().filter(|round| round.id.counter == decision.round.counter)?;
        let (held, class) = (round.agreement.held()?.class, decision.class);
        if held == class {
            return None;
        }
        if self.have_settled_on(class) { Some(true) } else { self.have_settled_on(held).then_some(false) }
    }

    /// Whether most say that they hold that gesture, long after the newest round was over. By then all have met all decisions that they take: where robots differ
    /// on which rounds of a count are one, the greatest is not the same for all, and what most hold stands.
    pub(super) fn have_settled_on(&self, class: Option<ClassId>) -> bool {
        let Some(round) = self.round.as_ref().filter(|round| !round.open) else { return false };
        let long_over = self.now >= round.since.saturating_add(self.config.deadline.saturating_mul(2));
        let most = self.config.holders(self.electorate.count());
        long_over
            && self.config.quorum == Quorum::Majority
            && round.agreement.is_held_by(most, class, |robot| self.counts(robot))
    }

    /// Whether this robot would decide so itself on the votes that the decision rests on. `this`: where it is of the newest
    /// round, votes held here must be in it as their robots said them, and none of a round that is over.
    fn judge(&self, decision: &Decision, this: bool) -> Result<(), Refusal> {
        if decision.class.is_none() {
            // It decides nothing, but may be the first word of a round: somebody must have been in that.
            let somebody = this || decision.certificate.reached() > 0;
            return if somebody && is_consistent(decision) { Ok(()) } else { Err(Refusal::Unfounded) };
        }
        let certificate = &decision.certificate;
        let scale = Scale { vocabulary: certificate.vocabulary, classes: certificate.listed() };
        if self.own_scale().is_some_and(|own| own != scale) {
            return Err(Refusal::Vocabulary);
        }
        let ballot = self.round.as_ref().filter(|_| this).map(|round| &round.ballot);
        let true_words = said(certificate).all(|(robot, stamp, vote)| {
            let known = ballot.and_then(|ballot| ballot.confirms(robot, stamp, vote));
            let never_said = robot == self.me && stamp > self.stamp;
            let is_past = ballot.is_some() && self.past.contains(&vote.round);
            known != Some(false) && !never_said && !is_past
        });
        match true_words && follows(decision, &*self.fusion, &self.config, self.electorate.count()) {
            true => Ok(()),
            false => Err(Refusal::Unfounded),
        }
    }

    fn meet_duplicate(&mut self, stamp: Stamp) {
        self.refusals.add(Refusal::DuplicateId);
        self.duplicate = Some(stamp);
    }
}

/// Whether a robot of that scale, if it has one, cannot count what that vote says, as it judges by another list of gestures.
fn is_of_another_list(vote: &Vote, own: Option<Scale>) -> bool {
    !vote.evidence.is_empty() && own.is_some_and(|own| !own.is_of(vote))
}

/// What became of a decision that was heard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Heard {
    /// It may be held now: it is greater than those before.
    News,
    /// It changes nothing.
    Known,
    /// It is one that others may have drawn, and this robot holds it on no account: what its votes are worth to it, or what most say that they hold, is
    /// another gesture.
    Doubted,
    /// It is none, or of an older round.
    Refused,
}
