//! Which relay a robot belongs to, and whether it runs one itself.
//!
//! Who has no relay tries those that are heard, each robot in an order of its own, so that cells fill alike. A full one hangs up. Who finds
//! none with room founds one, after a time that is drawn so that of however many robots that look for one together few are first: the chance
//! of a slot doubles from each to the next, and who is heard in one slot is joined by those who wait for a later one. A relay that has long
//! been alone is given up for one that is heard.

use std::collections::BTreeMap;
use std::time::Duration;

use gestalt_protocol::RobotId;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::neighbourhood::place;

/// How long one slot is, which is how often a robot without a relay looks for one.
const SLOT: Duration = Duration::from_millis(250);

/// How many slots there are to found a relay in; in the first, one robot of 2^(`SLOTS` - 1) does.
const SLOTS: u32 = 7;

/// Who hangs up so soon is full, or wants no link, and is not tried for the longer time; another is for the shorter.
const BRIEF: Duration = Duration::from_secs(2);
const AVOIDED: Duration = Duration::from_secs(15);
const LOST: Duration = Duration::from_secs(3);

/// How long a robot whose relay is gone waits before it turns to another: who does so at once was measured to be told by it, in one case of ten,
/// that the robot that ran the lost one is alive, and never again that it is not.
const MOURNED: Duration = Duration::from_secs(1);

/// A relay that was heard, or dialled, within this time may be there.
const FRESH: Duration = Duration::from_secs(150);

/// How often a robot that has a relay looks for others, to know whom to turn to when it is gone.
const REST: Duration = Duration::from_secs(60);

/// How long a relay is alone, at least, before it is given up; drawn from up to three times that.
const ALONE: Duration = Duration::from_secs(10);

/// What a robot sees of the cells around it.
#[derive(Clone, Debug, Default)]
pub(super) struct View {
    /// The robots whose relays were heard, and when.
    pub heard: BTreeMap<RobotId, Duration>,
    /// Whose relay this robot's session is linked to.
    pub relay: Option<RobotId>,
    /// How many robots hang on the relay that this one runs, itself apart; `None` where it runs none.
    pub members: Option<usize>,
}

/// What to do next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    Rest,
    /// Ask who is there.
    Look,
    /// Give up the relay there is, and link to that of this robot.
    Join(RobotId),
    /// Run a relay.
    Found,
    /// Run it no more.
    GiveUp,
}

/// Chooses for one robot. Pure: time is an argument, and so is the chance.
#[derive(Debug)]
pub(super) struct Choice {
    me: RobotId,
    chance: ChaCha8Rng,
    /// When a relay is founded, if none is found before.
    found_at: Option<Duration>,
    joined: Option<(RobotId, Duration)>,
    mourns_until: Duration,
    /// Until when these are not tried.
    avoided: BTreeMap<RobotId, Duration>,
    /// When the relay is given up that nobody hangs on.
    alone_until: Option<Duration>,
    looked: Option<Duration>,
}

impl Choice {
    pub fn new(me: RobotId, seed: u64) -> Self {
        Self {
            me,
            chance: ChaCha8Rng::seed_from_u64(seed),
            found_at: None,
            joined: None,
            mourns_until: Duration::ZERO,
            avoided: BTreeMap::new(),
            alone_until: None,
            looked: None,
        }
    }

    /// That robot's relay took the link; if it is full it hangs up.
    pub fn dialled(&mut self, now: Duration, robot: RobotId) {
        self.joined = Some((robot, now));
    }

    /// That robot's relay could not be reached.
    pub fn failed(&mut self, now: Duration, robot: RobotId) {
        self.avoided.insert(robot, now + LOST);
    }

    /// Whether this robot has had its relay for a while.
    pub fn is_settled(&self, now: Duration) -> bool {
        self.joined.is_some_and(|(_, since)| now.saturating_sub(since) >= BRIEF)
    }

    /// The next step.
    pub fn plan(&mut self, now: Duration, view: &View) -> Step {
        self.avoided.retain(|_, until| *until > now);
        match view.relay {
            Some(relay) => self.rest(now, relay, view),
            None => self.search(now, view),
        }
    }

    fn rest(&mut self, now: Duration, relay: RobotId, view: &View) -> Step {
        self.found_at = None;
        let since = match self.joined {
            Some((joined, since)) if joined == relay => since,
            _ => {
                self.joined = Some((relay, now));
                now
            }
        };
        if relay != self.me {
            self.alone_until = None;
            // The other's stands: it is not full.
            let stands = now.saturating_sub(since) >= BRIEF;
            return if view.members.is_some() && stands { Step::GiveUp } else { self.look(now, REST) };
        }
        // The keeper of a relay's links looks for others itself.
        if view.members != Some(0) {
            self.alone_until = None;
            return Step::Rest;
        }
        let chance = &mut self.chance;
        let until =
            *self.alone_until.get_or_insert_with(|| now + ALONE.mul_f64(1.0 + 2.0 * chance.random::<f64>()));
        // All who are alone turn to the same one, which waits for them.
        let other = self.candidates(now, view).min().filter(|other| *other < self.me);
        if now < until { Step::Rest } else { other.map_or(Step::Rest, Step::Join) }
    }

    fn search(&mut self, now: Duration, view: &View) -> Step {
        if let Some((relay, since)) = self.joined.take() {
            let brief = now.saturating_sub(since) < BRIEF;
            self.avoided.insert(relay, now + if brief { AVOIDED } else { LOST });
            if !brief {
                self.mourns_until = now + MOURNED;
            }
        }
        self.alone_until = None;
        if view.members.is_some() {
            return Step::Join(self.me);
        }
        let chance = &mut self.chance;
        let found_at = *self.found_at.get_or_insert_with(|| now + wait(chance));
        if now < self.mourns_until {
            return self.look(now, SLOT);
        }
        let order = |other: &RobotId| place(self.me.0 as usize, *other);
        if let Some(other) = self.candidates(now, view).min_by_key(order) {
            return Step::Join(other);
        }
        if now >= found_at {
            self.found_at = None;
            return Step::Found;
        }
        self.look(now, SLOT)
    }

    /// Whose relays this robot may join.
    fn candidates<'a>(&'a self, now: Duration, view: &'a View) -> impl Iterator<Item = RobotId> + 'a {
        let fresh = view.heard.iter().filter(move |(_, at)| now.saturating_sub(**at) < FRESH);
        fresh.map(|(robot, _)| *robot).filter(|robot| *robot != self.me && !self.avoided.contains_key(robot))
    }

    fn look(&mut self, now: Duration, period: Duration) -> Step {
        if self.looked.is_some_and(|at| now.saturating_sub(at) < period) {
            return Step::Rest;
        }
        self.looked = Some(now);
        Step::Look
    }
}

/// How long a robot waits before it founds a relay.
fn wait(chance: &mut ChaCha8Rng) -> Duration {
    // Each earlier slot has half the chance.
    let earlier = chance.random::<u64>().leading_zeros().min(SLOTS - 1);
    SLOT * (SLOTS - 1 - earlier) + SLOT.mul_f64(chance.random())
}

#[cfg(test)]
mod tests;
