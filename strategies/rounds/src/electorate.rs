//! Of whom the majority is: the robots heard lately.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use gestalt_protocol::{MAX_ROBOTS, RobotId};

use crate::others::Others;

/// Who counts as one of the swarm, whether or not it can be reached now.
///
/// A robot that voted counts for a while after its last vote, and after it was last alive, however long nothing was shown before that: a part of the swarm
/// that is cut off remembers how many there are elsewhere. So does one that has not voted yet, where names cost a key, or if it told this one what it has.
/// One that is said to be alive and was not heard lately, or never, counts until a whole round has passed in which it said nothing: names without robots
/// keep nobody from deciding for long.
#[derive(Clone, Debug, Default)]
pub(crate) struct Electorate {
    /// When each other robot last voted. At most [`MAX_ROBOTS`].
    heard: BTreeMap<RobotId, Duration>,
    /// Alive and not heard lately, by now.
    unheard: BTreeMap<RobotId, Unheard>,
    /// Alive through a whole round, and never heard.
    silent: BTreeSet<RobotId>,
    /// Alive, and met as robots: they told this one what they have. They count as if they had voted once they are gone.
    met: BTreeSet<RobotId>,
    /// Of the swarm no more, though they may still be said to be alive for a moment. Who votes is one of the swarm again.
    expelled: BTreeSet<RobotId>,
    /// Whether nobody is alive without a key, so that each name has its robot.
    keyed: bool,
    /// Heard, or alive, and not alive now: since when. At most [`MAX_ROBOTS`].
    gone: BTreeMap<RobotId, Duration>,
    /// How many other robots are alive.
    alive: usize,
    /// Of more robots than this only some are asked to vote in a round: then silence says nothing of most, and whoever is alive counts, or was
    /// lately. `None`: all are asked, however many.
    most_asked: Option<u32>,
    /// Whether there were more at last.
    large: bool,
}

#[derive(Clone, Copy, Debug)]
struct Unheard {
    /// Since when it is waited for.
    since: Duration,
    /// Whether it was heard before.
    voted: bool,
}

impl Electorate {
    /// Of which all are asked to vote where there are no more than so many.
    pub fn new(most_asked: Option<u32>) -> Self {
        Self { most_asked, ..Self::default() }
    }

    /// From now on whoever is alive has a key.
    pub fn require_keys(&mut self) {
        self.keyed = true;
    }

    /// A robot that is alive told this one what it has.
    pub fn meet(&mut self, robot: RobotId) {
        if self.met.len() < MAX_ROBOTS {
            self.met.insert(robot);
        }
    }

    /// A robot voted, or was there until now and is known to be one.
    pub fn hear(&mut self, robot: RobotId, now: Duration) {
        self.unheard.remove(&robot);
        self.silent.remove(&robot);
        self.expelled.remove(&robot);
        if self.heard.len() < MAX_ROBOTS || self.heard.contains_key(&robot) {
            self.heard.insert(robot, now);
        }
    }

    /// A robot voted that is not said to be alive.
    pub fn hear_absent(&mut self, robot: RobotId, now: Duration) {
        if self.gone.len() < MAX_ROBOTS || self.gone.contains_key(&robot) {
            self.gone.insert(robot, now);
        }
    }

    /// Those were alive, and these are now.
    pub fn change(&mut self, before: &Others, robots: &Others, now: Duration) {
        for robot in before.since(robots) {
            if self.silent.contains(&robot) || self.expelled.contains(&robot) {
                continue;
            }
            if self.gone.len() < MAX_ROBOTS {
                self.gone.insert(robot, now);
            }
            let voted = self.unheard.get(&robot).is_some_and(|unheard| unheard.voted);
            // Else a swarm that is cut before its first round would be two.
            let is_robot = voted || self.keyed || self.met.contains(&robot);
            if is_robot || self.heard.contains_key(&robot) {
                self.hear(robot, now);
            }
        }
        self.gone.retain(|robot, _| !robots.contains(*robot));
        self.alive(robots, now);
    }

    /// These are alive now.
    pub fn alive(&mut self, robots: &Others, now: Duration) {
        self.alive = robots.len();
        self.unheard.retain(|robot, _| robots.contains(*robot));
        self.silent.retain(|robot| robots.contains(*robot));
        self.met.retain(|robot| robots.contains(*robot));
        self.large = self.counted_large().is_some();
        if self.large {
            self.unheard.clear();
            return;
        }
        for robot in robots.iter().take(MAX_ROBOTS) {
            if !self.heard.contains_key(&robot) && !self.silent.contains(&robot) {
                self.unheard.entry(robot).or_insert(Unheard { since: now, voted: false });
            }
        }
    }

    /// These are of the swarm no more.
    pub fn expel(&mut self, robots: &BTreeSet<RobotId>) {
        self.heard.retain(|robot, _| !robots.contains(robot));
        self.unheard.retain(|robot, _| !robots.contains(robot));
        self.silent.retain(|robot| !robots.contains(robot));
        self.met.retain(|robot| !robots.contains(robot));
        self.gone.retain(|robot, _| !robots.contains(robot));
        let room = MAX_ROBOTS.saturating_sub(self.expelled.len());
        self.expelled.extend(robots.iter().take(room));
    }

