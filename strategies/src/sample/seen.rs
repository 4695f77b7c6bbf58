//! Which samples a robot ever had, so that none is taken twice.

use std::collections::BTreeMap;
use std::hash::Hasher;

use gestalt_protocol::{RobotId, SampleId, SampleSeries};
use siphasher::sip::SipHasher24;
use smallvec::SmallVec;
use thiserror::Error;

/// Series that are kept track of: lives of authors.
pub const MAX_SERIES: usize = 4096;
/// Lives of one author that are kept track of.
pub const MAX_LIVES: usize = 64;
/// Intervals of numbers kept per series. Beyond, the lowest gap counts as seen: what is missing there was lost long ago, or
/// forgotten by whoever could give it.
pub const MAX_GAPS: usize = 256;
/// Intervals kept of all series together, so that a list of them always fits in a message.
pub const MAX_INTERVALS_IN_ALL: usize = 16_384;
/// How far a number may lie beyond the highest one seen of its series, once it is beyond [`LAST_NUMBER`].
const FAR_AHEAD: u32 = 1_000_000;
/// Up to here any number may be the first that is heard of. The last ones are for who came there in sequence.
pub const LAST_NUMBER: u32 = u32::MAX - FAR_AHEAD;

/// An identifier that cannot be remembered. What was seen is unchanged.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum SeenError {
    /// Authors number their samples from 1.
    #[error("sample {0}: numbers count from 1")]
    Zero(SampleId),
    /// Samples of as many series as can be kept track of were seen already.
    #[error(
        "sample {0}: samples of {MAX_SERIES} other lives of robots were seen, which is the most that is kept"
    )]
    TooManyAuthors(SampleId),
    /// Samples of as many lives of its author as can be kept track of were seen already.
    #[error(
        "sample {0}: samples of {MAX_LIVES} other lives of its author were seen, which is the most that is kept"
    )]
    TooManyLives(SampleId),
    /// A sample of this very life of this robot, which never shared it.
    #[error("sample {0}: this robot never shared it")]
    NeverShared(SampleId),
    /// More intervals are claimed of one series, or of all together, than are kept.
    #[error("sample {0}: more than {MAX_GAPS} intervals of numbers, or {MAX_INTERVALS_IN_ALL} in all")]
    TooManyGaps(SampleId),
    /// The number lies further ahead than its author can have come.
    #[error("sample {0}: no author can have come so far")]
    FarAhead(SampleId),
    /// Intervals that touch, overlap, run backwards or are out of order.
    #[error("the intervals of {0} are not ascending and apart")]
    Disorder(SampleSeries),
}

/// Of most series nothing is missing.
type Intervals = SmallVec<[(u32, u32); 1]>;

/// A set of sample identifiers: for each series the numbers seen, as intervals. A robot that misses nothing holds one
/// interval for each life in which an author shared something, however long that is; [`MAX_SERIES`], [`MAX_LIVES`],
/// [`MAX_GAPS`] and [`MAX_INTERVALS_IN_ALL`] hold whatever arrives.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SeenSamples {
    series: BTreeMap<SampleSeries, Intervals>,
    /// How many intervals there are in all.
    intervals: usize,
}

impl SeenSamples {
    /// Takes up what was stored: each series with its intervals (inclusive, ascending, neither overlapping nor
    /// touching).
    ///
    /// # Errors
    /// [`SeenError::Disorder`], also for a series that comes twice; [`SeenError::Zero`],
    /// [`SeenError::TooManyAuthors`], [`SeenError::TooManyLives`], [`SeenError::TooManyGaps`].
    pub fn from_intervals(
        all: impl IntoIterator<Item = (SampleSeries, Vec<(u32, u32)>)>,
    ) -> Result<Self, SeenError> {
        let mut seen = Self::default();
        for (series, intervals) in all {
            let Some(&(first, _)) = intervals.first() else { continue };
            let id = series.sample(first);
            if first == 0 {
                return Err(SeenError::Zero(id));
            }
            if intervals.len() > MAX_GAPS || seen.intervals + intervals.len() > MAX_INTERVALS_IN_ALL {
                return Err(SeenError::TooManyGaps(id));
            }
            seen.has_room_for(id)?;
            let forwards = intervals.iter().all(|(from, to)| from <= to);
            // Apart: at least one number is missing between two neighbours.
            let apart = intervals.windows(2).all(|pair| pair[1].0.saturating_sub(pair[0].1) > 1);
            if !(forwards && apart) {
                return Err(SeenError::Disorder(series));
            }
            seen.intervals += intervals.len();
            if seen.series.insert(series, intervals.into()).is_some() {
                return Err(SeenError::Disorder(series));
            }
        }
        Ok(seen)
    }

