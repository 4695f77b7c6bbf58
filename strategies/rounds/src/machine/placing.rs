//! Where a round that was heard of stands to the newest one known: whether it is that one by another name, an older one, or one to go on to.

use std::cmp::Ordering;
use std::time::Duration;

use gestalt_protocol::{Decision, MAX_ROBOTS, RobotId, RoundId, Stamp, Vote};

use super::rounds::{Effects, Rounds};
use crate::proof::said;
use crate::refusal::Refusal;
use crate::round::Round;

/// Counters may run ahead of what this life of the robot began with by so many, which is two years of gestures without a pause,
const MAX_AHEAD: u64 = 1 << 24;

/// and by so many more a second, which is as fast as gestures can be shown. So nobody uses them up.
const AHEAD_PER_SECOND: u64 = 2;

/// One robot alone takes another so far ahead at once. Bounds on how far depend on how long a robot lives: one word in between would part those that started
/// at other times.
const LEAP: u32 = 1024;

/// Under one count so many names of rounds that are over are remembered: where there were more, none that follows takes in another name.
const MAX_PAST: usize = 4 * MAX_ROBOTS;

impl Rounds {
    /// Whether that is a name of the newest round known: its own, or that of a round that was opened at the same time, as far as
    /// can be told. Equal counters alone do not say so: where memories were lost or the swarm was cut, they belong to other showings. And whoever may
    /// vote could call it by the name of one that is over: two gestures would have one name.
    pub(super) fn is_this_round(&self, id: RoundId) -> bool {
        let opened_at_once = |round: &Round| {
            round.id.counter == id.counter
                && self.now <= round.since.saturating_add(self.config.deadline)
                && !self.past.contains(&id)
                && self.past.len() < MAX_PAST
        };
        self.round.as_ref().is_some_and(|round| round.is_named(id) || opened_at_once(round))
    }

    /// Where a round that was heard of stands to the newest one known. `decided`: whether something was decided in it; `None` while it may yet be.
    pub(super) fn compare(&self, id: RoundId, decided: Option<bool>) -> Ordering {
        self.compare_known(id, decided, self.is_this_round(id))
    }

    /// Nobody goes back to a round that it was in before the newest for what may be said in that yet: two robots would call each other back without end.
    fn compare_known(&self, id: RoundId, decided: Option<bool>, this: bool) -> Ordering {
        match &self.round {
            None => Ordering::Greater,
            Some(_) if this => Ordering::Equal,
            Some(_) if decided.is_none() && self.past.contains(&id) => Ordering::Less,
            Some(round) => newer(id, decided, round),
        }
    }

    /// The same, of a round that robots are in by the word of `from`: by its vote, or by a decision that comes from it; refuses one too far ahead, or too
    /// soon. `this`: whether it is the newest one known, of which a decision says more than its name. Rounds opened at the same time merge here, on the
    /// smaller name.
    pub(super) fn place(
        &mut self,
        (id, decided): (RoundId, Option<bool>),
        this: bool,
        from: RobotId,
        effects: &mut Effects<'_>,
    ) -> Result<Ordering, Refusal> {
        let bound = self.bound();
        if u64::from(id.counter) > bound && !self.most_are_beyond(bound, (id, decided), from) {
            self.refusals.add(Refusal::FarAhead);
            return Err(Refusal::FarAhead);
        }
        let known = self.highest.unwrap_or(self.began.0);
        if id.counter > known.saturating_add(LEAP) && !self.is_vouched(known, (id, decided), from) {
            self.refusals.add(Refusal::FarAhead);
            return Err(Refusal::FarAhead);
        }
        if !this && self.is_too_soon((id, decided), from, effects) {
            self.refusals.add(Refusal::TooSoon);
            return Err(Refusal::TooSoon);
        }
        self.highest = self.highest.max(Some(id.counter));
        let order = self.compare_known(id, decided, this);
        let by = self.known(from);
        if let Some(round) = self.round.as_mut().filter(|_| order.is_eq()) {
            let before = round.id;
            if round.merge(id, by) {
                effects.follower.merged(before, id);
            }
            if self.afresh && id != before {
                round.agreement.note_restart(self.me);
            }
        }
        Ok(order)
    }

    /// How far counters may have come by now.
    fn bound(&self) -> u64 {
        let (first, began) = self.began;
        let lived = self.now.saturating_sub(began.unwrap_or(self.now)).as_secs();
        u64::from(first) + MAX_AHEAD + AHEAD_PER_SECOND * lived
    }

    /// Notes how far a robot counts whose decision is none here: in a swarm of its own it was enough, and it takes what is opened under a smaller count
    /// for older.
    pub(super) fn note_counted_elsewhere(&mut self, counter: u32, from: RobotId) {
        if self.known(from).is_some() && Some(counter) > self.highest {
            self.counted_elsewhere = self.counted_elsewhere.max(Some(counter));
        }
    }

    /// The counter to go on from when a round is opened: the highest heard of, or how far others count of whom no more is known. That may be a lie: it
    /// takes nobody as far as a leap, so that all follow who hear of the round, nor beyond the bound, and counts for one round.
    pub(super) fn last_counter(&mut self) -> Option<u32> {
        let elsewhere = self.counted_elsewhere.take();
        let leap = self.highest.unwrap_or(self.began.0).saturating_add(LEAP - 1);
        let bound = u32::try_from(self.bound() - 1).unwrap_or(u32::MAX);
        self.highest.max(elsewhere.map(|counter| counter.min(leap).min(bound)))
    }