    /// A round is over that was open since then, for long enough to say something: who was alive all the while and said nothing is a name
    /// without a robot. But whoever heard nobody at all may be deaf, and would be a majority of its own.
    pub fn round_over(&mut self, since: Duration) {
        if self.heard.values().all(|at| *at < since) {
            return;
        }
        let silent: Vec<RobotId> = self
            .unheard
            .iter()
            .filter(|(_, unheard)| unheard.since <= since)
            .map(|(robot, _)| *robot)
            .collect();
        for robot in silent {
            self.unheard.remove(&robot);
            self.silent.insert(robot);
        }
    }

    /// The same of a round in which only these robots were asked, and these alive all the while: none of whom said anything.
    pub fn asked_in_vain(&mut self, robots: impl Iterator<Item = RobotId>) {
        self.silent.extend(robots.filter(|robot| !self.heard.contains_key(robot)));
    }

    /// Those of the living of whom anything is to be expected.
    pub fn expected<'a>(&'a self, alive: &'a Others) -> Expected<'a> {
        Expected::Living { alive, silent: &self.silent }
    }

    /// Those of the living of whom nothing is to be expected.
    pub fn silent(&self) -> &BTreeSet<RobotId> {
        &self.silent
    }

    /// Forgets who was not heard for that long; these are alive, and waited for instead.
    pub fn forget(&mut self, now: Duration, lately: Duration, alive: &Others) {
        let (unheard, large) = (&mut self.unheard, self.large);
        self.heard.retain(|robot, at| {
            let stays = now.saturating_sub(*at) <= lately;
            if !stays && !large && alive.contains(*robot) {
                unheard.insert(*robot, Unheard { since: now, voted: true });
            }
            stays
        });
        self.gone.retain(|_, at| now.saturating_sub(*at) <= lately);
        if self.large && self.counted_large().is_none() {
            // From now on all are asked again.
            self.alive(alive, now);
        }
    }

    /// How many robots there are, this one included.
    pub fn count(&self) -> u32 {
        let small = || u32::try_from(1 + self.heard.len() + self.unheard.len()).unwrap_or(u32::MAX);
        self.counted_large().unwrap_or_else(small)
    }

    /// How many there are, where only some of them are asked: those alive of whom anything is to be expected, and those who were lately.
    fn counted_large(&self) -> Option<u32> {
        let robots = (1 + self.alive + self.gone.len()).saturating_sub(self.silent.len());
        let robots = u32::try_from(robots).unwrap_or(u32::MAX);
        self.most_asked.filter(|most| robots > *most).map(|_| robots)
    }

    /// Whether more than half of the robots are alive, this one included.
    pub fn sees_most(&self) -> bool {
        2 * (1 + self.alive).saturating_sub(self.silent.len()) > self.count() as usize
    }

    /// The other robots, where only some of them are asked.
    pub fn members<'a>(&'a self, alive: &'a Others) -> impl Iterator<Item = RobotId> + Clone + 'a {
        let some_silent = !self.silent.is_empty();
        let speaks = move |robot: &RobotId| !(some_silent && self.silent.contains(robot));
        alive.iter().filter(speaks).chain(self.gone.keys().copied())
    }
}

/// The other robots of whom a vote is to be expected.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Expected<'a> {
    /// Those who were drawn.
    Drawn(&'a BTreeSet<RobotId>),
    /// All who are alive but for those that say nothing, who are among them.
    Living { alive: &'a Others, silent: &'a BTreeSet<RobotId> },
}

