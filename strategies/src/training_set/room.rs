//! Room for what was seen of one life of a robot more than is kept track of.

use std::collections::BTreeMap;

use gestalt_protocol::{RoundId, SampleId, SampleSeries};

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

    /// Where a series is one too many, forgets another, and what is held of it: of its author's lives the oldest; or, for a robot that is alive, of those
    /// that are not the one of which the least is held.
    pub(super) fn make_room(&mut self, series: SampleSeries) -> Vec<SetChange> {
        if !self.seen.intervals(series).is_empty() {
            return Vec::new();
        }
        let goes = if self.is_one_life_too_many(series) {
            self.lives.first_to_go(series.author, self.series, &self.seen).map(|(_, oldest)| oldest)
        } else if self.is_full_for(series) {
            self.least_of_those_gone()
        } else {
            None
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

    /// Of the series of robots that are not there, the one of which the least is held.
    fn least_of_those_gone(&self) -> Option<SampleSeries> {
        let stays = |robot| robot == self.me() || self.shares.is_alive(robot);
        let may_go = self.seen.series().filter(|series| !stays(series.author));
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
        let oldest = || self.lives.first_to_go(id.author, self.series, &self.seen);
        if self.is_one_life_too_many(series)
            && oldest().is_some_and(|oldest| (round.counter, series) < oldest)
        {
            return Err(SeenError::TooManyLives(id));
        }
        Ok(())
    }
}
