//! The sure way: neighbours tell each other what they have and give each other what they lack, hop by hop, so
//! that nothing depends on how the fast way routes.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};

use gestalt_protocol::{Decision, Give, Have, Message, RobotId, Stamp};

use super::hearing::Heard;
use super::output::Output;
use super::partners::Standing;
use super::rounds::{Effects, Rounds};
use crate::refusal::Refusal;

/// The most votes in one [`Give`], so that it fits in a message whatever the vocabulary; the next one brings more.
const MAX_GIVEN: usize = 1024;

/// The most words on who holds what that fit beside a decision of the largest swarm.
const BESIDE_A_DECISION: usize = 256;

impl Rounds {
    /// Greets new neighbours with what this robot has.
    pub(super) fn on_neighbours(&mut self, mut robots: BTreeSet<RobotId>, effects: &mut Effects<'_>) {
        robots.remove(&self.me);
        if self.neighbours().eq(robots.iter().copied()) {
            return;
        }
        let new = self.partners.change(self.now, &robots);
        self.forget_accounts();
        self.hurry_repair();
        for robot in new {
            self.tell_have(robot, false, effects);
        }
    }

    /// Compares what this robot has with one neighbour, when it is time to.
    pub(super) fn repair_when_due(&mut self, effects: &mut Effects<'_>) {
        let periods = (self.config.repair_busy, self.config.repair_idle);
        if !self.partners.is_due(self.now, self.is_open(), periods) {
            return;
        }
        if let Some(robot) = self.partners.turn(&self.alive) {
            self.tell_have(robot, false, effects);
        }
    }

    /// Hears what a neighbour has: gives what it lacks, and asks for what this robot lacks itself.
    pub(super) fn on_have(&mut self, from: RobotId, have: &Have, effects: &mut Effects<'_>) {
        let known = self.known(from);
        if !self.haves.take(self.now, known) {
            self.refusals.add(Refusal::HaveTooOften);
            return;
        }
        if self.alive.contains(from) {
            self.electorate.meet(from);
        }
        // What a neighbour says it has is a hint: a newer round is asked for, and joined when it comes with the votes of those in it.
        let decided = have.decision.map(|rank| rank.decided);
        let order = have.round.map_or(Ordering::Less, |id| self.compare(id, decided));
        let (give, lacks) = (self.lacking_there(from, order, have), self.lacking_here(order, have));
        // What is given or answered now may be lost.
        if (give.is_some() || lacks)
            && self.partners.hurries(from, [(have.round, (have.decision, have.holders)), self.standing()])
        {
            self.hurry_repair();
        }
        if let Some(give) = give {
            self.tell(from, Message::Give(give), effects);
        }
        let owes = self.partners.owes(self.now, from, self.config.repair_idle);
        if !have.answer && (owes || lacks) {
            self.tell_have(from, true, effects);
        }
    }

    /// What this robot has of its newest round.
    fn standing(&self) -> Standing {
        let possession = self.round.as_ref().map(|round| (round.agreement.rank(), round.agreement.digest()));
        (self.round(), possession.unwrap_or_default())
    }

    /// Takes in what this robot lacked, and passes on what was news: the other neighbours may lack it too.
    pub(super) fn on_give(&mut self, from: RobotId, give: Give, effects: &mut Effects<'_>) {
        let mut news = Give { decision: None, votes: Vec::new(), holders: Vec::new() };
        let mut greater = false;
        if let Some(decision) = give.decision.filter(|decision| self.may_hear(decision, from, true)) {
            let missed = !self.is_this_round(decision.round);
            let known = self.round.as_ref().and_then(|round| round.agreement.best()).map(|best| best.class);
            // Of a greater one for the gesture that is held anyway the others are told, and ask for it if they lack it.
            let says_more = missed || known != Some(decision.class);
            if self.hear_decision(decision.clone(), from, effects) == Heard::News {
                if !self.is_open() && missed {
                    self.note_missed_announcement();
                }
                news.decision = Some(decision).filter(|_| says_more);
                greater = !says_more && !self.is_open();
            }
        }
        for held in give.votes {
            if self.hear_vote(held.clone(), effects) {
                news.votes.push(held);
            }
        }
        for holder in give.holders {
            if self.note_holder(holder.clone(), effects) {
                news.holders.push(holder);
            }
        }
        let is_news = news.decision.is_some() || !news.votes.is_empty() || !news.holders.is_empty();
        if !is_news && !greater {
            return;
        }
        if greater {
            // What is told next is what is held then.
            self.decide(effects);
        }
        let others: Vec<RobotId> = self.neighbours().filter(|robot| *robot != from).collect();
        for robot in others {
            if is_news {
                self.tell(robot, Message::Give(news.clone()), effects);
            }
            if greater {
                self.tell_have(robot, false, effects);
            }
        }
    }

