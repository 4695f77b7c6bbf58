//! What was settled with each neighbour, so that two robots that cannot come to know the same stop telling each other.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use gestalt_protocol::{Digest, Lesson, RobotId, RoundId, SampleId};

use crate::lessons::LessonBook;
use crate::sample::SeenSamples;

/// The most neighbours of whom something is kept; of the others everything is offered again.
const MAX_NEIGHBOURS: usize = 64;

/// The most rounds of which a neighbour's lessons are kept as declined; those beyond are offered again.
const MAX_DECLINED_ROUNDS: usize = 64;

/// How often a neighbour is given all names for one difference of what both know: a message may be lost, and what is refused stays refused.
const NAMES_GIVEN: u32 = 8;

/// The same of samples: of many lives of one robot two robots may keep others for good.
const SAMPLES_GIVEN: u32 = 16;

/// The same of lessons, however many turns it takes to give all that it lacks: what it refuses, beyond the rounds that it says to have declined, stays refused.
const LESSONS_GIVEN: u32 = 16;

/// And again after so many more questions: links may lose many messages in a row, and come to themselves.
const GIVEN_AGAIN: u32 = 256;

/// How many messages a neighbour is told at once at most, of 16 KiB at most. A question of 40 bytes in its name brings no
/// more upon it.
const REPLIES_AT_ONCE: f64 = 128.0;

/// How many more each second.
const REPLIES_PER_SECOND: f64 = 16.0;

/// What was settled with one neighbour. It binds nobody else: what this neighbour has no more use in offering is still
/// taken from another, so a neighbour that lies deprives this robot of nothing but its own help.
#[derive(Clone, Debug, Default)]
struct Exchange {
    /// This robot's digest and the neighbour's, for which the neighbour said that it had nothing to give.
    at_rest: Option<(Digest, Digest)>,
    /// What it offered and this robot cannot take: within the bounds of [`SeenSamples`].
    declined: SeenSamples,
    /// The lessons it offered, some of which this robot cannot take: at most [`MAX_DECLINED_ROUNDS`] rounds.
    declined_lessons: LessonBook,
    /// How often it asked for all names.
    names: Given,
    /// The same of the samples that it lacks.
    samples: Given,
    /// The same of the lessons, and the last round of those given, where there was no room for all: the next turn begins behind it.
    lessons: Given,
    lessons_up_to: Option<RoundId>,
    /// The messages it was told, less those that time has made up for, and when that was reckoned.
    told: f64,
    told_at: Duration,
}

/// For which digests, this robot's and a neighbour's, that asked for something, and how often.
#[derive(Clone, Copy, Debug, Default)]
struct Given(Option<((u64, u64), u32)>);

impl Given {
    /// Whether it is to be given something for these, which it may be so often.
    fn may(&mut self, digests: (u64, u64), so_often: u32) -> bool {
        let asked = self.0.filter(|(of, _)| *of == digests).map_or(0, |(_, asked)| asked);
        self.0 = Some((digests, asked.saturating_add(1)));
        asked < so_often || asked.is_multiple_of(GIVEN_AGAIN)
    }
}

/// What was settled with the neighbours: at most [`MAX_NEIGHBOURS`].
#[derive(Clone, Debug, Default)]
pub(super) struct Exchanges(BTreeMap<RobotId, Exchange>);

impl Exchanges {
    /// Whether that neighbour said that it had nothing to give, when both knew what they know now.
    pub fn is_at_rest(&self, robot: RobotId, mine: Digest, theirs: Digest) -> bool {
        self.0.get(&robot).is_some_and(|exchange| exchange.at_rest == Some((mine, theirs)))
    }

    pub fn rest(&mut self, robot: RobotId, mine: Digest, theirs: Digest) {
        self.with(robot).at_rest = Some((mine, theirs));
    }

    /// What this robot tells that neighbour to have: what it has seen, and what it cannot take.
    pub fn told_to(&self, robot: RobotId, seen: &SeenSamples) -> SeenSamples {
        let mut told = seen.clone();
        if let Some(exchange) = self.0.get(&robot) {
            told.extend(&exchange.declined);
        }
        told
    }

    /// A sample that neighbour offered cannot be taken.
    pub fn decline(&mut self, robot: RobotId, sample: SampleId) {
        self.with(robot).declined.note(sample);
    }

    /// These robots are alive now and were not before: there may be room for their samples.
    pub fn readmit(&mut self, robots: &BTreeSet<RobotId>) {
        for exchange in self.0.values_mut() {
            let series = exchange.declined.series().filter(|series| robots.contains(&series.author));
            for series in series.collect::<Vec<_>>() {
                exchange.declined.forget(series);
                exchange.at_rest = None;
            }
        }
    }

