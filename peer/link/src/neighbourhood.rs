//! Which robots a robot should be linked to: few of them, and yet all of the swarm one connected whole.
//!
//! All robots stand in a ring, ordered by a hash of their ids, and each is linked to the one before and the one
//! after it; a second ring, by another hash, gives short paths and a way around any robot that fails. `max_links / 2`
//! rings keep the bound by construction, and robots that hear the same ones agree without a word. Of a pair, the
//! robot with the smaller id dials, since Zenoh may stop receiving where both do.
//!
//! Robots that do not all hear each other can differ in what rings they see. So whoever is heard but cannot be
//! reached is linked to as well, and such a bridge is kept even above the bound: the swarm comes first.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use gestalt_protocol::RobotId;

/// How long a robot that was heard is thought to be there without a sign of life.
const FRESH: Duration = Duration::from_secs(15);

/// How long the same robots must have been in sight before links are made, or unmade, to suit: every link made or
/// unmade is news to the whole swarm. Robots that keep coming delay the making by no more than the third.
const SETTLED: Duration = Duration::from_millis(900);
const SETTLED_TO_DROP: Duration = Duration::from_secs(8);
const UNSETTLED: Duration = Duration::from_secs(3);

/// How long the smaller id of a pair is left to dial before the other does.
const COURTESY: Duration = Duration::from_secs(2);

/// The same where this one is new and has no link yet: most likely the other has not heard of it.
const COURTESY_OF_NEW: Duration = Duration::from_millis(500);

/// How long a heard robot may stay unreachable before it is linked to outside the rings.
const PATIENCE: Duration = Duration::from_secs(4);
const PATIENCE_OF_OTHERS: Duration = Duration::from_secs(15);

/// A link that comes back this soon after it was dropped is needed by someone.
const NEEDED: Duration = Duration::from_secs(8);

/// How often a robot without any link looks for others.
const ALONE: Duration = Duration::from_secs(1);

/// When a new robot looks again, after its first look: others may have started at the same time.
const FIRST_LOOKS: [Duration; 3] = [Duration::from_secs(1), Duration::from_secs(2), Duration::from_secs(3)];

/// How often the smallest robot of a connected whole looks for others.
const LOOKOUT: Duration = Duration::from_secs(4);

/// The bounds on how often every other robot looks.
const REST: (Duration, Duration) = (Duration::from_secs(4), Duration::from_secs(60));

/// What a robot sees around it.
#[derive(Clone, Debug, Default)]
pub(super) struct View {
    /// Who can be dialled, and when each was last heard.
    pub(super) heard: BTreeMap<RobotId, Duration>,
    /// To whom there is a link.
    pub(super) linked: BTreeSet<RobotId>,
    /// Who is reachable, over however many links.
    pub(super) alive: BTreeSet<RobotId>,
}

/// What to do about it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Plan {
    pub(super) dial: BTreeSet<RobotId>,
    pub(super) drop: BTreeSet<RobotId>,
    /// Look who is there.
    pub(super) scout: bool,
}

/// Chooses the links of one robot. Pure: time is an argument.
#[derive(Debug)]
pub(super) struct Neighbourhood {
    me: RobotId,
    max_links: usize,
    /// Whether it came to others that were there, and not with them.
    is_new: bool,
    there: BTreeSet<RobotId>,
    wanted: BTreeSet<RobotId>,
    settled_since: Duration,
    unsettled_since: Option<Duration>,
    wanted_since: BTreeMap<RobotId, Duration>,
    unreachable_since: BTreeMap<RobotId, Duration>,
    dropped: BTreeMap<RobotId, Duration>,
    bridges: BTreeSet<RobotId>,
    scouted: Option<Duration>,
    looks: usize,
    missing: u32,
}

impl Neighbourhood {
    pub(super) fn new(me: RobotId, max_links: usize, is_new: bool) -> Self {
        Self {
            me,
            max_links,
            is_new,
            there: BTreeSet::new(),
            wanted: BTreeSet::new(),
            settled_since: Duration::ZERO,
            unsettled_since: None,
            wanted_since: BTreeMap::new(),
            unreachable_since: BTreeMap::new(),
            dropped: BTreeMap::new(),
            bridges: BTreeSet::new(),
            scouted: None,
            looks: 0,
            missing: 0,
        }
    }

    /// The next steps. Repeating one that is under way does no harm.
    pub(super) fn plan(&mut self, now: Duration, view: &View) -> Plan {
        let there: BTreeSet<_> = view
            .heard
            .iter()
            .filter(|(id, at)| view.alive.contains(id) || now.saturating_sub(**at) < FRESH)
            .map(|(id, _)| *id)
            .chain(view.linked.iter().copied())
            .collect();
        let (settled, since) = self.settled(now, &there);
        let wanted = self.wanted.clone();
        let mut dial = self.due_in_rings(now, &wanted, view);
        dial.extend(self.due_outside(now, &there, view));
        if !settled {
            dial.clear();
        }
        let drop = if since >= SETTLED_TO_DROP { self.surplus(now, &wanted, view) } else { BTreeSet::new() };
        let scout = self.scout_is_due(now, &there, view);
        Plan { dial, drop, scout }
    }

    /// Whether it is time to act on who is there, and since when nobody has come or gone.
    fn settled(&mut self, now: Duration, there: &BTreeSet<RobotId>) -> (bool, Duration) {
        if *there != self.there {
            self.there.clone_from(there);
            self.wanted = self.ring_neighbours(there);
            self.settled_since = now;
            self.unsettled_since.get_or_insert(now);
        }
        let since = now.saturating_sub(self.settled_since);
        let unsettled = self.unsettled_since.map_or(Duration::ZERO, |at| now.saturating_sub(at));
        if since >= SETTLED {
            self.unsettled_since = None;
        }
        (since >= SETTLED || unsettled >= UNSETTLED, since)
    }

