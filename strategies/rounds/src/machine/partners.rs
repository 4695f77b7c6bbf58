//! With whom, and when next, a robot compares what each has.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use gestalt_protocol::RobotId;

/// After a change of the neighbourhood, repair stays busy for this long.
const UNREST: Duration = Duration::from_secs(5);

/// For so long after the two have met, whoever is told what a neighbour has says what it has itself: each so learns that the other
/// hears it. The first words may be lost, before the network knows the way.
const MEETING: Duration = Duration::from_secs(10);

/// Later it does when the neighbour was told nothing for so many idle periods, as happens to those of a robot with many.
const SILENT_PERIODS: u32 = 6;

/// The partners of repair, and the time of the next one's turn.
#[derive(Clone, Debug)]
pub(super) struct Partners {
    neighbours: BTreeSet<RobotId>,
    /// Since when each neighbour is one, and when it was last told what this robot has.
    told: BTreeMap<RobotId, (Duration, Duration)>,
    next: Duration,
    busy_until: Duration,
    /// Whom this robot turned to last.
    last: Option<RobotId>,
}

impl Partners {
    pub fn new(first: Duration) -> Self {
        Self {
            neighbours: BTreeSet::new(),
            told: BTreeMap::new(),
            next: first,
            busy_until: Duration::ZERO,
            last: None,
        }
    }

    pub fn neighbours(&self) -> &BTreeSet<RobotId> {
        &self.neighbours
    }

    /// Takes the place of the old neighbourhood; gives those who are new in it.
    pub fn change(&mut self, now: Duration, robots: BTreeSet<RobotId>) -> Vec<RobotId> {
        let new: Vec<RobotId> = robots.difference(&self.neighbours).copied().collect();
        self.told.retain(|robot, _| robots.contains(robot));
        self.told.extend(new.iter().map(|robot| (*robot, (now, now))));
        self.neighbours = robots;
        new
    }

    /// A robot is told what this one has.
    pub fn tell(&mut self, now: Duration, robot: RobotId) {
        if let Some((_, told)) = self.told.get_mut(&robot) {
            *told = now;
        }
    }

    /// Whether a neighbour that says what it has is to hear from this robot, whatever either lacks.
    pub fn owes(&self, now: Duration, robot: RobotId, idle: Duration) -> bool {
        self.told.get(&robot).is_some_and(|(since, told)| {
            now < *since + MEETING || now >= told.saturating_add(idle.saturating_mul(SILENT_PERIODS))
        })
    }

    /// When the next repair is due; never for a robot that knows of no other.
    pub fn due(&self, alive: &BTreeSet<RobotId>) -> Option<Duration> {
        let alone = self.neighbours.is_empty() && alive.is_empty();
        (!alone).then_some(self.next)
    }

    /// Brings the next repair forward to the busy pace.
    pub fn hurry(&mut self, now: Duration, busy: Duration) {
        self.next = self.next.min(now + busy);
    }

    /// The same, and keeps to the busy pace for a while.
    pub fn stay_busy(&mut self, now: Duration, busy: Duration) {
        self.busy_until = now + UNREST;
        self.hurry(now, busy);
    }

    /// Whether it is somebody's turn. The next turn is after `busy`, or after `idle` when all has been quiet for long.
    pub fn is_due(&mut self, now: Duration, open: bool, (busy, idle): (Duration, Duration)) -> bool {
        if now < self.next {
            return false;
        }
        self.next = now + if open || now < self.busy_until { busy } else { idle };
        true
    }

    /// Whom to turn to: the neighbours in turn, or, where none is known, all the living in turn.
    pub fn turn(&mut self, alive: &BTreeSet<RobotId>) -> Option<RobotId> {
        let partners = if self.neighbours.is_empty() { alive } else { &self.neighbours };
        let next = partners.iter().find(|robot| Some(**robot) > self.last).or(partners.first()).copied();
        self.last = next;
        next
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const IDLE: Duration = Duration::from_secs(4);

    fn at(seconds: u64) -> Duration {
        Duration::from_secs(seconds)
    }

    #[test]
    fn who_has_just_been_met_or_was_told_nothing_for_long_is_answered() {
        let robot = RobotId(3);
        let mut partners = Partners::new(at(0));
        assert!(!partners.owes(at(1), robot, IDLE), "it is no neighbour");
        partners.change(at(1), [robot].into());
        assert!(partners.owes(at(10), robot, IDLE), "they have just met");
        partners.tell(at(12), robot);
        assert!(!partners.owes(at(35), robot, IDLE));
        assert!(partners.owes(at(36), robot, IDLE), "it was told nothing for six periods");
        partners.tell(at(36), robot);
        assert!(!partners.owes(at(37), robot, IDLE));
        partners.change(at(40), BTreeSet::new());
        partners.change(at(41), [robot].into());
        assert!(partners.owes(at(42), robot, IDLE), "they have met again");
    }
}
