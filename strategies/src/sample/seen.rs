//! Which samples a robot ever had, so that none is taken twice.

use std::hash::Hasher;
use std::ops::Range;

use gestalt_protocol::{RobotId, SampleId, SampleSeries};
use siphasher::sip::SipHasher24;
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

/// A set of sample identifiers: for each series the numbers seen, as intervals. A robot that misses nothing holds one
/// interval for each life in which an author shared something, however long that is; [`MAX_SERIES`], [`MAX_LIVES`],
/// [`MAX_GAPS`] and [`MAX_INTERVALS_IN_ALL`] hold whatever arrives.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SeenSamples {
    /// Of which series each interval is, ascending: in a list that is mostly of one for each, a third of what a tree takes.
    of: Vec<SampleSeries>,
    /// The intervals, those of a series side by side and ascending.
    intervals: Vec<(u32, u32)>,
    /// How many series there are.
    series: usize,
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
            let in_all = seen.intervals.len() + intervals.len();
            if let Some((first, _)) = intervals.first().filter(|_| in_all > MAX_INTERVALS_IN_ALL) {
                return Err(SeenError::TooManyGaps(series.sample(*first)));
            }
            seen.take_up(series, intervals)?;
        }
        Ok(seen)
    }

    /// The same of what this robot stored. More intervals than are kept in all are no error there: the lowest gaps count as seen.
    ///
    /// # Errors
    /// The others.
    pub(crate) fn from_stored(
        all: impl IntoIterator<Item = (SampleSeries, Vec<(u32, u32)>)>,
    ) -> Result<Self, SeenError> {
        let mut seen = Self::default();
        for (series, intervals) in all {
            seen.take_up(series, intervals)?;
        }
        while seen.close_gap_of_most().is_some() {}
        Ok(seen)
    }

    fn take_up(&mut self, series: SampleSeries, intervals: Vec<(u32, u32)>) -> Result<(), SeenError> {
        let Some(&(first, _)) = intervals.first() else { return Ok(()) };
        let id = series.sample(first);
        if first == 0 {
            return Err(SeenError::Zero(id));
        }
        if intervals.len() > MAX_GAPS {
            return Err(SeenError::TooManyGaps(id));
        }
        self.has_room_for(id)?;
        let forwards = intervals.iter().all(|(from, to)| from <= to);
        // Apart: at least one number is missing between two neighbours.
        let apart = intervals.windows(2).all(|pair| pair[1].0.saturating_sub(pair[0].1) > 1);
        let Range { start, end } = self.places(series);
        if !forwards || !apart || start < end {
            return Err(SeenError::Disorder(series));
        }
        self.of.splice(start..start, intervals.iter().map(|_| series));
        self.intervals.splice(start..start, intervals);
        self.series += 1;
        Ok(())
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
        Ok(self.insert_and_tell(id)?.is_some())
    }

    /// The same; if it is new, gives the series besides its own of which what was seen is another now.
    pub(crate) fn insert_and_tell(&mut self, id: SampleId) -> Result<Option<Vec<SampleSeries>>, SeenError> {
        if !self.would_accept(id)? {
            return Ok(None);
        }
        Ok(Some(self.add(id.series(), (id.number, id.number))))
    }

    /// Remembers a sample wherever there is room for its series, however far its number is ahead.
    pub(crate) fn note(&mut self, id: SampleId) {
        if id.number > 0 && (!self.places(id.series()).is_empty() || self.has_room_for(id).is_ok()) {
            self.add(id.series(), (id.number, id.number));
        }
    }

    /// Remembers all that another set has; of series that there is no room for, nothing.
    pub fn extend(&mut self, other: &Self) {
        for series in other.series() {
            if !self.places(series).is_empty() || self.has_room_for(series.sample(1)).is_ok() {
                for interval in other.intervals(series) {
                    self.add(series, *interval);
                }
            }
        }
    }

    /// Forgets a series.
    pub fn forget(&mut self, series: SampleSeries) {
        let places = self.places(series);
        self.series -= usize::from(!places.is_empty());
        self.of.drain(places.clone());
        self.intervals.drain(places);
    }

    /// Whether a series that is new with that sample can be kept track of.
    fn has_room_for(&self, id: SampleId) -> Result<(), SeenError> {
        if self.series >= MAX_SERIES {
            return Err(SeenError::TooManyAuthors(id));
        }
        if self.lives(id.author).count() >= MAX_LIVES {
            return Err(SeenError::TooManyLives(id));
        }
        Ok(())
    }

    /// Where the intervals of a series are; where they would be, if there are none.
    fn places(&self, series: SampleSeries) -> Range<usize> {
        let start = self.of.partition_point(|other| *other < series);
        start..start + self.of[start..].partition_point(|other| *other == series)
    }

    /// Adds an interval, and closes gaps until all is within the bounds; gives the other series of which one was.
    fn add(&mut self, series: SampleSeries, (mut from, mut to): (u32, u32)) -> Vec<SampleSeries> {
        let places = self.places(series);
        let intervals = &self.intervals[places.clone()];
        // Those that it overlaps or touches become one with it.
        let first = places.start + intervals.partition_point(|(_, end)| end.saturating_add(1) < from);
        let last = places.start + intervals.partition_point(|(start, _)| *start <= to.saturating_add(1));
        if first < last {
            (from, to) = (from.min(self.intervals[first].0), to.max(self.intervals[last - 1].1));
            self.intervals[first] = (from, to);
            self.intervals.drain(first + 1..last);
            self.of.drain(first + 1..last);
        } else {
            self.intervals.insert(first, (from, to));
            self.of.insert(first, series);
            self.series += usize::from(places.is_empty());
        }
        let places = self.places(series);
        if places.len() > MAX_GAPS {
            self.close_lowest_gap(places.start);
        }
        let closed = std::iter::from_fn(|| self.close_gap_of_most());
        closed.filter(|other| *other != series).collect()
    }

    /// Where there are too many intervals in all, closes the lowest gap of the series that has most; says of which.
    fn close_gap_of_most(&mut self) -> Option<SampleSeries> {
        if self.intervals.len() <= MAX_INTERVALS_IN_ALL {
            return None;
        }
        // More than one each, as there are more intervals than series.
        let start = self.runs().max_by_key(ExactSizeIterator::len)?.start;
        self.close_lowest_gap(start);
        Some(self.of[start])
    }

    /// Takes what lies between the two lowest intervals of a series as seen: of the one whose intervals begin there, and that has two.
    fn close_lowest_gap(&mut self, start: usize) {
        self.intervals[start + 1].0 = self.intervals[start].0;
        self.intervals.remove(start);
        self.of.remove(start);
    }

    /// Where the intervals of each series are.
    fn runs(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        self.of.chunk_by(PartialEq::eq).scan(0, |end, run| {
            let start = *end;
            *end += run.len();
            Some(start..*end)
        })
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
        self.of.iter().zip(&self.intervals).fold(0, |digest, (&series, &(from, to))| {
            // The mark of a number is an edge combined with that of its predecessor, so the marks of an interval cancel but
            // for its two ends, and an interval costs as little as a number.
            digest ^ edge(key, series, from - 1) ^ edge(key, series, to)
        })
    }

    /// The series of which a sample was seen, ascending.
    pub fn series(&self) -> impl Iterator<Item = SampleSeries> + '_ {
        self.of.chunk_by(PartialEq::eq).map(|same| same[0])
    }

    /// How many those are.
    #[must_use]
    pub fn series_count(&self) -> usize {
        self.series
    }

    /// The lives of an author of which a sample was seen.
    pub fn lives(&self, author: RobotId) -> impl Iterator<Item = SampleSeries> + '_ {
        let first = self.of.partition_point(|series| series.author < author);
        let last = first + self.of[first..].partition_point(|series| series.author == author);
        self.of[first..last].chunk_by(PartialEq::eq).map(|same| same[0])
    }

    /// The numbers seen of a series: inclusive intervals, ascending, neither overlapping nor touching.
    #[must_use]
    pub fn intervals(&self, series: SampleSeries) -> &[(u32, u32)] {
        &self.intervals[self.places(series)]
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

fn edge(key: u64, series: SampleSeries, number: u32) -> u64 {
    let mut sip = SipHasher24::new_with_keys(key, u64::from_le_bytes(*b"samples "));
    let SampleSeries { author, life } = series;
    [author.0, life, number].iter().for_each(|part| sip.write(&part.to_le_bytes()));
    sip.finish()
}

#[cfg(test)]
mod tests;
