//! With whom, and when next, a robot compares what each has.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use gestalt_protocol::{Rank, RobotId, RoundId};

use crate::others::Others;

/// After a change of the neighbourhood, repair stays busy for this long.
const UNREST: Duration = Duration::from_secs(5);

/// For so long after the two have met, whoever is told what a neighbour has says what it has itself: each so learns that the other
/// hears it. The first words may be lost, before the network knows the way.
const MEETING: Duration = Duration::from_secs(10);

/// Later it does when the neighbour was told nothing for so many idle periods, as happens to those of a robot with many.
const SILENT_PERIODS: u32 = 6;

/// So often a neighbour is given what it lacks by the same comparison before the pauses between grow: what is lost comes again, and who does
/// not take it, for it knows more robots that a majority would need, or the round by another name, is reminded seldom.
const AT_ONCE: u32 = 4;

/// So often two that differ in the same way hurry to compare again. What they tell each other may be lost, a third of it many times over;
/// who still differs then cannot or will not take what it lacks.
const HURRIED: u32 = 16;

/// The longest such pause, in idle periods.
const LONGEST: u32 = 32;

/// What a neighbour brought is told to so many others soon: to all of a line, a ring or a grid. In a dense swarm the others hear it from them, and in
/// their turn.
const TOLD_SOON: usize = 4;

/// They are told after this part of the busy period: what a neighbour gives comes in several messages.
const SOON: u32 = 4;

/// The partners of repair, and the time of the next one's turn.
#[derive(Clone, Debug)]
pub(super) struct Partners {
    neighbours: BTreeMap<RobotId, Partner>,
    next: Duration,
    busy_until: Duration,
    /// Whom this robot turned to last.
    last: Option<RobotId>,
    /// Whom it turns to before all others: there is news for them.
    soon: BTreeSet<RobotId>,
}

/// What a robot has of the newest round: its decision, and the digest of its words on who holds what.
pub(super) type Possession = (Option<Rank>, u16);

/// That of a robot's newest round.
pub(super) type Standing = (Option<RoundId>, Possession);

#[derive(Clone, Debug)]
struct Given {
    compared: [Possession; 2],
    times: u32,
    /// When it may be again.
    due: Duration,
}

#[derive(Clone, Debug, Default)]
struct Partner {
    /// Since when it is a neighbour.
    since: Duration,
    /// When it was last told what this robot has.
    told: Duration,
    /// When it was last to be told soon what another neighbour had brought.
    hurried: Option<Duration>,
    /// By what comparison it was last given something.
    given: Option<Given>,
    /// In what the two differed last, and how often they were found to.
    differed: Option<([Standing; 2], u32)>,
}

impl Partners {
    pub fn new(first: Duration) -> Self {
        Self {
            neighbours: BTreeMap::new(),
            next: first,
            busy_until: Duration::ZERO,
            last: None,
            soon: BTreeSet::new(),
        }
    }

    pub fn neighbours(&self) -> impl ExactSizeIterator<Item = RobotId> {
        self.neighbours.keys().copied()
    }

    pub fn is_neighbour(&self, robot: RobotId) -> bool {
        self.neighbours.contains_key(&robot)
    }

    /// Takes the place of the old neighbourhood; gives those who are new in it.
    pub fn change(&mut self, now: Duration, robots: &BTreeSet<RobotId>) -> Vec<RobotId> {
        self.neighbours.retain(|robot, _| robots.contains(robot));
        let new: Vec<RobotId> = robots.iter().copied().filter(|robot| !self.is_neighbour(*robot)).collect();
        let met = Partner { since: now, told: now, ..Partner::default() };
        self.neighbours.extend(new.iter().map(|robot| (*robot, met.clone())));
        new
    }

    /// A robot is told what this one has.
    pub fn tell(&mut self, now: Duration, robot: RobotId) {
        if let Some(partner) = self.neighbours.get_mut(&robot) {
            partner.told = now;
        }
    }

