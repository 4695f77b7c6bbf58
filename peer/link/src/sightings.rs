//! Where each robot may be reached, as the answers to calls said. Anybody may answer, in anybody's name: so several places are kept for each
//! robot, and those that were in vain are tried last. Pure: time is an argument.

use std::collections::BTreeMap;
use std::time::Duration;

use gestalt_protocol::{MAX_ROBOTS, RobotId};
use zenoh::session::ZenohId;

/// The most places kept for one robot.
const MAX_PLACES: usize = 8;

/// The most endpoints kept of one place, and the longest, in bytes: a robot has one for each address, and an answer has room for thousands.
const MAX_LOCATORS: usize = 16;
const MAX_LOCATOR: usize = 128;

/// A place that could not be dialled so often in a row is forgotten, unless it is heard of anew.
const MAX_FAILURES: u32 = 3;

/// Answers to one call come within this time.
const TOGETHER: Duration = Duration::from_secs(2);

/// A session, and the endpoints at which it is said to be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) id: ZenohId,
    pub(super) locators: Vec<String>,
}

#[derive(Debug)]
struct Sighting {
    place: Place,
    at: Duration,
    failures: u32,
}

/// Who was heard of, and where.
#[derive(Debug, Default)]
pub(super) struct Sightings(BTreeMap<RobotId, Vec<Sighting>>);

impl Sightings {
    /// A robot is said to be at that place.
    pub(super) fn hear(&mut self, now: Duration, robot: RobotId, mut place: Place) {
        // They are dialled one after the other, a second each.
        place.locators.retain(|locator| locator.len() <= MAX_LOCATOR);
        place.locators.truncate(MAX_LOCATORS);
        if self.0.len() >= MAX_ROBOTS && !self.0.contains_key(&robot) {
            return;
        }
        let known = self.0.entry(robot).or_default();
        if let Some(sighting) = known.iter_mut().find(|sighting| sighting.place == place) {
            sighting.at = now;
            return;
        }
        if known.len() >= MAX_PLACES {
            // One that was tried in vain makes room; others stay, or whoever says most would be alone.
            let worst =
                (0..known.len()).max_by_key(|k| known[*k].failures).filter(|k| known[*k].failures > 0);
            let Some(worst) = worst else { return };
            known.remove(worst);
        }
        known.push(Sighting { place, at: now, failures: 0 });
    }

    /// When each robot was heard of last.
    pub(super) fn heard(&self) -> BTreeMap<RobotId, Duration> {
        let last = |places: &Vec<Sighting>| places.iter().map(|sighting| sighting.at).max();
        self.0.iter().filter_map(|(robot, places)| Some((*robot, last(places)?))).collect()
    }

    /// Where to try next to reach a robot: of the places that failed least, the one that was heard of first; one that was not heard of when others
    /// were comes after those, for a robot that starts anew is elsewhere.
    pub(super) fn next(&self, robot: RobotId) -> Option<Place> {
        let places = self.0.get(&robot)?;
        let last = places.iter().map(|sighting| sighting.at).max()?;
        let rank = |sighting: &&Sighting| (sighting.failures, sighting.at + TOGETHER < last);
        places.iter().min_by_key(rank).map(|sighting| sighting.place.clone())
    }

    /// A place was dialled.
    pub(super) fn dialled(&mut self, robot: RobotId, place: &Place, stands: bool) {
        let Some(places) = self.0.get_mut(&robot) else { return };
        if let Some(sighting) = places.iter_mut().find(|sighting| sighting.place == *place) {
            sighting.failures = if stands { 0 } else { sighting.failures + 1 };
        }
        places.retain(|sighting| sighting.failures < MAX_FAILURES);
        if places.is_empty() {
            self.0.remove(&robot);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROBOT: RobotId = RobotId(7);

    fn place(id: u8, port: u16) -> Place {
        Place { id: format!("{id}1").parse().unwrap(), locators: vec![format!("tls/10.0.0.7:{port}")] }
    }

    fn second(n: u64) -> Duration {
        Duration::from_secs(n)
    }

    #[test]
    fn the_true_place_is_tried_though_false_ones_are_said_after_it() {
        let mut sightings = Sightings::default();
        sightings.hear(second(1), ROBOT, place(1, 1));
        for n in 0..100 {
            // The true one is heard of each time, and so are false ones, always others.
            let mut tried = Vec::new();
            for attempt in 0..4 {
                sightings.hear(second(n), ROBOT, place(1, 7447));
                sightings.hear(second(n), ROBOT, place(1, 1000 + (4 * n + attempt) as u16));
                let next = sightings.next(ROBOT).unwrap();
                tried.push(next == place(1, 7447));
                sightings.dialled(ROBOT, &next, false);
            }
            if n == 0 {
                assert_eq!(tried[..2], [false, true]);
            }
        }
        assert!(sightings.0[&ROBOT].len() <= MAX_PLACES);
    }

    #[test]
    fn who_names_thousands_of_endpoints_is_dialled_at_a_few() {
        let mut sightings = Sightings::default();
        let many = (0..4000).map(|port| format!("tls/10.0.0.7:{port}"));
        let locators = std::iter::once("x".repeat(60_000)).chain(many).collect();
        sightings.hear(second(1), ROBOT, Place { locators, ..place(1, 1) });
        let kept = sightings.next(ROBOT).unwrap().locators;
        assert_eq!((kept.len(), kept[0].as_str()), (MAX_LOCATORS, "tls/10.0.0.7:0"));
    }

    #[test]
    fn places_that_never_answer_are_forgotten_and_with_the_last_the_robot() {
        let mut sightings = Sightings::default();
        sightings.hear(second(1), ROBOT, place(1, 1));
        sightings.hear(second(2), ROBOT, place(2, 2));
        assert_eq!(sightings.heard(), [(ROBOT, second(2))].into());
        let mut tried = Vec::new();
        while let Some(next) = sightings.next(ROBOT) {
            sightings.dialled(ROBOT, &next, false);
            tried.push(next);
        }
        let in_turn: Vec<Place> = (0..3).flat_map(|_| [place(1, 1), place(2, 2)]).collect();
        assert_eq!(tried, in_turn);
        assert!(sightings.heard().is_empty());
        // Heard anew, it begins anew; and what stands is not counted against it.
        sightings.hear(second(3), ROBOT, place(1, 1));
        for _ in 0..9 {
            sightings.dialled(ROBOT, &place(1, 1), false);
            sightings.dialled(ROBOT, &place(1, 1), true);
        }
        assert_eq!(sightings.next(ROBOT), Some(place(1, 1)));
    }

    #[test]
    fn a_robot_that_starts_anew_is_looked_for_where_it_is_now() {
        let mut sightings = Sightings::default();
        sightings.hear(second(1), ROBOT, place(1, 1));
        sightings.hear(second(9), ROBOT, place(2, 2));
        assert_eq!(sightings.next(ROBOT), Some(place(2, 2)));
    }

    #[test]
    fn robots_and_places_are_bounded() {
        let mut sightings = Sightings::default();
        for n in 0..5000 {
            sightings.hear(second(1), RobotId(n), place(1, 1));
            sightings.hear(second(1), ROBOT, place(2, n as u16));
        }
        assert_eq!(sightings.0.len(), MAX_ROBOTS);
        assert_eq!(sightings.0[&ROBOT].len(), MAX_PLACES);
    }
}