    /// Whether the sample was seen.
    #[must_use]
    pub fn contains(&self, id: SampleId) -> bool {
        let intervals = self.intervals(id.series());
        let after = intervals.partition_point(|(from, _)| *from <= id.number);
        after > 0 && intervals[after - 1].1 >= id.number
    }

    /// Remembers a sample; says whether it is new.
    ///
    /// # Errors
    /// See [`SeenSamples::would_accept`]. Nothing is remembered then.
    pub fn insert(&mut self, id: SampleId) -> Result<bool, SeenError> {
        if !self.would_accept(id)? {
            return Ok(false);
        }
        self.add(id.series(), (id.number, id.number));
        Ok(true)
    }

    /// Remembers all that another set has; of series that there is no room for, nothing.
    pub fn extend(&mut self, other: &Self) {
        for (series, intervals) in &other.series {
            if self.series.contains_key(series) || self.has_room_for(series.sample(1)).is_ok() {
                intervals.iter().for_each(|interval| self.add(*series, *interval));
            }
        }
    }

    /// Forgets a series.
    pub fn forget(&mut self, series: SampleSeries) {
        self.intervals -= self.series.remove(&series).map_or(0, |intervals| intervals.len());
    }

    /// Whether a series that is new with that sample can be kept track of.
    fn has_room_for(&self, id: SampleId) -> Result<(), SeenError> {
        if self.series.len() >= MAX_SERIES {
            return Err(SeenError::TooManyAuthors(id));
        }
        if self.lives(id.author).count() >= MAX_LIVES {
            return Err(SeenError::TooManyLives(id));
        }
        Ok(())
    }

    /// Adds an interval, and closes gaps until all is within the bounds.
    fn add(&mut self, series: SampleSeries, (mut from, mut to): (u32, u32)) {
        let intervals = self.series.entry(series).or_default();
        let before = intervals.len();
        // Those that it overlaps or touches become one with it.
        let first = intervals.partition_point(|(_, end)| end.saturating_add(1) < from);
        let last = intervals.partition_point(|(start, _)| *start <= to.saturating_add(1));
        if let Some(merged) = intervals.get(first..last).filter(|merged| !merged.is_empty()) {
            (from, to) = (from.min(merged[0].0), to.max(merged[merged.len() - 1].1));
            intervals[first] = (from, to);
            intervals.drain(first + 1..last);
        } else {
            intervals.insert(first, (from, to));
        }
        if intervals.len() > MAX_GAPS {
            close_lowest_gap(intervals);
        }
        self.intervals = self.intervals + intervals.len() - before;
        while self.intervals > MAX_INTERVALS_IN_ALL {
            // More than one each, as there are more intervals than series.
            let Some(most) = self.series.values_mut().max_by_key(|intervals| intervals.len()) else {
                return;
            };
            close_lowest_gap(most);
            self.intervals -= 1;
        }
    }