    /// Whether a neighbour that says what it has is to hear from this robot, whatever either lacks.
    pub fn owes(&self, now: Duration, robot: RobotId, idle: Duration) -> bool {
        self.neighbours.get(&robot).is_some_and(|Partner { since, told, .. }| {
            now < *since + MEETING || now >= told.saturating_add(idle.saturating_mul(SILENT_PERIODS))
        })
    }

    /// Whether it is time to give something to a robot by what it has and what this robot has; counts that it is given.
    pub fn give(&mut self, now: Duration, robot: RobotId, compared: [Possession; 2], idle: Duration) -> bool {
        let Some(partner) = self.neighbours.get_mut(&robot) else { return true };
        let given = &mut partner.given;
        if given.as_ref().is_none_or(|given| given.compared != compared) {
            *given = Some(Given { compared, times: 0, due: now });
        }
        let Some(given) = given.as_mut().filter(|given| now >= given.due) else { return false };
        given.times = given.times.saturating_add(1);
        let doubled = 1_u32.checked_shl(given.times.saturating_sub(AT_ONCE)).unwrap_or(LONGEST);
        let pause =
            if given.times < AT_ONCE { Duration::ZERO } else { idle.saturating_mul(doubled.min(LONGEST)) };
        given.due = now.saturating_add(pause);
        true
    }

    /// Whether to compare again soon with a robot that has something that this one lacks, or lacks what this one has.
    pub fn hurries(&mut self, robot: RobotId, compared: [Standing; 2]) -> bool {
        let Some(partner) = self.neighbours.get_mut(&robot) else { return false };
        let times = match partner.differed {
            Some((before, times)) if before == compared => times.saturating_add(1),
            _ => 1,
        };
        partner.differed = Some((compared, times));
        times <= HURRIED
    }