impl Expected<'_> {
    pub fn len(self) -> usize {
        match self {
            Self::Drawn(robots) => robots.len(),
            Self::Living { alive, silent } => alive.len().saturating_sub(silent.len()),
        }
    }

    pub fn all(self, holds: impl Fn(RobotId) -> bool) -> bool {
        match self {
            Self::Drawn(robots) => robots.iter().copied().all(holds),
            Self::Living { alive, silent } => alive.iter().filter(|robot| !silent.contains(robot)).all(holds),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    const LATELY: Duration = Duration::from_secs(60);

    fn at(seconds: u64) -> Duration {
        Duration::from_secs(seconds)
    }

    fn robots(ids: impl IntoIterator<Item = u32>) -> Others {
        Others::new(RobotId(0), Arc::new(ids.into_iter().map(RobotId).collect()))
    }

    #[test]
    fn who_was_heard_counts_for_a_while_also_when_it_cannot_be_reached() {
        let mut electorate = Electorate::default();
        electorate.alive(&robots(1..=8), at(0));
        assert_eq!(electorate.count(), 9, "before they had a chance to say anything");
        for robot in 1..=8 {
            electorate.hear(RobotId(robot), at(1));
        }
        electorate.alive(&robots(1..=3), at(2));
        electorate.round_over(at(2));
        electorate.forget(at(61), LATELY, &robots(1..=3));
        assert_eq!(electorate.count(), 9);
        electorate.forget(at(62), LATELY, &robots(1..=3));
        assert_eq!(electorate.count(), 4, "three are there yet");
        electorate.hear(RobotId(9), at(63));
        electorate.round_over(at(62));
        assert_eq!(electorate.count(), 2, "and said nothing, where another one did");
    }

    /// It has just started, and what others say does not reach it.
    #[test]
    fn who_hears_nobody_is_no_majority() {
        let mut electorate = Electorate::default();
        electorate.alive(&robots(1..=4), at(0));
        for round in 1..5 {
            electorate.round_over(at(5 * round));
            assert_eq!(electorate.count(), 5);
        }
        electorate.hear(RobotId(2), at(31));
        electorate.round_over(at(30));
        assert_eq!(electorate.count(), 2, "the others are names");
    }

    /// Nothing was shown for long, and then the swarm was cut: before, or after, a hand is seen.
    #[test]
    fn who_was_there_until_now_counts_however_long_ago_it_voted() {
        for cut_first in [true, false] {
            let mut electorate = Electorate::default();
            let (all, none) = (robots(1..=4), robots([]));
            electorate.alive(&all, at(0));
            (1..=4).for_each(|robot| electorate.hear(RobotId(robot), at(1)));
            if cut_first {
                electorate.change(&all, &none, at(300));
                electorate.forget(at(301), LATELY, &none);
            } else {
                electorate.forget(at(300), LATELY, &all);
                electorate.change(&all, &none, at(301));
            }
            assert_eq!(electorate.count(), 5, "the others are elsewhere, {cut_first}");
            electorate.forget(at(422), LATELY, &none);
            assert_eq!(electorate.count(), 1, "they stayed away");
        }
    }

    /// As liveliness may tell of it late.
    #[test]
    fn who_is_expelled_does_not_count_as_gone_when_it_is_said_to_be_alive_once_more() {
        let mut electorate = Electorate::default();
        electorate.require_keys();
        electorate.expel(&[RobotId(7)].into());
        let count_when_it_goes = |electorate: &mut Electorate| {
            electorate.change(&robots([]), &robots([7]), at(1));
            electorate.change(&robots([7]), &robots([]), at(2));
            electorate.count()
        };
        assert_eq!(count_when_it_goes(&mut electorate), 1);
        // It was given another key.
        electorate.hear(RobotId(7), at(2));
        assert_eq!(count_when_it_goes(&mut electorate), 2);
    }

    /// As when the swarm is cut before anything was shown, or some started again since.
    #[test]
    fn who_is_known_to_be_a_robot_counts_when_it_is_gone_also_if_it_never_voted() {
        for (keyed, expected) in [(true, 101), (false, 3)] {
            let mut electorate = Electorate::default();
            if keyed {
                electorate.require_keys();
            }
            electorate.alive(&robots(1..=100), at(0));
            electorate.meet(RobotId(1));
            electorate.meet(RobotId(2));
            electorate.change(&robots(1..=100), &robots([]), at(1));
            assert_eq!(electorate.count(), expected, "{keyed}");
            electorate.forget(at(62), LATELY, &robots([]));
            assert_eq!(electorate.count(), 1, "they stayed away");
        }
    }

    #[test]
    fn a_name_that_came_and_went_and_never_voted_counts_no_more() {
        let mut electorate = Electorate::default();
        electorate.alive(&robots(1..=100), at(0));
        electorate.change(&robots(1..=100), &robots([]), at(1));
        assert_eq!(electorate.count(), 1);
    }

    #[test]
    fn a_name_without_a_robot_counts_for_one_round() {
        let mut electorate = Electorate::default();
        let expects = |electorate: &Electorate, robot| {
            let alive = robots(1..=3);
            !electorate.expected(&alive).all(|expected| expected != RobotId(robot))
        };
        electorate.alive(&robots(1..=2), at(0));
        electorate.hear(RobotId(1), at(1));
        electorate.round_over(at(0));
        assert_eq!((electorate.count(), expects(&electorate, 2)), (2, false));
        // It came in the midst of a round.
        electorate.alive(&robots(1..=3), at(3));
        electorate.round_over(at(2));
        assert_eq!((electorate.count(), expects(&electorate, 3)), (3, true));
        electorate.hear(RobotId(2), at(5));
        assert!(expects(&electorate, 2), "it was slow");
        assert_eq!(electorate.count(), 4);
    }

    #[test]
    fn no_number_of_names_makes_it_grow_without_bound() {
        let mut electorate = Electorate::default();
        for robot in 0..2 * MAX_ROBOTS as u32 {
            electorate.hear(RobotId(robot), at(0));
        }
        electorate.alive(&robots(10_000..20_000), at(0));
        assert!(electorate.count() as usize <= 1 + 2 * MAX_ROBOTS);
    }
}
