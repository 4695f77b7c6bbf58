//! How the decisions of one round become one: the greatest wins, and one robot says it aloud.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{ClassId, Decision, Fnv1a, Holder, MAX_ROBOTS, Rank, RobotId, Stamp};

/// What a robot knows of the decisions of one round.
///
/// Believing commutes and repeats harmlessly: the greatest decision is kept, whatever the order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Agreement {
    best: Option<Arc<Decision>>,
    /// Its rank, which all its votes are added up for.
    best_rank: Option<Rank>,
    /// What each robot said last that it holds, this one among them. At most [`MAX_ROBOTS`].
    holders: BTreeMap<RobotId, Holder>,
    held: Option<Held>,
    /// The first gesture held, in this round or in one before it under its count. Whoever counts for one gesture of a round counts for no other, or two could be final.
    first: Option<ClassId>,
    /// Who said something in rounds of its count in two of its lives: in the first it may have counted for a gesture that it has forgotten.
    restarted: BTreeSet<RobotId>,
    /// What robots said last that they hold in other rounds of its count, and when. At most [`MAX_ROBOTS`].
    elsewhere: BTreeMap<RobotId, (Stamp, Option<ClassId>)>,
    announced: Option<Announced>,
}

#[derive(Clone, Debug, PartialEq)]
struct Held {
    decision: Arc<Decision>,
    rank: Rank,
    since: Duration,
    /// When the class last changed, or was first contradicted by an announcement.
    unsettled: Duration,
    /// Whether it is to be replaced, by a lesser one if need be.
    gives_way: bool,
}

/// What was last said aloud for the swarm.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Announced {
    class: Option<ClassId>,
    is_final: bool,
}

impl Agreement {
    /// Hears a robot's word of what it holds, its own or passed on: the latest replaces all earlier ones. Says whether it was news.
    pub fn note_holder(&mut self, holder: Holder) -> bool {
        self.note_life(holder.robot, holder.stamp);
        let known = self.holders.get(&holder.robot);
        let is_news = match known {
            Some(known) => known.stamp < holder.stamp,
            None => self.holders.len() < MAX_ROBOTS,
        };
        if is_news {
            self.holders.insert(holder.robot, holder);
        }
        is_news
    }

    /// A word of that stamp: one of another life than those before, on whichever round of this count, tells that the robot started again.
    fn note_life(&mut self, robot: RobotId, stamp: Stamp) {
        if self.words(robot).any(|(known, _)| known.boot != stamp.boot) {
            self.note_restart(robot);
        }
    }

    /// That robot started again in the midst of the round: from now on it counts for no gesture, or two could be final.
    pub fn note_restart(&mut self, robot: RobotId) {
        if self.restarted.len() < MAX_ROBOTS {
            self.restarted.insert(robot);
        }
    }

    /// Whether it did, as far as is known.
    #[must_use]
    pub fn has_restarted(&self, robot: RobotId) -> bool {
        self.restarted.contains(&robot)
    }

    /// Forgets what these robots hold, and every decision that counted one of them, or that one of them drew; whether there was one.
    pub fn expel(&mut self, robots: &BTreeSet<RobotId>) -> bool {
        let counts = |decision: &Decision| {
            let certificate = &decision.certificate;
            let voters = certificate.votes.iter().map(|counted| counted.robot);
            let others = certificate.others.iter().map(|held| held.robot);
            voters.chain(others).chain([decision.author]).any(|robot| robots.contains(&robot))
        };
        self.holders.retain(|robot, _| !robots.contains(robot));
        self.elsewhere.retain(|robot, _| !robots.contains(robot));
        let forgotten = self.best.take_if(|best| counts(best)).is_some();
        self.best_rank.take_if(|_| forgotten);
        self.held.take_if(|held| counts(&held.decision)).is_some() || forgotten
    }

    /// What robots said that they hold, by robot.
    pub fn holders(&self) -> impl Iterator<Item = &Holder> {
        self.holders.values()
    }

    /// What that robot said last that it holds.
    #[must_use]
    pub fn holder(&self, robot: RobotId) -> Option<&Holder> {
        self.holders.get(&robot)
    }

