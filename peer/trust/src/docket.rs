//! Against whom there is evidence, and who is still to hear of it.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use gestalt_protocol::RobotId;

use crate::evidence::{Conviction, Evidence, Lie};

/// The most bytes of evidence that are kept for those who come later. Who lied beyond that is convicted all the same.
pub(crate) const KEPT_BYTES: usize = 16 * 1024 * 1024;

/// All of it is told again this often at most, whoever comes and goes.
const AGAIN: Duration = Duration::from_secs(5);

/// Who found something says it again so often at least, and twice as often each time before: it may have been lost, or come while false evidence
/// had used up what its hearers look at.
const SELDOM: Duration = Duration::from_secs(5 * 60);

/// When something is told again, and how long after that.
#[derive(Clone, Copy, Debug)]
struct Reminder {
    due: Duration,
    pause: Duration,
}

impl Reminder {
    fn after(now: Duration, pause: Duration) -> Self {
        Self { due: now + pause, pause }
    }

    /// Also where the clock was set back: nobody waits until it has caught up.
    fn is_due(&self, now: Duration) -> bool {
        now >= self.due || now + self.pause < self.due
    }
}

/// The evidence that convicted somebody.
#[derive(Clone, Debug, Default)]
pub(crate) struct Docket {
    kept: BTreeMap<RobotId, Evidence>,
    /// Not handed out yet, to be kept on disk.
    unkept: BTreeSet<RobotId>,
    /// Found here, and told to nobody yet.
    untold: BTreeSet<RobotId>,
    /// Found here, and told.
    reminders: BTreeMap<RobotId, Reminder>,
    /// Whether somebody is here who was not, and when that was last seen to.
    again: bool,
    told: Option<Duration>,
    /// Convicted since it was last asked who was.
    fallen: Vec<(RobotId, Lie)>,
}

impl Docket {
    /// Takes in what convicted that robot; `found`: here, so that others are to be told.
    pub fn enter(&mut self, Conviction { robot, lie, .. }: Conviction, evidence: Evidence, found: bool) {
        self.fallen.push((robot, lie));
        let bytes: usize = self.kept.values().map(Evidence::length).sum();
        if bytes + evidence.length() <= KEPT_BYTES {
            self.kept.insert(robot, evidence);
            self.unkept.insert(robot);
            if found {
                self.untold.insert(robot);
            }
        }
    }

    /// Forgets whoever is not kept.
    pub fn retain(&mut self, keeps: impl Fn(RobotId) -> bool) {
        self.kept.retain(|robot, _| keeps(*robot));
        self.unkept.retain(|robot| keeps(*robot));
        self.untold.retain(|robot| keeps(*robot));
        self.reminders.retain(|robot, _| keeps(*robot));
        self.fallen.retain(|(robot, _)| keeps(*robot));
    }

    /// What is to be told to all now.
    pub fn untold(&mut self, now: Duration) -> Vec<(RobotId, Evidence)> {
        let mut untold = std::mem::take(&mut self.untold);
        self.reminders.extend(untold.iter().map(|robot| (*robot, Reminder::after(now, AGAIN))));
        for (robot, reminder) in self.reminders.iter_mut().filter(|(_, reminder)| reminder.is_due(now)) {
            *reminder = Reminder::after(now, SELDOM.min(2 * reminder.pause));
            untold.insert(*robot);
        }
        if self.again && self.told.is_none_or(|told| now.saturating_sub(told) >= AGAIN || now < told) {
            (self.again, self.told) = (false, Some(now));
            untold.extend(self.kept.keys());
        }
        self.of(untold)
    }

    /// What came in since this was last asked.
    pub fn unkept(&mut self) -> Vec<(RobotId, Evidence)> {
        let unkept = std::mem::take(&mut self.unkept);
        self.of(unkept)
    }

    fn of(&self, robots: BTreeSet<RobotId>) -> Vec<(RobotId, Evidence)> {
        robots.into_iter().filter_map(|robot| Some((robot, self.kept.get(&robot)?.clone()))).collect()
    }

    /// Somebody is here who was not.
    pub fn tell_again(&mut self) {
        self.again = !self.kept.is_empty();
    }

    /// Who was convicted since this was last asked, and of what.
    pub fn fallen(&mut self) -> Vec<(RobotId, Lie)> {
        std::mem::take(&mut self.fallen)
    }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::{Signature, Stamp};

    use super::*;
    use crate::signed::MAX_SIGNED;
    use crate::testing::robot;

