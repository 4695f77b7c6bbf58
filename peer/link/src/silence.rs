//! Which robots were heard of late, and which say nothing any more though Zenoh has it that they are there.

use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};

use gestalt_protocol::RobotId;

/// What was said before somebody was lost comes so much later at most.
const ON_THE_WAY: Duration = Duration::from_secs(1);

/// When robots that are alive said something last, and who of those that Zenoh says are alive does not answer.
///
/// The news that a robot is dead can be lost in Zenoh for good, at one router and so at all that hang on it, and its token is then
/// found by every query. Only the robot itself can tell: by anything that it says, or by an answer.
#[derive(Debug, Default)]
pub(super) struct Silence {
    heard: BTreeMap<RobotId, Instant>,
    gone: BTreeSet<RobotId>,
    /// When anybody said something to all, and when somebody or a link was lost last.
    spoken: Option<Instant>,
    lost: Option<Instant>,
}

impl Silence {
    /// Somebody said something to all.
    pub fn spoken(&mut self, now: Instant) {
        self.spoken = Some(now);
    }

    /// Somebody went, or a link: others may have gone with it.
    pub fn lost(&mut self, now: Instant) {
        self.lost = Some(now);
    }

    /// A robot that is alive, or was thought to be gone, was heard of; whether it was thought to be gone.
    pub fn heard(&mut self, robot: RobotId, now: Instant, alive: &BTreeSet<RobotId>) -> bool {
        if self.gone.contains(&robot) || alive.contains(&robot) {
            self.heard.insert(robot, now);
        }
        self.gone.remove(&robot)
    }

    /// A robot's token came or went, as Zenoh tells.
    pub fn changed(&mut self, robot: RobotId) {
        self.heard.remove(&robot);
        self.gone.remove(&robot);
    }

    /// Whether it does not answer, whatever Zenoh says.
    pub fn is_gone(&self, robot: RobotId) -> bool {
        self.gone.contains(&robot)
    }

    /// A robot does not answer.
    pub fn give_up(&mut self, robot: RobotId) {
        self.gone.insert(robot);
    }

    /// Whether it was heard of since.
    pub fn was_heard(&self, robot: RobotId, since: Instant) -> bool {
        self.heard.get(&robot).is_some_and(|heard| *heard >= since)
    }

    /// Who is to be asked whether it is there: who does not answer; where somebody was lost since, all that were not heard of after that; else,
    /// where somebody spoke within a span, who was not heard of for two. What is known of others than those alive is forgotten.
    pub fn suspects(
        &mut self,
        alive: &BTreeSet<RobotId>,
        now: Instant,
        since: Instant,
        span: Duration,
    ) -> BTreeSet<RobotId> {
        self.heard.retain(|robot, _| alive.contains(robot));
        let ago = |at: &Instant| now.saturating_duration_since(*at);
        let mut suspects = self.gone.clone();
        if let Some(lost) = self.lost.filter(|lost| *lost >= since) {
            suspects.extend(alive.iter().filter(|robot| !self.was_heard(**robot, lost + ON_THE_WAY)));
        } else if self.spoken.is_some_and(|spoken| ago(&spoken) <= span) {
            let silent = self.heard.iter().filter(|(_, heard)| ago(heard) > 2 * span);
            suspects.extend(silent.map(|(robot, _)| *robot));
        }
        suspects
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPAN: Duration = Duration::from_secs(60);
    const ROBOTS: [RobotId; 3] = [RobotId(1), RobotId(2), RobotId(3)];

    #[test]
    fn who_is_gone_comes_back_by_anything_it_says_and_by_a_new_token() {
        let (mut silence, mut alive, now) = (Silence::default(), BTreeSet::from(ROBOTS), Instant::now());
        assert!(!silence.heard(ROBOTS[0], now, &alive));
        // Who has no token is not remembered: in an open swarm anybody may say something, under any name.
        assert!(!silence.heard(RobotId(9), now, &alive));
        assert_eq!(silence.heard.len(), 1);
        for gone in &ROBOTS[1..] {
            silence.give_up(*gone);
            alive.remove(gone);
        }
        assert!(silence.heard(ROBOTS[1], now, &alive) && !silence.is_gone(ROBOTS[1]));
        assert!(silence.is_gone(ROBOTS[2]));
        silence.changed(ROBOTS[2]);
        assert!(!silence.is_gone(ROBOTS[2]));
    }

    #[test]
    fn who_said_nothing_since_somebody_was_lost_is_asked() {
        let (mut silence, alive, began) = (Silence::default(), BTreeSet::from(ROBOTS), Instant::now());
        let now = began + Duration::from_secs(9);
        silence.heard(ROBOTS[0], began, &alive);
        silence.heard(ROBOTS[1], now, &alive);
        let mut suspects = |since| silence.suspects(&alive, now, since, SPAN);
        assert!(suspects(began).is_empty(), "nobody was lost");
        silence.lost(began + Duration::from_secs(1));
        assert_eq!(silence.suspects(&alive, now, began, SPAN), [ROBOTS[0], ROBOTS[2]].into());
        silence.give_up(ROBOTS[2]);
        assert_eq!(silence.suspects(&alive, now, now, SPAN), [ROBOTS[2]].into(), "and again, who is gone");
    }

    #[test]
    fn who_falls_silent_while_others_speak_is_asked_and_nobody_while_all_are_silent() {
        let (mut silence, alive, began) = (Silence::default(), BTreeSet::from(ROBOTS), Instant::now());
        for robot in &ROBOTS[..2] {
            silence.heard(*robot, began, &alive);
        }
        let now = began + 2 * SPAN + Duration::from_secs(1);
        assert!(silence.suspects(&alive, now, now, SPAN).is_empty());
        silence.spoken(now);
        silence.heard(ROBOTS[0], now, &alive);
        // The third never said anything: perhaps it sees no hand.
        assert_eq!(silence.suspects(&alive, now, now, SPAN), [ROBOTS[1]].into());
    }
}