    /// These words in short, for a neighbour that may lack some: a hint, which somebody may make look like another.
    #[must_use]
    pub fn digest(&self) -> u16 {
        let mut digest = Fnv1a::default();
        for Holder { robot, stamp: Stamp { boot, sequence }, .. } in self.holders.values() {
            digest.add([robot.0, *boot, *sequence].into_iter().flat_map(u32::to_le_bytes));
        }
        // Its lower half alone would be that of the last bytes.
        let hash = if self.holders.is_empty() { 0 } else { digest.hash() };
        (hash ^ hash >> 16 ^ hash >> 32 ^ hash >> 48) as u16
    }

    /// Whether so many robots are known to hold the class held here: by their own words, and this one, `me`, and its guests, who hold
    /// what it holds. Those alone count of whom that is said.
    #[must_use]
    pub fn is_final(
        &self,
        quorum: u32,
        me: RobotId,
        guests: &BTreeSet<RobotId>,
        counts: impl Fn(RobotId) -> bool,
    ) -> bool {
        let Some(class) = self.held().and_then(|held| held.class) else { return false };
        let counts = |robot: RobotId| !self.has_restarted(robot) && counts(robot);
        let holds = |holder: &&Holder| {
            let Holder { robot, holding, .. } = holder;
            let other = *robot != me && !guests.contains(robot);
            holding.class == Some(class) && !holding.changed && other && counts(*robot)
        };
        let through_this = guests.iter().chain([&me]).filter(|robot| counts(**robot));
        let own = if self.has_changed(me) { 0 } else { through_this.count() };
        if own + self.holders.len() < quorum as usize {
            return false;
        }
        own + self.holders().filter(holds).count() >= quorum as usize
    }

    /// The first gesture held counts in this round too, of the same count: a vote that a cut held back may have opened it a second time, under another name. And who
    /// started again in the midst of that counts for none in this.
    pub fn follow(&mut self, before: Self) {
        (self.first, self.elsewhere, self.restarted) = (before.first, before.elsewhere, before.restarted);
        for Holder { robot, stamp, holding, .. } in before.holders.into_values() {
            self.note_elsewhere(robot, stamp, holding.class);
        }
    }

    /// Hears a robot's word on another round of this count.
    pub fn note_elsewhere(&mut self, robot: RobotId, stamp: Stamp, class: Option<ClassId>) {
        self.note_life(robot, stamp);
        let is_news = match self.elsewhere.get(&robot) {
            Some((known, _)) => *known < stamp,
            None => self.elsewhere.len() < MAX_ROBOTS,
        };
        if is_news {
            self.elsewhere.insert(robot, (stamp, class));
        }
    }

    /// What that robot said last that it holds in any round of this count, if it said anything.
    #[must_use]
    pub fn word(&self, robot: RobotId) -> Option<Option<ClassId>> {
        // One word may have been of another round until its name was found to be one of this.
        self.words(robot).max_by_key(|(stamp, _)| *stamp).map(|(_, class)| class)
    }

    /// What that robot said last that it holds in this round, and in others of this count, and when.
    fn words(&self, robot: RobotId) -> impl Iterator<Item = (Stamp, Option<ClassId>)> {
        let here = self.holder(robot).map(|holder| (holder.stamp, holder.holding.class));
        here.into_iter().chain(self.elsewhere.get(&robot).copied())
    }

    /// Whether so many robots say that they hold that gesture, in whichever round of this count, and whatever they held before: of whom that is said, they count.
    #[must_use]
    pub fn is_held_by(&self, quorum: u32, class: Option<ClassId>, counts: impl Fn(RobotId) -> bool) -> bool {
        let not_here = self.elsewhere.keys().filter(|robot| !self.holders.contains_key(robot));
        let robots = self.holders.keys().chain(not_here);
        let holds = |robot: &&RobotId| self.word(**robot) == Some(class) && counts(**robot);
        class.is_some() && robots.filter(holds).count() >= quorum as usize
    }

    /// Gives way to this decision, though it may be lesser than the one that is held.
    pub fn give_way(&mut self, decision: Decision) -> bool {
        self.best_rank = None;
        self.held.iter_mut().for_each(|held| held.gives_way = true);
        self.believe(decision)
    }

