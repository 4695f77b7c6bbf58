//! Which of an author's lives is its oldest, for all robots alike.

use std::collections::BTreeMap;

use gestalt_protocol::{RobotId, SampleSeries};

use crate::sample::{HeldSamples, SeenSamples};

/// How new each life of a robot is of which a sample was seen: the greatest count of a round that any of these was of. Of robots that lived once it is not kept,
/// for most do; what is known of the first life, and of all after a restart, is what is held of it then.
///
/// It does not fall when samples are forgotten, and what was of an older life than all that are kept is not taken in again: so of ever so many lives all robots come
/// to keep the same, and then none gives another what that has let go of.
#[derive(Clone, Debug, Default)]
pub(super) struct Lives(BTreeMap<SampleSeries, u32>);

impl Lives {
    /// Those of which a sample was seen.
    pub fn of(seen: &SeenSamples, held: &HeldSamples) -> Self {
        let mut lives = Self::default();
        for series in seen.series() {
            if seen.lives(series.author).nth(1).is_some() {
                lives.0.insert(series, 0);
            }
        }
        lives.raise_to(held);
        lives
    }

    /// A sample of a round of that count was seen in that life.
    pub fn note(&mut self, series: SampleSeries, counter: u32, seen: &SeenSamples, held: &HeldSamples) {
        if let Some(newest) = self.0.get_mut(&series) {
            *newest = counter.max(*newest);
            return;
        }
        let mut others = seen.lives(series.author).filter(|life| *life != series).peekable();
        if others.peek().is_none() {
            return;
        }
        let untold: Vec<SampleSeries> = others.filter(|life| !self.0.contains_key(life)).collect();
        self.0.insert(series, counter);
        if !untold.is_empty() {
            self.0.extend(untold.into_iter().map(|life| (life, 0)));
            self.raise_to(held);
        }
    }

    fn raise_to(&mut self, held: &HeldSamples) {
        for sample in held.iter() {
            if let Some(newest) = sample.id.and_then(|id| self.0.get_mut(&id.series())) {
                *newest = sample.round.counter.max(*newest);
            }
        }
    }

    pub fn forget(&mut self, series: SampleSeries) {
        self.0.remove(&series);
    }

    /// The life of that robot that goes first, but for one that stays: that of the lowest count, of equals the one of the smaller number.
    pub fn first_to_go(
        &self,
        author: RobotId,
        stays: SampleSeries,
        seen: &SeenSamples,
    ) -> Option<(u32, SampleSeries)> {
        let lives = seen.lives(author).filter(|life| *life != stays);
        lives.map(|life| (self.0.get(&life).copied().unwrap_or_default(), life)).min()
    }
}
