//! Room for what was seen of one life of a robot more than is kept track of.

use std::collections::BTreeMap;

use gestalt_protocol::{RobotId, RoundId, SampleId, SampleSeries};

use super::{SetChange, TrainingSet};
use crate::sample::{MAX_LIVES, MAX_SERIES, SeenError};

impl TrainingSet {
    /// Whether there is no room for that series, which is new. A place is kept for this robot's own.
    fn is_full_for(&self, series: SampleSeries) -> bool {
        let spoke = series == self.series || !self.seen.intervals(self.series).is_empty();
        self.seen.series_count() >= MAX_SERIES - usize::from(!spoke)
    }

    /// Whether that series, which is new, is one life of its robot too many.
    fn is_one_life_too_many(&self, series: SampleSeries) -> bool {
        self.seen.lives(series.author).count() >= MAX_LIVES
    }

    /// Where a series is one too many, forgets another, and what is held of it: of its author's lives the oldest, where these are too many; else of those of
    /// robots that are not there the one of which the least is held; where all are there, the oldest of the robot that has most.
    pub(super) fn make_room(&mut self, series: SampleSeries) -> Vec<SetChange> {
        if !self.seen.intervals(series).is_empty() {
            return Vec::new();
        }
        let goes = match self.gives_up_one_for(series) {
            Some(author) => self.lives.first_to_go(author, self.series, &self.seen).map(|(_, oldest)| oldest),
            None if self.is_full_for(series) => self.least_of_those_gone(),
            None => None,
        };
        let Some(goes) = goes else { return Vec::new() };
        let of_it = |id: SampleId| id.series() == goes;
        let keys: Vec<u64> =
            self.samples.iter().filter(|it| it.id.is_some_and(of_it)).map(|it| it.key).collect();
        self.seen.forget(goes);
        self.lives.forget(goes);
        let gone = keys.into_iter().filter_map(|key| self.remove(key)).map(SetChange::Removed);
        gone.chain([SetChange::Seen(goes)]).collect()
    }

    /// The robot that gives up a life for that series, which is new; `None` where there is room, or some of whom lives were seen are not there.
    fn gives_up_one_for(&self, series: SampleSeries) -> Option<RobotId> {
        if self.is_one_life_too_many(series) {
            return Some(series.author);
        }
        let is_crowded = self.is_full_for(series) && self.seen.series().all(|other| self.stays(other));
        is_crowded.then(|| self.robot_of_most_lives(series)).flatten()
    }

    /// Of all robots the one of most lives, that series among them, and of equals the one of the greatest number; nobody's only life goes. As the life that goes
    /// stands behind more others than any that stays, whatever else is heard, all robots come to keep the same in whichever order they hear.
    fn robot_of_most_lives(&self, new: SampleSeries) -> Option<RobotId> {
        let mut lives: BTreeMap<RobotId, usize> = BTreeMap::new();
        for series in self.seen.series().chain([new]) {
            *lives.entry(series.author).or_default() += 1;
        }
        let most = lives.into_iter().map(|(robot, lives)| (lives, robot)).max();
        most.filter(|(lives, _)| *lives > 1).map(|(_, robot)| robot)
    }

    /// Whether that series is of a robot that is there.
    fn stays(&self, series: SampleSeries) -> bool {
        series.author == self.me() || self.shares.is_alive(series.author)
    }

    /// Of the series of robots that are not there, the one of which the least is held.
    fn least_of_those_gone(&self) -> Option<SampleSeries> {
        let may_go = self.seen.series().filter(|series| !self.stays(*series));
        let mut held: BTreeMap<SampleSeries, usize> = may_go.map(|series| (series, 0)).collect();
        for sample in self.samples.iter() {
            if let Some(held) = sample.id.and_then(|id| held.get_mut(&id.series())) {
                *held += 1;
            }
        }
        held.into_iter().min_by_key(|(_, held)| *held).map(|(least, _)| least)
    }