    /// Whether more robots than may lie say that the swarm is so far beyond what is `known` here, where there are that many: by a decision, which is the word of
    /// many, or by their votes, which they repeat.
    fn is_vouched(&mut self, known: u32, (id, decided): (RoundId, Option<bool>), from: RobotId) -> bool {
        if let Some(decided) = decided {
            return decided;
        }
        if self.electorate.count() <= 2 {
            return true;
        }
        self.note_far_ahead(id, from);
        self.robots_beyond(known.saturating_add(LEAP).into()) > self.config.liars.max(1) as usize
    }

    /// Whether a majority is beyond the bound on counts: by a decision for a gesture, or by votes. Robots that started at other times have other bounds, and one robot
    /// can take each of them to its own, a little at a time: most go on together.
    fn most_are_beyond(&mut self, bound: u64, (id, decided): (RoundId, Option<bool>), from: RobotId) -> bool {
        if decided.is_none() {
            self.note_far_ahead(id, from);
        }
        let most = self.config.holders(self.electorate.count()).max(2) as usize;
        decided == Some(true) || self.robots_beyond(bound) >= most
    }

    fn note_far_ahead(&mut self, id: RoundId, from: RobotId) {
        if self.known(from).is_some() {
            self.far_ahead.insert(from, id.counter);
        }
    }

    fn robots_beyond(&self, counter: u64) -> usize {
        self.far_ahead.values().filter(|ahead| u64::from(**ahead) > counter).count()
    }

    /// Whether a decision can be of the round known here, opened at the same time: not if it took longer than that has lasted. One that began before this robot
    /// did has lasted longer than it knows.
    pub(super) fn is_as_old(&self, decision: &Decision) -> bool {
        let took = Duration::from_millis(decision.certificate.elapsed_ms.into());
        self.round.as_ref().is_some_and(|round| {
            round.id == decision.round
                || round.agreement.has_restarted(self.me)
                || self.now >= (round.since + took).saturating_sub(self.config.patience)
        })
    }

    /// Whether a decision counts votes that were cast under a name of the round known here: then it is of that round, whatever it calls it. Whoever heard
    /// those while its own round began took both for one; those who opened first heard of the other name too late to tell.
    pub(super) fn is_counted_in(&self, decision: &Decision, effects: &Effects<'_>) -> bool {
        let mut names = said(&decision.certificate).map(|(_, _, vote)| vote.round);
        let id = decision.round;
        let is_counted = self.round.as_ref().is_some_and(|round| {
            round.id.counter == id.counter
                && !self.past.contains(&id)
                && (names.any(|name| round.is_named(name))
                    || counts_some_of(decision, round, self.config.liars))
        });
        // What an instructor spoke of meanwhile was shown before.
        is_counted && (self.is_this_round(id) || !effects.follower.taught(id.counter).contains(&id))
    }

    /// Whether this robot opened the round that is open, undecided, under a count which belongs to that earlier round: it did not
    /// know of it.
    pub(super) fn is_displaced_by(&self, earlier: RoundId) -> bool {
        self.round.as_ref().is_some_and(|round| {
            let mine = round.id.opener == self.me && round.id.life == self.nonce;
            mine && round.open && round.id.counter == earlier.counter && round.agreement.held().is_none()
        })
    }
}

/// Whether a decision counts more robots than may lie that voted in this round too, in the same life, and came to call it by another name: by a smaller one, as
/// robots do where rounds merge. Whoever went to a greater one may have gone on to another showing. Asked where both are decided, as otherwise one gives
/// way to the other.
fn counts_some_of(decision: &Decision, round: &Round, liars: u32) -> bool {
    let both_decided = decision.class.is_some() && round.agreement.rank().is_some_and(|rank| rank.decided);
    let was_here = |(robot, stamp, vote): &(RobotId, Stamp, &Vote)| {
        round.ballot.of(*robot).is_some_and(|known| {
            let (here, there) = (known.vote.round, vote.round);
            let moved = known.stamp.boot == stamp.boot && here != there;
            moved && (known.stamp < *stamp) == (there < here)
        })
    };
    both_decided && said(&decision.certificate).filter(was_here).count() > liars as usize
}

/// Whether a round is newer than the one known here, which belongs to another showing. Of two under one count the greater name is, for all alike; but of two that
/// are over, one in which nothing was decided gives way to one in which something was: a part of a cut swarm that is too small to decide goes through rounds
/// of its own.
pub(super) fn newer(id: RoundId, decided: Option<bool>, known: &Round) -> Ordering {
    // One that was over when it was heard of holds nothing.
    let known_decided = known.agreement.rank().map(|rank| rank.decided).or((!known.open).then_some(false));
    let by_outcome = match (decided, known_decided) {
        (Some(decided), Some(known_decided)) if id.counter == known.id.counter && !known.open => {
            decided.cmp(&known_decided)
        }
        _ => Ordering::Equal,
    };
    by_outcome.then(id.cmp(&known.id))
}