    /// What [`SeenSamples::insert`] would say: whether the sample is new.
    ///
    /// # Errors
    /// [`SeenError::Zero`], [`SeenError::FarAhead`], [`SeenError::TooManyAuthors`] and [`SeenError::TooManyLives`]: an
    /// identifier that cannot be remembered within the bounds.
    pub fn would_accept(&self, id: SampleId) -> Result<bool, SeenError> {
        if id.number == 0 {
            return Err(SeenError::Zero(id));
        }
        if self.contains(id) {
            return Ok(false);
        }
        let intervals = self.intervals(id.series());
        let highest = intervals.last().map_or(0, |(_, to)| *to);
        if id.number > LAST_NUMBER.max(highest.saturating_add(FAR_AHEAD)) {
            return Err(SeenError::FarAhead(id));
        }
        if intervals.is_empty() {
            self.has_room_for(id)?;
        }
        Ok(true)
    }

    /// Names the set under a key: the same samples give the same digest, whatever the order they came in; two different
    /// sets that were chosen without knowing the key share it with probability 2⁻⁶⁴.
    #[must_use]
    pub fn digest(&self, key: u64) -> u64 {
        let intervals = self.series.iter().flat_map(|(series, of)| of.iter().map(|i| (*series, *i)));
        intervals.fold(0, |digest, (series, (from, to))| {
            // The mark of a number is an edge combined with that of its predecessor, so the marks of an interval cancel but
            // for its two ends, and an interval costs as little as a number.
            digest ^ edge(key, series, from - 1) ^ edge(key, series, to)
        })
    }

    /// The series of which a sample was seen, ascending.
    pub fn series(&self) -> impl ExactSizeIterator<Item = SampleSeries> + '_ {
        self.series.keys().copied()
    }

    /// The lives of an author of which a sample was seen.
    pub fn lives(&self, author: RobotId) -> impl Iterator<Item = SampleSeries> + '_ {
        let of = |life| SampleSeries { author, life };
        self.series.range(of(0)..=of(u32::MAX)).map(|(series, _)| *series)
    }

    /// The numbers seen of a series: inclusive intervals, ascending, neither overlapping nor touching.
    #[must_use]
    pub fn intervals(&self, series: SampleSeries) -> &[(u32, u32)] {
        self.series.get(&series).map_or(&[], SmallVec::as_slice)
    }

    /// Whether the other has seen a sample that this one has not.
    #[must_use]
    pub fn lacks(&self, other: &Self) -> bool {
        other.series().any(|series| other.beyond(series, self.intervals(series)).next().is_some())
    }

    /// The samples of a series in this set that the given intervals (ascending) do not cover, by number. Lazy:
    /// take as many as are wanted. Intervals out of order may make it name a sample that they do cover.
    pub fn beyond<'a>(
        &'a self,
        series: SampleSeries,
        theirs: &'a [(u32, u32)],
    ) -> impl Iterator<Item = SampleId> + 'a {
        self.intervals(series)
            .iter()
            .flat_map(move |&(from, to)| {
                let first = theirs.partition_point(|(_, end)| *end < from);
                // What lies before, between and after those of their intervals that reach into this one.
                let reaching = theirs[first..].iter().take_while(move |(start, _)| *start <= to);
                let starts = reaching.clone().map(|(start, _)| u64::from(*start)).chain([u64::from(to) + 1]);
                let ends = reaching.map(|(_, end)| u64::from(*end) + 1);
                [u64::from(from)].into_iter().chain(ends).zip(starts)
            })
            .flat_map(|(from, before)| from..before)
            // Numbers of an interval of u32 are u32.
            .map(move |number| series.sample(number as u32))
    }
}

/// Takes what lies between the two lowest intervals as seen.
fn close_lowest_gap(intervals: &mut Intervals) {
    if intervals.len() > 1 {
        let (from, _) = intervals.remove(0);
        intervals[0].0 = from;
    }
}

fn edge(key: u64, series: SampleSeries, number: u32) -> u64 {
    let mut sip = SipHasher24::new_with_keys(key, u64::from_le_bytes(*b"samples "));
    let SampleSeries { author, life } = series;
    [author.0, life, number].iter().for_each(|part| sip.write(&part.to_le_bytes()));
    sip.finish()
}

#[cfg(test)]
mod tests;