    /// Those before and after this robot in each ring of `there`.
    fn ring_neighbours(&self, there: &BTreeSet<RobotId>) -> BTreeSet<RobotId> {
        let mut neighbours = BTreeSet::new();
        for ring in 0..self.max_links / 2 {
            let here = place(ring, self.me);
            // Going round from here, the next one has the least distance and the one before the greatest.
            let around = |id: &&RobotId| place(ring, **id).wrapping_sub(here);
            let others = || there.iter().filter(|id| **id != self.me);
            neighbours.extend(others().min_by_key(around));
            neighbours.extend(others().max_by_key(around));
        }
        neighbours
    }

    fn due_in_rings(&mut self, now: Duration, wanted: &BTreeSet<RobotId>, view: &View) -> BTreeSet<RobotId> {
        let lacking: BTreeSet<_> = wanted.difference(&view.linked).copied().collect();
        since(&mut self.wanted_since, &lacking, now);
        let is_alone = self.is_new && view.linked.is_empty();
        let courtesy = if is_alone { COURTESY_OF_NEW } else { COURTESY };
        let due = |id: &RobotId| self.me < *id || now.saturating_sub(self.wanted_since[id]) >= courtesy;
        lacking.into_iter().filter(due).collect()
    }

    /// The smallest of those that are heard and have not become reachable, each to be joined by one link.
    fn due_outside(&mut self, now: Duration, there: &BTreeSet<RobotId>, view: &View) -> Option<RobotId> {
        let unreachable: BTreeSet<_> =
            there.iter().filter(|id| **id != self.me && !view.alive.contains(id)).copied().collect();
        since(&mut self.unreachable_since, &unreachable, now);
        let waited = |id: RobotId| now.saturating_sub(self.unreachable_since[&id]);
        // One robot of a whole is enough; the others step in where it does not hear those that they hear.
        let first = view.alive.first().is_none_or(|id| self.me < *id);
        let patience = if first { PATIENCE } else { PATIENCE_OF_OTHERS };
        let smallest = unreachable.into_iter().find(|id| waited(*id) >= patience)?;
        let mine = self.me < smallest || waited(smallest) >= patience + COURTESY;
        let due = mine && !view.linked.contains(&smallest);
        if due && self.dropped.contains_key(&smallest) {
            self.bridges.insert(smallest);
        }
        due.then_some(smallest)
    }

    /// Links above the bound that no ring wants.
    fn surplus(&mut self, now: Duration, wanted: &BTreeSet<RobotId>, view: &View) -> BTreeSet<RobotId> {
        self.dropped.retain(|_, at| now.saturating_sub(*at) < NEEDED + COURTESY + PATIENCE);
        for id in &view.linked {
            let came_back =
                self.dropped.get(id).is_some_and(|at| (ALONE..NEEDED).contains(&now.saturating_sub(*at)));
            if came_back && !wanted.contains(id) {
                self.bridges.insert(*id);
            }
        }
        self.bridges.retain(|id| view.alive.contains(id) || view.heard.contains_key(id));
        let above = view.linked.len().saturating_sub(self.max_links);
        let free = |id: &&RobotId| !wanted.contains(id) && !self.bridges.contains(id);
        let drop: BTreeSet<_> = view.linked.iter().filter(free).take(above).copied().collect();
        for id in &drop {
            self.dropped.entry(*id).or_insert(now);
        }
        drop
    }

    fn scout_is_due(&mut self, now: Duration, there: &BTreeSet<RobotId>, view: &View) -> bool {
        // A robot known by its token alone may be just out of hearing for good: look for it ever less often.
        let everyone = there | &view.alive;
        let missing = everyone.len() > there.len()
            && self.ring_neighbours(&everyone).iter().any(|id| !there.contains(id));
        if !missing {
            self.missing = 0;
        }
        let smallest = everyone.first().is_none_or(|id| *id >= self.me);
        let period = if view.linked.is_empty() {
            ALONE
        } else if let Some(first) = FIRST_LOOKS.get(self.looks) {
            *first
        } else if missing {
            (ALONE / 2 * 2_u32.saturating_pow(self.missing)).min(REST.1)
        } else if smallest {
            LOOKOUT
        } else {
            (Duration::from_secs(2) * u32::try_from(everyone.len()).unwrap_or(u32::MAX)).clamp(REST.0, REST.1)
        };
        let due = self.scouted.is_none_or(|at| now.saturating_sub(at) >= period);
        if due {
            self.scouted = Some(now);
            self.looks += 1;
            self.missing = if missing { (self.missing + 1).min(8) } else { 0 };
        }
        due
    }
}

/// Keeps for each of `present` since when it has been there.
fn since(times: &mut BTreeMap<RobotId, Duration>, present: &BTreeSet<RobotId>, now: Duration) {
    times.retain(|id, _| present.contains(id));
    for id in present {
        times.entry(*id).or_insert(now);
    }
}

/// A robot's place in a ring: its id, well mixed (the finaliser of SplitMix64).
pub(super) fn place(ring: usize, id: RobotId) -> u64 {
    let mut z = (u64::from(id.0) + 1)
        .wrapping_add(((ring as u64) << 32).wrapping_mul(0x9e37_79b9_7f4a_7c15))
        .wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests;
