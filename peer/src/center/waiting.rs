//! Who waits at the door before it is served. Every centre hears the cameras of the whole swarm, and of two that admit one at the same moment neither
//! sees the other do it; so each lets it wait for as long as is its own turn, and who comes later finds that robot alive already.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use gestalt_protocol::RobotId;

/// How far turns lie apart: longer than news of a robot goes through a swarm.
const APART: Duration = Duration::from_millis(200);

/// How many turns there are. Centres whose numbers differ by a multiple of it share one.
const TURNS: u32 = 8;

/// How long a centre of that number lets a robot wait.
pub(super) fn turn(centre: RobotId) -> Duration {
    APART * (centre.0 % TURNS)
}

/// The robots that wait, each with its newest frame. Pure: time is an argument.
#[derive(Debug)]
pub(super) struct Waiting<F> {
    turn: Duration,
    most: usize,
    robots: BTreeMap<RobotId, (Instant, F)>,
}

impl<F> Waiting<F> {
    /// Room for that many, of whom each waits that long.
    pub fn new(turn: Duration, most: usize) -> Self {
        Self { turn, most, robots: BTreeMap::new() }
    }

    /// Takes a robot's frame; the robot waits on from its first. `false` when there is no room for it.
    pub fn come(&mut self, robot: RobotId, frame: F, now: Instant) -> bool {
        if let Some((_, newest)) = self.robots.get_mut(&robot) {
            *newest = frame;
            return true;
        }
        if self.robots.len() >= self.most {
            return false;
        }
        self.robots.insert(robot, (now + self.turn, frame));
        true
    }

    /// When the next one has waited for long enough.
    pub fn due(&self) -> Option<Instant> {
        self.robots.values().map(|(due, _)| *due).min()
    }

    /// The frame of one that has waited for long enough, of those of whoever came first.
    pub fn next(&mut self, now: Instant) -> Option<F> {
        let due = self.robots.iter().filter(|(_, (due, _))| *due <= now);
        let robot = due.min_by_key(|(_, (due, _))| *due).map(|(robot, _)| *robot)?;
        self.robots.remove(&robot).map(|(_, frame)| frame)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn of_two_centres_that_hear_a_camera_at_once_the_later_finds_it_alive() {
        let heard = Instant::now();
        for centres in [[100, 101], [7, 8], [0, 3]] {
            let mut doors = centres.map(|centre| (centre, Waiting::new(turn(RobotId(centre)), 64)));
            doors.iter_mut().for_each(|(_, door)| assert!(door.come(RobotId(2), (), heard)));
            // Each admits it when its turn comes, unless it is alive; which is known a tenth of a second later everywhere.
            let news = Duration::from_millis(100);
            doors.sort_by_key(|(_, door)| door.due());
            let (mut alive, mut admitted) = (None, Vec::new());
            for (centre, door) in &mut doors {
                let now = door.due().unwrap();
                assert_eq!(door.next(now), Some(()));
                if alive.is_none_or(|since: Instant| now < since + news) {
                    (alive, _) = (Some(now), admitted.push(*centre));
                }
            }
            assert_eq!(admitted.len(), 1, "{centres:?}");
        }
    }

    #[test]
    fn a_robot_waits_from_its_first_frame_with_its_newest_and_room_is_bounded() {
        let (mut waiting, start) = (Waiting::new(turn(RobotId(4)), 3), Instant::now());
        let at = |millis| start + Duration::from_millis(millis);
        assert!(waiting.due().is_none());
        assert!(waiting.come(RobotId(9), "first", at(0)) && waiting.come(RobotId(1), "one", at(10)));
        assert!(waiting.come(RobotId(9), "newest", at(700)) && waiting.come(RobotId(2), "two", at(700)));
        assert!(!waiting.come(RobotId(3), "three", at(700)), "no room");
        assert_eq!((waiting.due(), waiting.next(at(799))), (Some(at(800)), None));
        assert_eq!(
            [waiting.next(at(900)), waiting.next(at(900)), waiting.next(at(900))],
            [Some("newest"), Some("one"), None]
        );
        assert!(waiting.come(RobotId(3), "three", at(900)));
        assert_eq!(waiting.due(), Some(at(1500)));
    }

    #[test]
    fn the_first_turn_is_at_once_and_the_last_within_a_second_and_a_half() {
        let turns: BTreeSet<Duration> = (0..100).map(|centre| turn(RobotId(centre))).collect();
        assert_eq!(turns.len(), 8);
        assert_eq!(turns.first(), Some(&Duration::ZERO));
        assert!(turns.last() < Some(&Duration::from_millis(1500)));
    }
}
