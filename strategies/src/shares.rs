//! Whose samples have how much room in a full training set: no author's push out those of the others.

use std::collections::BTreeSet;
use std::sync::Arc;

use gestalt_protocol::{MAX_ROBOTS, RobotId};

use crate::sample::{HeldSample, HeldSamples, SetPart};

/// However small the share of an author is, so many samples are no flood.
const LEAST: usize = 5;

/// The shares of a set's room, once it is known who is there. In a swarm of n robots and a set of T samples each other
/// robot has max(5, ⌈1.25 · T/n⌉), whether it is there or not; all robots together that were never alive in this life, max(5, ⌈T/4⌉): whoever makes up
/// names has that at most. Of a robot's own samples max(5, ⌈T/n⌉), but at most half of T, stay whatever others send. All
/// that matters when the set is full, and not before.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shares {
    /// Whose set it is, once it was told of others.
    me: Option<RobotId>,
    /// The robots alive now, this one among them or not: as the others of its process know them too, one list serves all.
    alive: Arc<BTreeSet<RobotId>>,
    /// Those that were alive at any time in this life and are not now: with those at most [`MAX_ROBOTS`].
    gone: BTreeSet<RobotId>,
    /// How many samples of strangers are held; `None` before they are counted.
    strange: Option<usize>,
}

impl Shares {
    /// These robots are alive now. Gives those that were not before.
    pub fn meet(&mut self, me: RobotId, alive: Arc<BTreeSet<RobotId>>) -> BTreeSet<RobotId> {
        let before = std::mem::replace(&mut self.alive, alive);
        self.me = Some(me);
        let others = |robot: &RobotId| *robot != me;
        let new = self.alive.difference(&before).copied().filter(others).collect();
        self.gone.extend(before.difference(&self.alive).copied().filter(others));
        self.gone.retain(|robot| !self.alive.contains(robot));
        self.strange = None;
        if self.others() + self.gone.len() > MAX_ROBOTS {
            self.gone.clear();
        }
        new
    }

    /// The set is another.
    pub fn recount(&mut self) {
        self.strange = None;
    }

    /// A sample came into the set.
    pub fn came(&mut self, sample: &HeldSample) {
        if self.is_strange(sample) {
            self.strange = self.strange.map(|strange| strange + 1);
        }
    }

    /// A sample went.
    pub fn went(&mut self, sample: &HeldSample) {
        if self.is_strange(sample) {
            self.strange = self.strange.map(|strange| strange.saturating_sub(1));
        }
    }

    fn is_strange(&self, sample: &HeldSample) -> bool {
        let author = sample.author().filter(|_| sample.part == SetPart::External);
        author.is_some_and(|author| !self.has_met(author))
    }

    /// Whether that robot was alive at any time in this life, as far as is kept.
    fn has_met(&self, robot: RobotId) -> bool {
        self.is_alive(robot) || self.gone.contains(&robot)
    }

    pub fn is_alive(&self, robot: RobotId) -> bool {
        self.me != Some(robot) && self.alive.contains(&robot)
    }

    /// How many other robots are alive.
    fn others(&self) -> usize {
        self.alive.len() - usize::from(self.me.is_some_and(|me| self.alive.contains(&me)))
    }

    /// The sample to go because its author, or all strangers together, have more than their share: of whoever is furthest
    /// above, the oldest of the class that it has most of.
    pub fn above(&mut self, samples: &HeldSamples, capacity: usize) -> Option<u64> {
        let n = self.robots()?;
        let each = LEAST.max((5 * capacity).div_ceil(4 * n));
        let strangers = LEAST.max(capacity.div_ceil(4));
        let count =
            || samples.authors().filter(|(author, _)| !self.has_met(*author)).map(|(_, held)| held).sum();
        let of_strangers = self.strange.unwrap_or_else(count);
        self.strange = Some(of_strangers);
        // Who hides gets no more room than who is there, and takes none from robots that are off.
        let (author, held) = samples.authors_of_most().next()?;
        let excess = held.saturating_sub(each);
        let excess_of_strangers = of_strangers.saturating_sub(strangers);
        if excess == 0 && excess_of_strangers == 0 {
            return None;
        }
        if excess_of_strangers >= excess {
            let mut authors = samples.authors_of_most().map(|(author, _)| author);
            oldest_of_most(samples, authors.find(|author| !self.has_met(*author))?)
        } else {
            oldest_of_most(samples, author)
        }
    }

    /// The sample to go in place of that one, if it is an own one and no more of them may go: the oldest of another robot,
    /// of the same class if there is one.
    pub fn in_place_of(&self, victim: &HeldSample, samples: &HeldSamples, capacity: usize) -> Option<u64> {
        let n = self.robots().filter(|_| victim.part != SetPart::External)?;
        let reserve = LEAST.max(capacity.div_ceil(n)).min(capacity / 2);
        if samples.total(SetPart::Personal) + samples.total(SetPart::Shared) > reserve {
            return None;
        }
        let external = |sample: &&HeldSample| sample.part == SetPart::External;
        let alike = samples.part_keys(SetPart::External, victim.class).first().copied();
        alike.or_else(|| samples.iter().find(external).map(|sample| sample.key))
    }

    /// How many robots there are; `None` for one that knows of no other.
    pub fn robots(&self) -> Option<usize> {
        Some(self.others() + 1).filter(|robots| *robots > 1)
    }
}

/// Of the samples of that author, the oldest of the class that most of them are of.
fn oldest_of_most(samples: &HeldSamples, of: RobotId) -> Option<u64> {
    let theirs = |key: &&u64| samples.get(**key).and_then(HeldSample::author) == Some(of);
    let of_class = |class| samples.part_keys(SetPart::External, class).iter().filter(theirs);
    let most = samples.classes().max_by_key(|class| (of_class(*class).count(), std::cmp::Reverse(*class)))?;
    of_class(most).next().copied()
}
