//! With whom, and when next, a robot compares what each has.

use std::collections::BTreeSet;
use std::time::Duration;

use gestalt_protocol::RobotId;

/// After a change of the neighbourhood, repair stays busy for this long.
const UNREST: Duration = Duration::from_secs(5);

/// The partners of repair, and the time of the next one's turn.
#[derive(Clone, Debug)]
pub(super) struct Partners {
    neighbours: BTreeSet<RobotId>,
    next: Duration,
    busy_until: Duration,
    /// Whom this robot turned to last.
    last: Option<RobotId>,
}

impl Partners {
    pub fn new(first: Duration) -> Self {
        Self { neighbours: BTreeSet::new(), next: first, busy_until: Duration::ZERO, last: None }
    }

    pub fn neighbours(&self) -> &BTreeSet<RobotId> {
        &self.neighbours
    }

    /// Takes the place of the old neighbourhood; gives those who are new in it.
    pub fn change(&mut self, robots: BTreeSet<RobotId>) -> Vec<RobotId> {
        let new = robots.difference(&self.neighbours).copied().collect();
        self.neighbours = robots;
        new
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