    /// A round learnt of only after it was decided is not this robot's to announce: those who took part did.
    fn note_missed_announcement(&mut self) {
        if let Some(round) = &mut self.round
            && let Some(class) = round.agreement.best().map(|best| best.class)
        {
            round.agreement.note_announced(self.now, class, true);
        }
    }

    /// What the neighbour lacks; its newest round stands to this robot's as `order` says.
    fn lacking_there(&mut self, from: RobotId, order: Ordering, have: &Have) -> Option<Give> {
        let round = self.round.as_ref().filter(|_| order.is_le())?;
        let (rank, known) = match order {
            Ordering::Equal => (have.decision, have.votes.iter().copied().collect()),
            _ => (None, BTreeMap::<RobotId, Stamp>::new()),
        };
        // Most hold this gesture, and the neighbour another: it gives way.
        let word = round.agreement.word(from).flatten();
        let holds_another = |held: &Decision| word.is_some() && word != held.class;
        let gives_way = |held: &Decision| holds_another(held) && self.have_settled_on(held.class);
        let lacks = |held: &&Decision| round.agreement.rank() > rank || gives_way(held);
        let decision = round.agreement.held().filter(lacks).cloned();
        // Under the name that it knows then: it may have heard of this one too late to take both for one, and gives way to none that is older.
        let called = have.round.filter(|name| round.is_named(*name));
        let decision = decision.map(|held| match called.filter(|_| holds_another(&held)) {
            Some(round) => Decision { round, ..held },
            None => held,
        });
        // Who gets a decision gets the votes with it.
        let votes = if rank.is_none() && decision.is_none() {
            round.ballot.lacking(&known).take(MAX_GIVEN).collect()
        } else {
            Vec::new()
        };
        let agreement = &round.agreement;
        // Those that are on their way by themselves need not be given.
        let settled = agreement.held_since().is_some_and(|since| self.now >= since + self.config.settle);
        let lacks = order.is_lt() || have.holders != agreement.digest();
        let counts = settled && self.now <= round.since.saturating_add(self.config.lately);
        let fits = decision.is_none() || agreement.holders().count() <= BESIDE_A_DECISION;
        let holders =
            if counts && lacks && fits { agreement.holders().cloned().collect() } else { Vec::new() };
        let compared = [(have.decision, have.holders), (agreement.rank(), agreement.digest())];
        let due = if decision.is_some() || !holders.is_empty() {
            self.partners.give(self.now, from, compared, self.config.repair_idle)
        } else {
            // More votes than one message holds come with the next.
            !votes.is_empty()
        };
        due.then_some(Give { decision, votes, holders })
    }

    /// Whether the neighbour has something that this robot lacks.
    fn lacking_here(&self, order: Ordering, have: &Have) -> bool {
        let Some(round) = self.round.as_ref().filter(|_| order.is_eq()) else { return order.is_gt() };
        let rank = round.agreement.rank();
        let newer = |(robot, stamp): &(RobotId, Stamp)| {
            *robot != self.me && round.ballot.stamp(*robot).is_none_or(|mine| mine < *stamp)
        };
        let unsure = rank.is_some_and(|rank| rank.decided) && !self.is_final(&round.agreement);
        let settled = || self.have_settled_on(round.agreement.held().and_then(|held| held.class));
        (have.decision > rank && !settled())
            || (rank.is_none() && have.votes.iter().any(newer))
            || (unsure && have.holders != round.agreement.digest())
    }

    pub(super) fn tell_have(&mut self, robot: RobotId, answer: bool, effects: &mut Effects<'_>) {
        self.partners.tell(self.now, robot);
        let (round, (decision, holders)) = self.standing();
        let have = Have {
            round,
            decision,
            holders,
            votes: match &self.round {
                Some(round) if round.open => round.ballot.stamps().collect(),
                _ => Vec::new(),
            },
            knowledge: effects.follower.knowledge(),
            answer,
        };
        self.tell(robot, Message::Have(have), effects);
    }

    /// Turns to one neighbour after the other at the busy pace for a while: there is news for them.
    pub fn hurry_repair(&mut self) {
        self.partners.stay_busy(self.now, self.config.repair_busy);
    }

    /// The same, and to others than the neighbour that brought it at once.
    pub fn pass_on_soon(&mut self, from: RobotId) {
        self.partners.pass_on(self.now, from, self.config.repair_busy);
    }

    pub(super) fn tell(&mut self, robot: RobotId, message: Message, effects: &mut Effects<'_>) {
        let envelope = self.stamped(message);
        (effects.carry_out)(Output::Tell(robot, envelope));
    }
}