    /// When the next repair is due; never for a robot that knows of no other.
    pub fn due(&self, alive: &Others) -> Option<Duration> {
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

    /// A neighbour brought news: tells others soon, each once in a busy period, and keeps to that pace for a while.
    pub fn pass_on(&mut self, now: Duration, from: RobotId, busy: Duration) {
        self.stay_busy(now, busy);
        let is_first = |robot: &RobotId| Some(*robot) > self.last;
        let (mut others, rest): (Vec<RobotId>, Vec<RobotId>) = self.neighbours().partition(is_first);
        others.extend(rest);
        others.retain(|robot| *robot != from);
        for robot in others.into_iter().take(TOLD_SOON) {
            let Some(partner) = self.neighbours.get_mut(&robot) else { continue };
            if partner.hurried.is_none_or(|hurried| now >= hurried.saturating_add(busy)) {
                partner.hurried = Some(now);
                self.soon.insert(robot);
            }
        }
        if !self.soon.is_empty() {
            self.hurry(now, busy / SOON);
        }
    }

    /// Whether it is somebody's turn. The next turn is after `busy`, or after `idle` when all has been quiet for long.
    pub fn is_due(&mut self, now: Duration, open: bool, (busy, idle): (Duration, Duration)) -> bool {
        if now < self.next {
            return false;
        }
        let pace = if open || now < self.busy_until { busy } else { idle };
        self.next = now + if self.soon.len() > 1 { busy / SOON } else { pace };
        true
    }

    /// Whom to turn to: those for whom there is news, then the neighbours in turn, or, where none is known, all the living in turn.
    pub fn turn(&mut self, alive: &Others) -> Option<RobotId> {
        while let Some(robot) = self.soon.pop_first() {
            if self.is_neighbour(robot) {
                return Some(robot);
            }
        }
        let after = |robot: &RobotId| Some(*robot) > self.last;
        let next = if self.neighbours.is_empty() {
            alive.iter().find(after).or(alive.iter().next())
        } else {
            self.neighbours().find(after).or(self.neighbours().next())
        };
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
        partners.change(at(1), &[robot].into());
        assert!(partners.owes(at(10), robot, IDLE), "they have just met");
        partners.tell(at(12), robot);
        assert!(!partners.owes(at(35), robot, IDLE));
        assert!(partners.owes(at(36), robot, IDLE), "it was told nothing for six periods");
        partners.tell(at(36), robot);
        assert!(!partners.owes(at(37), robot, IDLE));
        partners.change(at(40), &BTreeSet::new());
        partners.change(at(41), &[robot].into());
        assert!(partners.owes(at(42), robot, IDLE), "they have met again");
    }

    #[test]
    fn what_a_neighbour_brought_is_told_to_some_others_soon_and_to_nobody_twice_at_once() {
        let busy = Duration::from_millis(500);
        let ms = |ms| at(100) + Duration::from_millis(ms);
        let mut partners = Partners::new(at(1));
        partners.change(at(1), &[RobotId(1), RobotId(2)].into());
        let turn = |partners: &mut Partners, now| {
            if !partners.is_due(now, false, (busy, IDLE)) {
                return None;
            }
            let robot = partners.turn(&Others::new(RobotId(0), Default::default()))?;
            partners.tell(now, robot);
            Some(robot.0)
        };
        assert_eq!(turn(&mut partners, ms(0)), Some(1));
        // Robot 1 is told nothing that it brought itself, and its turn comes when it would have.
        partners.pass_on(ms(10), RobotId(1), busy);
        assert_eq!([120, 140].map(|at| turn(&mut partners, ms(at))), [None, Some(2)]);
        // More of it: who was told a moment ago is told in its turn.
        partners.pass_on(ms(150), RobotId(1), busy);
        assert_eq!([600, 640, 1140].map(|at| turn(&mut partners, ms(at))), [None, Some(2), Some(1)]);

        let mut partners = Partners::new(at(1));
        partners.change(at(1), &(0..100).map(RobotId).collect());
        partners.pass_on(ms(0), RobotId(2), busy);
        let told: Vec<u32> = (0..9).filter_map(|n| turn(&mut partners, ms(125 * n + 125))).collect();
        assert_eq!(told, [0, 1, 3, 4, 0], "four soon, then all in their turn");
        // Who has left is not waited for.
        partners.pass_on(ms(9000), RobotId(2), busy);
        partners.change(ms(9001), &[RobotId(7)].into());
        assert_eq!(turn(&mut partners, ms(9200)), Some(7));
    }

    #[test]
    fn two_that_differ_hurry_but_not_for_ever() {
        let robot = RobotId(3);
        let mut partners = Partners::new(at(0));
        let standing = |holders| (None, (None, holders));
        assert!(!partners.hurries(robot, [standing(1), standing(2)]), "it is no neighbour");
        partners.change(at(1), &[robot].into());
        let hurried = (0..99).filter(|_| partners.hurries(robot, [standing(1), standing(2)])).count();
        assert_eq!(hurried, 16);
        assert!(partners.hurries(robot, [standing(1), standing(3)]), "something has changed");
    }

    #[test]
    fn who_does_not_take_what_it_lacks_is_left_alone_until_something_changes() {
        let robot = RobotId(3);
        let mut partners = Partners::new(at(0));
        partners.change(at(1), &[robot].into());
        let mut given = |seconds: std::ops::Range<u64>, theirs, own| -> Vec<u64> {
            let due = |second: &u64| partners.give(at(*second), robot, [(None, theirs), (None, own)], IDLE);
            seconds.filter(due).collect()
        };
        assert_eq!(
            given(2..400, 1, 2),
            [2, 3, 4, 5, 9, 17, 33, 65, 129, 257, 385],
            "pauses grow, and do not without end"
        );
        assert_eq!(given(400..410, 1, 3), [400, 401, 402, 403, 407], "something has changed here");
        assert_eq!(given(410..420, 4, 3), [410, 411, 412, 413, 417], "and there");
    }
}
