//! Who votes in a large swarm: a committee, drawn anew for each round.
//!
//! All votes go to all robots, so what a robot does and passes on in a round would grow with their number. But what a thousand robots say
//! of one hand is not worth more than what some seventy say: they err together, and n voices of likeness ρ are worth n / (1 + (n − 1) ρ)
//! independent ones, which 72 bring to 99 % of all there is to be had at a likeness of .5, and to 89 % at .1. And 72 drawn by lot are like the
//! swarm: where a third of it fails, or errs, that is half of a committee once in 400 rounds; where a quarter does, once in 200,000.
//!
//! Only speaking is limited. Whoever is not drawn hears the votes, concludes from them as all do, and holds the decision; a vote of a robot
//! that was not drawn is evidence like any other. But for the quorum count those alone who were drawn, so that it goes on meaning something:
//! two majorities of one committee have a robot in common, and an honest one, for f liars are taken to be in it all at once.

use std::collections::BTreeSet;

use gestalt_protocol::RobotId;

use crate::config::RoundsConfig;
use crate::lot::{Lottery, lot};
use crate::quorum::Quorum;

impl RoundsConfig {
    /// How many of so many robots vote in a round; `None` where all do: up to one and a half times as many, so that robots that do not agree on
    /// which of both it is can still decide on each other's votes. With each liar to be withstood it has four more, and where a number of
    /// robots is to have given evidence, twice that number: half of them may have seen nothing.
    #[must_use]
    pub fn committee_of(&self, robots: u32) -> Option<u32> {
        let size = self.committee_size();
        self.all_vote_up_to().filter(|most| robots > *most).map(|_| size)
    }

    /// Who votes in the round of that counter, of these robots; `None` where all do.
    #[must_use]
    pub fn draw(&self, counter: u32, robots: &BTreeSet<RobotId>) -> Option<BTreeSet<RobotId>> {
        let count = u32::try_from(robots.len()).unwrap_or(u32::MAX);
        self.committee_of(count).map(|size| draw(counter, size, count, robots.iter().copied()))
    }

    /// The most robots of which all vote; `None` where all do, however many there are.
    pub(crate) fn all_vote_up_to(&self) -> Option<u32> {
        let size = self.committee_size();
        (self.committee > 0).then_some(size.saturating_add(size / 2))
    }

    fn committee_size(&self) -> u32 {
        let least = match self.quorum {
            Quorum::Majority => self.committee,
            Quorum::Evidence(quorum) => self.committee.max(quorum.saturating_mul(2)),
        };
        least.saturating_add(self.liars.saturating_mul(4))
    }

    /// Whether a robot's vote in the round of that counter counts for the quorum of so many robots: it was drawn, or may have been by robots that
    /// know of half as many. Whoever knows all of them by name knows better.
    #[must_use]
    pub fn may_be_drawn(&self, counter: u32, robot: RobotId, robots: u32) -> bool {
        self.committee_of(robots)
            .is_none_or(|size| lot(Lottery::Committee, counter, robot) < bound(size, robots))
    }

    /// Whether these are enough to decide the round of that counter, see [`suffice`](Self::suffice): of the robots that take part, and of those
    /// that gave evidence, those who may have been drawn.
    #[must_use]
    pub fn suffice_of(
        &self,
        counter: u32,
        reached: impl Iterator<Item = RobotId>,
        contributors: impl Iterator<Item = RobotId>,
        robots: u32,
    ) -> bool {
        let counts = |robot: &RobotId| self.may_be_drawn(counter, *robot, robots);
        self.suffice(reached.filter(counts).count(), contributors.filter(counts).count(), robots)
    }
}

/// Below which lie about twice as many lots of so many robots as are drawn.
fn bound(size: u32, robots: u32) -> u64 {
    u64::try_from((u128::from(size) << 65) / u128::from(robots.max(1))).unwrap_or(u64::MAX)
}

/// Those with the smallest lots: so many of these robots, or all.
pub(crate) fn draw(
    counter: u32,
    size: u32,
    count: u32,
    robots: impl Iterator<Item = RobotId> + Clone,
) -> BTreeSet<RobotId> {
    let with_lot = |robot| (lot(Lottery::Committee, counter, robot), robot);
    let bound = bound(size, count);
    let size = size as usize;
    let mut drawn: Vec<(u64, RobotId)> =
        robots.clone().map(with_lot).filter(|(lot, _)| *lot < bound).collect();
    if drawn.len() < size {
        drawn = robots.map(with_lot).collect();
    }
    if drawn.len() > size {
        drawn.select_nth_unstable(size);
        drawn.truncate(size);
    }
    drawn.into_iter().map(|(_, robot)| robot).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robots(n: u32) -> impl Iterator<Item = RobotId> + Clone {
        (1..=n).map(RobotId)
    }

    #[test]
    fn up_to_a_hundred_all_vote_and_of_more_than_that_so_many() {
        let config = RoundsConfig::default();
        assert_eq!(
            [1, 100, 108, 109, 10_000].map(|n| config.committee_of(n)),
            [None, None, None, Some(72), Some(72)]
        );
        assert_eq!([100, 108, 109, 10_000].map(|n| config.needs(n)), [51, 55, 37, 37]);
        let off = RoundsConfig { committee: 0, ..RoundsConfig::default() };
        assert_eq!((off.committee_of(10_000), off.needs(10_000)), (None, 5001));
        let evidence = RoundsConfig { quorum: Quorum::Evidence(50), ..RoundsConfig::default() };
        assert_eq!((evidence.committee_of(1000), evidence.needs(1000)), (Some(100), 50));
    }

    #[test]
    fn whichever_robots_lie_two_majorities_of_a_committee_have_an_honest_one_in_common() {
        for liars in 0..20 {
            let config = RoundsConfig { liars, ..RoundsConfig::default() };
            let (size, needs) = (config.committee_of(10_000).unwrap(), config.needs(10_000));
            // None of the liars was drawn, and all speak: of the honest each majority has these.
            assert!(2 * (needs - liars) > size, "{liars} liars");
            assert!(needs <= size - liars, "the honest can decide, {liars} liars");
        }
    }

    #[test]
    fn all_who_know_the_same_robots_draw_the_same_and_each_is_drawn_in_some_rounds() {
        let mut times = vec![0; 1001];
        for counter in 1..=200 {
            let drawn = draw(counter, 72, 1000, robots(1000));
            assert_eq!(drawn.len(), 72);
            let config = RoundsConfig::default();
            assert!(drawn.iter().all(|robot| config.may_be_drawn(counter, *robot, 1000)));
            drawn.iter().for_each(|robot| times[robot.0 as usize] += 1);
        }
        // A binomial of mean 14.4 and standard deviation 3.7.
        assert!(times[1..].iter().all(|n| (1..=32).contains(n)), "{:?}", times.iter().max());
    }

    #[test]
    fn who_knows_a_few_robots_more_or_less_draws_nearly_the_same() {
        for counter in 1..=50 {
            let (some, more) = (draw(counter, 72, 950, robots(950)), draw(counter, 72, 1000, robots(1000)));
            // Of the fifty that one does not know 3.6 are drawn on average, in place of as many.
            assert!(some.intersection(&more).count() >= 60, "round {counter}");
            assert!(some.iter().all(|robot| RoundsConfig::default().may_be_drawn(counter, *robot, 1000)));
        }
    }
}