    /// Whether a sample of that round may be taken in.
    pub(super) fn may_receive(&self, id: SampleId, round: RoundId) -> Result<(), SeenError> {
        let series = id.series();
        // Whoever could speak under the name of this very life could keep this robot from sharing.
        if series == self.series && id.number >= self.next_number() {
            return Err(SeenError::NeverShared(id));
        }
        if !self.seen.intervals(series).is_empty() {
            return Ok(());
        }
        // So could the names of strangers.
        if self.is_full_for(series) && !self.shares.is_alive(id.author) {
            return Err(SeenError::TooManyAuthors(id));
        }
        // For what is refused all the same no room is made.
        if let Err(error @ (SeenError::Zero(_) | SeenError::FarAhead(_))) = self.seen.would_accept(id) {
            return Err(error);
        }
        // What would be the first to go is not taken in: it would come again and again.
        if self.gives_up_one_for(series) == Some(id.author)
            && let Some(oldest) = self.lives.first_to_go(id.author, self.series, &self.seen)
            && (round.counter, series) < oldest
        {
            let is_of_its_author = self.is_one_life_too_many(series);
            return Err(if is_of_its_author {
                SeenError::TooManyLives(id)
            } else {
                SeenError::TooManyAuthors(id)
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use gestalt_protocol::ClassId;
    use rand::seq::SliceRandom;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::forgetting::ForgettingRule;
    use crate::sample::SeenSamples;
    use crate::selection::SelectionRule;
    use crate::training_set::SampleReceipt;

    const ME: RobotId = RobotId(0);

    /// This robot in that life, where it and so many others are alive.
    fn robot(life: u32, others: u32) -> TrainingSet {
        let (selection, forgetting) = (SelectionRule::Random.build(), ForgettingRule::Fifo.build());
        let mut robot = TrainingSet::new(ME, 10_000, selection, forgetting).in_life(life);
        robot.meet(Arc::new((0..=others).map(RobotId).collect()));
        robot
    }

    fn receive(
        robot: &mut TrainingSet,
        author: u32,
        life: u32,
        counter: u32,
        rng: &mut dyn Rng,
    ) -> SampleReceipt {
        let id = SampleSeries { author: RobotId(author), life }.sample(1);
        let round = RoundId { counter, opener: RobotId(author), life };
        robot.receive(id, ClassId(0), round, vec![1.0], rng)
    }

    fn shares(robot: &mut TrainingSet, rng: &mut dyn Rng) -> bool {
        let round = RoundId { counter: 1000, opener: ME, life: 1 };
        robot.keep(ClassId(0), round, vec![1.0], rng);
        let changes = robot.share(1, None, &|vector| vector.to_vec(), rng);
        matches!(changes.last(), Some(SetChange::Shared(..)))
    }

    #[test]
    fn where_all_are_there_and_started_often_each_new_life_is_heard_and_shares() {
        let rng = &mut ChaCha8Rng::seed_from_u64(1);
        let mut before = robot(1, 128);
        assert!(shares(&mut before, rng));
        for life in 1..=32 {
            for author in 1..=128 {
                let receipt = receive(&mut before, author, life, life, rng);
                assert!(matches!(receipt, SampleReceipt::New(_)), "life {life} of {author}: {receipt:?}");
            }
        }
        assert_eq!(before.seen().series_count(), MAX_SERIES);
        let receipt = receive(&mut before, 5, 33, 33, rng);
        assert!(matches!(receipt, SampleReceipt::New(_)), "{receipt:?}");
        assert_eq!(before.seen().lives(RobotId(5)).count(), 32);
        let old = receive(&mut before, 5, 1, 1, rng);
        assert!(matches!(old, SampleReceipt::Refused(SeenError::TooManyAuthors(_))), "not again: {old:?}");
        // It starts again.
        let mut after = robot(2, 128);
        after.restore(before.iter().cloned().collect(), before.seen().clone(), before.next_key()).unwrap();
        assert!(shares(&mut after, rng));
        assert_eq!(after.seen().series_count(), MAX_SERIES);
    }

    #[test]
    fn where_all_are_there_robots_come_to_keep_the_same_lives_in_whichever_order_they_hear_of_them() {
        let rng = &mut ChaCha8Rng::seed_from_u64(2);
        // Some started more often than others; twenty of them once.
        let lives = |author: u32| if author > 100 { 1 } else { 20 + author % 60 };
        let mut all: Vec<(u32, u32)> =
            (1..=120).flat_map(|author| (1..=lives(author)).map(move |life| (author, life))).collect();
        assert!(all.len() > MAX_SERIES + 500);
        let kept: Vec<SeenSamples> = (0..3)
            .map(|_| {
                all.shuffle(rng);
                let mut robot = robot(1, 120);
                assert!(shares(&mut robot, rng));
                for (author, life) in &all {
                    receive(&mut robot, *author, *life, *life, rng);
                }
                robot.seen().clone()
            })
            .collect();
        assert_eq!(kept[0].series_count(), MAX_SERIES);
        assert!(kept[0] == kept[1] && kept[1] == kept[2]);
        assert!((1..=120).all(|author| kept[0].lives(RobotId(author)).next().is_some()));
    }
}