    /// Some of these lessons of one round, all that neighbour has, cannot be taken.
    pub fn decline_lessons<'a>(&mut self, robot: RobotId, of_round: impl Iterator<Item = &'a Lesson>) {
        let declined = &mut self.with(robot).declined_lessons;
        for (place, lesson) in of_round.enumerate() {
            if place == 0 {
                declined.forget(lesson.round);
            }
            declined.hear_again(lesson);
        }
        while declined.len() > MAX_DECLINED_ROUNDS {
            declined.forget_oldest();
        }
    }

    /// The rounds of which this robot cannot take what that neighbour says, each with the digest of that
    /// under a key.
    pub fn declined_rounds(&self, robot: RobotId, key: u64) -> BTreeMap<RoundId, u64> {
        let declined = self.0.get(&robot).map(|exchange| exchange.declined_lessons.rounds(key).collect());
        declined.unwrap_or_default()
    }

    /// Whether that neighbour is to be given all names, where the digests of both are these.
    pub fn may_give_names(&mut self, robot: RobotId, digests: (u64, u64)) -> bool {
        self.with(robot).names.may(digests, NAMES_GIVEN)
    }

    /// Whether that neighbour is to be given the samples that it lacks, where the digests of both are these.
    pub fn may_give_samples(&mut self, robot: RobotId, digests: (u64, u64)) -> bool {
        self.with(robot).samples.may(digests, SAMPLES_GIVEN)
    }

    /// Of these rounds, in order, whose lessons that neighbour lacks, those that it is to be given next, where the digests of both are these: each in its
    /// turn, whatever became of the others.
    pub fn turn_of_lessons(
        &mut self,
        robot: RobotId,
        digests: (u64, u64),
        mut lacking: Vec<RoundId>,
    ) -> Vec<RoundId> {
        let exchange = self.with(robot);
        let given = exchange.lessons_up_to.take();
        let given = given.map_or(0, |last| lacking.partition_point(|round| *round <= last));
        if (1..lacking.len()).contains(&given) {
            return lacking.split_off(given);
        }
        if !lacking.is_empty() && !exchange.lessons.may(digests, LESSONS_GIVEN) {
            lacking.clear();
        }
        lacking
    }

    /// The last round of those that it was given, where there was no room for all.
    pub fn end_turn_of_lessons(&mut self, robot: RobotId, last: Option<RoundId>) {
        self.with(robot).lessons_up_to = last;
    }

    /// How many messages that neighbour may be told now.
    pub fn allowance(&mut self, now: Duration, robot: RobotId) -> usize {
        let exchange = self.with(robot);
        let passed = now.saturating_sub(exchange.told_at).as_secs_f64();
        exchange.told = (exchange.told - passed * REPLIES_PER_SECOND).max(0.0);
        exchange.told_at = now;
        (REPLIES_AT_ONCE - exchange.told).max(0.0) as usize
    }

    /// That neighbour is told so many.
    pub fn spend(&mut self, robot: RobotId, messages: usize) {
        self.with(robot).told += messages as f64;
    }

    /// Lessons that lay too far ahead may do so no longer. Says whether any were declined.
    pub fn forget_declined_lessons(&mut self) -> bool {
        let mut some = false;
        for exchange in self.0.values_mut().filter(|exchange| !exchange.declined_lessons.is_empty()) {
            (exchange.declined_lessons, exchange.at_rest) = (LessonBook::default(), None);
            some = true;
        }
        some
    }

    /// Only these are neighbours now. One that comes back begins anew.
    pub fn keep(&mut self, is_neighbour: impl Fn(RobotId) -> bool) {
        self.0.retain(|robot, _| is_neighbour(*robot));
    }

    fn with(&mut self, robot: RobotId) -> &mut Exchange {
        if !self.0.contains_key(&robot) && self.0.len() >= MAX_NEIGHBOURS {
            self.0.pop_first();
        }
        self.0.entry(robot).or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_declined_of_a_robot_is_asked_for_again_when_it_is_there() {
        let id = |author| SampleId { author: RobotId(author), life: 1, number: 1 };
        let (neighbour, digest) = (RobotId(1), Digest::default());
        let mut exchanges = Exchanges::default();
        exchanges.decline(neighbour, id(5));
        exchanges.decline(neighbour, id(6));
        exchanges.rest(neighbour, digest, digest);
        exchanges.readmit(&[RobotId(7)].into());
        assert!(exchanges.is_at_rest(neighbour, digest, digest), "of that one nothing was");
        exchanges.readmit(&[RobotId(5)].into());
        assert!(!exchanges.is_at_rest(neighbour, digest, digest));
        let told = exchanges.told_to(neighbour, &SeenSamples::default());
        assert!(!told.contains(id(5)) && told.contains(id(6)));
    }

    #[test]
    fn who_asks_for_the_same_again_and_again_is_given_it_a_few_times_and_then_rarely() {
        let mut exchanges = Exchanges::default();
        let mut given = |digests| {
            let asked = (0..10_000).map(|_| exchanges.may_give_samples(RobotId(1), digests));
            asked.enumerate().filter(|(_, may)| *may).map(|(nth, _)| nth as u32).collect::<Vec<_>>()
        };
        let first = given((1, 2));
        assert!((0..SAMPLES_GIVEN).eq(first.iter().copied().take(SAMPLES_GIVEN as usize)));
        assert_eq!(first.len(), SAMPLES_GIVEN as usize + 39, "links that lost all of it come to themselves");
        assert_eq!(given((1, 3)), first, "what is known has changed");
    }

    #[test]
    fn of_ever_so_many_neighbours_something_is_kept_of_so_many() {
        let mut exchanges = Exchanges::default();
        for robot in 0..1000 {
            exchanges.decline(RobotId(robot), SampleId { author: RobotId(5), life: 1, number: 1 });
        }
        assert_eq!(exchanges.0.len(), MAX_NEIGHBOURS);
        exchanges.keep(|robot| robot == RobotId(999));
        assert_eq!(exchanges.0.len(), 1);
    }
}