    /// Whether another gesture was held before this one, or may have been: by `me`, this robot, before it started.
    #[must_use]
    pub fn has_changed(&self, me: RobotId) -> bool {
        let is_another = |held: &Decision| held.class != self.first || self.has_restarted(me);
        self.held().is_some_and(|held| held.class.is_some() && is_another(held))
    }

    /// Takes the greater of this decision and the best known one. A robot's own conclusion needs no witnesses.
    pub fn believe(&mut self, decision: Decision) -> bool {
        let rank = decision.rank();
        let greater = self.best_rank.is_none_or(|best| rank > best);
        if greater {
            (self.best, self.best_rank) = (Some(Arc::new(decision)), Some(rank));
        }
        greater
    }

    /// Holds the best decision known, if it is greater than the one held; one without a class only if `or_none`.
    /// Returns the decision when it is newly held.
    pub fn settle(&mut self, now: Duration, or_none: bool) -> Option<&Decision> {
        let best = self.best.as_ref().filter(|best| best.class.is_some() || or_none)?;
        let rank = self.best_rank?;
        match &mut self.held {
            Some(held) if rank <= held.rank && !held.gives_way => return None,
            Some(held) => {
                if best.class != held.decision.class {
                    held.unsettled = now;
                }
                (held.decision, held.rank, held.gives_way) = (best.clone(), rank, false);
            }
            None => {
                let decision = best.clone();
                self.held = Some(Held { decision, rank, since: now, unsettled: now, gives_way: false });
            }
        }
        self.first = self.first.or(best.class);
        self.held()
    }

    /// The decision held.
    #[must_use]
    pub fn held(&self) -> Option<&Decision> {
        self.held.as_ref().map(|held| &*held.decision)
    }

    /// The greatest decision that may be held.
    #[must_use]
    pub fn best(&self) -> Option<&Decision> {
        self.best.as_deref()
    }

    /// Since when one is held.
    #[must_use]
    pub fn held_since(&self) -> Option<Duration> {
        self.held.as_ref().map(|held| held.since)
    }

    /// When its class last changed, or was first contradicted.
    #[must_use]
    pub fn unsettled(&self) -> Option<Duration> {
        self.held.as_ref().map(|held| held.unsettled)
    }

    /// The rank of the decision held.
    #[must_use]
    pub fn rank(&self) -> Option<Rank> {
        self.held.as_ref().map(|held| held.rank)
    }

    /// Notes that this class was announced for the swarm, by whomever.
    pub fn note_announced(&mut self, now: Duration, class: Option<ClassId>, is_final: bool) {
        let answered = self.announced.map(|announced| announced.class);
        // An earlier announcement may come again.
        let is_final = is_final || self.announced == Some(Announced { class, is_final: true });
        self.announced = Some(Announced { class, is_final });
        if let Some(held) = self.held.as_mut().filter(|held| held.decision.class != class)
            // Who goes on contradicting keeps nobody from answering.
            && answered.is_none_or(|answered| answered == held.decision.class)
        {
            held.unsettled = now;
        }
    }

    /// Whether the class held was announced as final: then nothing is left to be announced.
    #[must_use]
    pub fn is_announced(&self) -> bool {
        let held = self.held.as_ref().map(|held| held.decision.class);
        self.announced.is_some_and(|announced| announced.is_final && Some(announced.class) == held)
    }

    /// When a robot that waits that long after the last change announces the decision held; `None` while there is
    /// none, or its class is announced already. A gesture that no majority is known to hold waits `provisional` longer,
    /// and is announced again when one is.
    #[must_use]
    pub fn announcement(&self, wait: Duration, is_final: bool, provisional: Duration) -> Option<Duration> {
        let held = self.held.as_ref()?;
        let due = held.unsettled + wait;
        match self.announced.filter(|announced| announced.class == held.decision.class) {
            Some(announced) if announced.is_final || !is_final => None,
            None if !is_final && held.decision.class.is_some() => Some(due + provisional),
            Some(_) | None => Some(due),
        }
    }
}

#[cfg(test)]
mod tests;