    /// Enters evidence of that length against that robot.
    fn enter(docket: &mut Docket, against: u32, length: usize, found: bool) {
        let (robot, key, lie) = (RobotId(against), robot(against).public_key(), Lie::Unfounded);
        let conviction = Conviction { robot, key, stamp: Stamp { boot: 1, sequence: 1 }, lie };
        let evidence = Evidence::of_decision(vec![0; length], Signature::from_bytes([0; 64]));
        docket.enter(conviction, evidence, found);
    }

    fn robots(evidence: Vec<(RobotId, Evidence)>) -> Vec<u32> {
        evidence.into_iter().map(|(robot, _)| robot.0).collect()
    }

    const NOW: Duration = Duration::from_secs(1000);

    #[test]
    fn what_was_found_is_told_and_all_again_to_those_who_come() {
        let mut docket = Docket::default();
        docket.tell_again();
        assert_eq!(robots(docket.untold(NOW)), [0; 0], "nothing is known");
        enter(&mut docket, 1, 10, true);
        enter(&mut docket, 2, 10, false);
        assert_eq!(docket.fallen(), [(RobotId(1), Lie::Unfounded), (RobotId(2), Lie::Unfounded)]);
        assert_eq!(docket.fallen(), []);
        assert_eq!(robots(docket.unkept()), [1, 2]);
        assert_eq!(robots(docket.unkept()), [0; 0]);
        assert_eq!(robots(docket.untold(NOW)), [1], "the other was told of");
        let soon = NOW + AGAIN - Duration::from_millis(1);
        assert_eq!(robots(docket.untold(soon)), [0; 0], "nobody came");
        docket.tell_again();
        assert_eq!(robots(docket.untold(NOW)), [1, 2]);
        docket.tell_again();
        assert_eq!(robots(docket.untold(soon)), [0; 0], "not twice at once");
        enter(&mut docket, 3, 10, true);
        assert_eq!(robots(docket.untold(soon)), [3], "news need not wait");
        assert_eq!(robots(docket.untold(NOW + AGAIN)), [1, 2, 3]);
        // A clock that was set back makes nobody wait until it has caught up.
        docket.tell_again();
        assert_eq!(robots(docket.untold(NOW - SELDOM)), [1, 2, 3]);
    }

    #[test]
    fn who_found_something_says_it_again_ever_more_seldom_until_the_liar_is_gone() {
        let mut docket = Docket::default();
        enter(&mut docket, 1, 10, true);
        enter(&mut docket, 2, 10, false);
        let told = |docket: &mut Docket, seconds: std::ops::Range<u64>| -> Vec<u64> {
            seconds
                .filter(|second| robots(docket.untold(NOW + Duration::from_secs(*second))) == [1])
                .collect()
        };
        assert_eq!(told(&mut docket, 0..1500), [0, 5, 15, 35, 75, 155, 315, 615, 915, 1215]);
        // Nor does a clock that was set back keep it from being said.
        assert_eq!(told(&mut docket, 10..20), [10]);
        docket.retain(|robot| robot != RobotId(1));
        assert_eq!(told(&mut docket, 2000..3000), [0; 0]);
    }

    #[test]
    fn who_has_another_key_is_forgotten() {
        let mut docket = Docket::default();
        enter(&mut docket, 1, 10, true);
        enter(&mut docket, 2, 10, true);
        docket.retain(|robot| robot == RobotId(2));
        assert_eq!(docket.fallen(), [(RobotId(2), Lie::Unfounded)]);
        assert_eq!((robots(docket.unkept()), robots(docket.untold(NOW))), (vec![2], vec![2]));
        docket.retain(|_| false);
        docket.tell_again();
        assert_eq!(robots(docket.untold(NOW)), [0; 0]);
    }

    #[test]
    fn the_longest_evidence_against_thirty_two_robots_is_kept() {
        let mut docket = Docket::default();
        (0..32).for_each(|against| enter(&mut docket, against, MAX_SIGNED, false));
        assert_eq!(docket.unkept().len(), 32);
    }

    #[test]
    fn evidence_is_kept_up_to_a_bound_and_convicts_beyond_it() {
        let mut docket = Docket::default();
        let quarter = KEPT_BYTES / 4;
        for against in 1..=3 {
            enter(&mut docket, against, quarter, true);
        }
        enter(&mut docket, 4, quarter + 1, true);
        enter(&mut docket, 5, quarter, true);
        enter(&mut docket, 6, 1, true);
        assert_eq!(docket.fallen().len(), 6);
        assert_eq!(robots(docket.unkept()), [1, 2, 3, 5], "what fits exactly fits, one byte more does not");
        assert_eq!(robots(docket.untold(NOW)), [1, 2, 3, 5]);
    }
}
