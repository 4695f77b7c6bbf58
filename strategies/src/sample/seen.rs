//! Which samples a robot ever had, so that none is taken twice.

use std::collections::BTreeMap;
use std::hash::Hasher;

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
    series: BTreeMap<SampleSeries, Vec<(u32, u32)>>,
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
            if seen.series.insert(series, intervals).is_some() {
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
        }
        intervals.splice(first..last, [(from, to)]);
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
        self.series.get(&series).map_or(&[], Vec::as_slice)
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
fn close_lowest_gap(intervals: &mut Vec<(u32, u32)>) {
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
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;

    fn of_author(author: u32) -> SampleSeries {
        SampleSeries { author: RobotId(author), life: 7 }
    }

    fn id(author: u32, number: u32) -> SampleId {
        of_author(author).sample(number)
    }

    fn of(ids: impl IntoIterator<Item = (u32, u32)>) -> SeenSamples {
        let mut seen = SeenSamples::default();
        for (author, number) in ids {
            seen.insert(id(author, number)).unwrap();
        }
        seen
    }

    #[test]
    fn numbers_without_gaps_are_one_interval() {
        let seen = of([(7, 1), (7, 3), (7, 2), (7, 9)]);
        assert_eq!(seen.intervals(of_author(7)), [(1, 3), (9, 9)]);
        assert_eq!(seen.intervals(of_author(8)), []);
    }

    #[test]
    fn what_cannot_be_remembered_is_refused_and_changes_nothing() {
        let mut seen = of([(1, 5)]);
        let before = seen.clone();
        for (id, error) in [
            (id(1, 0), SeenError::Zero(id(1, 0))),
            (id(1, LAST_NUMBER + 1), SeenError::FarAhead(id(1, LAST_NUMBER + 1))),
            (id(2, u32::MAX), SeenError::FarAhead(id(2, u32::MAX))),
        ] {
            assert_eq!(seen.insert(id), Err(error));
        }
        assert_eq!(seen, before);
        assert_eq!(seen.insert(id(1, LAST_NUMBER)), Ok(true));
    }

    #[test]
    fn the_lowest_gaps_count_as_seen_when_there_are_too_many() {
        let mut seen = of((0..MAX_GAPS as u32).map(|i| (1, 1 + 2 * i)));
        let next = 1 + 2 * MAX_GAPS as u32;
        assert!(!seen.contains(id(1, 2)));
        assert_eq!(seen.insert(id(1, next)), Ok(true));
        assert_eq!(seen.intervals(of_author(1)).len(), MAX_GAPS);
        assert!(seen.contains(id(1, 2)) && !seen.contains(id(1, 4)));
        assert_eq!(seen.insert(id(1, 4)), Ok(true), "the others can still be filled");
    }

    #[test]
    fn the_gaps_of_all_authors_together_are_bounded() {
        let authors = (MAX_INTERVALS_IN_ALL / MAX_GAPS) as u32 + 3;
        let seen = of((0..authors).flat_map(|author| (0..MAX_GAPS as u32).map(move |i| (author, 1 + 2 * i))));
        let kept: Vec<usize> = seen.series().map(|author| seen.intervals(author).len()).collect();
        assert_eq!(kept.iter().sum::<usize>(), MAX_INTERVALS_IN_ALL);
        assert!(kept.iter().all(|kept| *kept > MAX_GAPS / 2), "all give way alike: {kept:?}");
        let last = 1 + 2 * (MAX_GAPS as u32 - 1);
        assert!((0..authors).all(|author| seen.contains(id(author, last))), "nothing seen is lost");
    }

    #[test]
    fn the_authors_are_bounded() {
        let mut seen = of((0..MAX_SERIES as u32).map(|author| (author, 1)));
        let stranger = id(MAX_SERIES as u32, 1);
        assert_eq!(seen.insert(stranger), Err(SeenError::TooManyAuthors(stranger)));
        assert_eq!(seen.insert(id(0, 2)), Ok(true));
    }

    /// Ids whose marks cancel under one key, found as anybody can who knows it.
    #[test]
    fn what_is_chosen_to_look_the_same_under_one_key_does_not_under_another() {
        // Gaussian elimination over GF(2): 65 marks of 64 bits are dependent.
        let mark = |key, number| of([(3, number)]).digest(key);
        let mut rows: Vec<(u64, u128)> = Vec::new();
        let mut dependent = None;
        for (i, number) in (1..200).step_by(2).enumerate() {
            let mut row = (mark(7, number), 1_u128 << i);
            for known in &rows {
                row = (
                    row.0.min(row.0 ^ known.0),
                    if row.0 ^ known.0 < row.0 { row.1 ^ known.1 } else { row.1 },
                );
            }
            if row.0 == 0 {
                dependent = Some(row.1);
                break;
            }
            rows.push(row);
            rows.sort_unstable_by(|a, b| b.cmp(a));
        }
        let chosen = dependent.expect("there are more marks than bits");
        let crafted = of((0..100).filter(|i| chosen >> i & 1 == 1).map(|i| (3, 1 + 2 * i)));
        assert_eq!(crafted.digest(7), SeenSamples::default().digest(7));
        assert!((8..1000).all(|key| crafted.digest(key) != SeenSamples::default().digest(key)));
    }

    #[test]
    fn the_lives_of_an_author_are_bounded() {
        let of_life = |life| SampleSeries { author: RobotId(1), life }.sample(1);
        let mut seen = SeenSamples::default();
        for life in 0..MAX_LIVES as u32 {
            assert_eq!(seen.insert(of_life(life)), Ok(true));
        }
        let more = of_life(u32::MAX);
        assert_eq!(seen.insert(more), Err(SeenError::TooManyLives(more)));
        assert_eq!(seen.insert(id(2, 1)), Ok(true), "that concerns nobody else");
    }

    #[test]
    fn the_last_number_of_all_overflows_nothing() {
        let author = of_author(3);
        let mut seen = SeenSamples::from_intervals([(author, vec![(1, u32::MAX - 1)])]).unwrap();
        assert_eq!(seen.insert(id(3, u32::MAX)), Ok(true));
        assert_eq!(seen.insert(id(3, u32::MAX)), Ok(false));
        assert!(!seen.lacks(&seen.clone()));
        assert_eq!(seen.beyond(author, &[(1, u32::MAX - 2)]).count(), 2);
    }

    #[test]
    fn disordered_intervals_are_refused() {
        for bad in [vec![(3, 2)], vec![(1, 2), (3, 4)], vec![(5, 6), (1, 2)], vec![(1, 4), (2, 6)]] {
            let found = SeenSamples::from_intervals([(of_author(1), bad.clone())]);
            assert_eq!(found, Err(SeenError::Disorder(of_author(1))), "{bad:?}");
        }
        let zero = SeenSamples::from_intervals([(of_author(1), vec![(0, 2)])]);
        assert_eq!(zero, Err(SeenError::Zero(id(1, 0))));
        let twice = SeenSamples::from_intervals([(of_author(1), vec![(1, 2)]), (of_author(1), vec![(4, 5)])]);
        assert_eq!(twice, Err(SeenError::Disorder(of_author(1))));
    }

    fn ids() -> impl Strategy<Value = Vec<(u32, u32)>> {
        prop::collection::vec((0..4u32, 1..40u32), 0..120)
    }

    proptest! {
        #[test]
        fn it_is_a_set(ids in ids()) {
            let mut seen = SeenSamples::default();
            let mut model = BTreeSet::new();
            for (author, number) in ids {
                prop_assert_eq!(seen.insert(id(author, number)), Ok(model.insert((author, number))));
            }
            for author in 0..4 {
                for number in 1..41 {
                    prop_assert_eq!(seen.contains(id(author, number)), model.contains(&(author, number)));
                }
            }
            let stored = seen.series().map(|a| (a, seen.intervals(a).to_vec())).collect::<Vec<_>>();
            prop_assert_eq!(SeenSamples::from_intervals(stored), Ok(seen));
        }

        #[test]
        fn the_digest_names_the_set_whatever_the_order(
            (a, shuffled, b) in ids().prop_flat_map(|a| (Just(a.clone()), Just(a).prop_shuffle(), ids()))
        ) {
            prop_assert_eq!(of(a.clone()).digest(7), of(shuffled).digest(7));
            let (a, b) = (of(a), of(b));
            prop_assert_eq!(a.digest(7) == b.digest(7), a == b);
            prop_assert!(a.digest(7) != a.digest(8) || a == SeenSamples::default());
        }

        #[test]
        fn two_sets_together_have_what_either_has(a in ids(), b in ids()) {
            let mut together = of(a.clone());
            together.extend(&of(b.clone()));
            prop_assert_eq!(together, of(a.into_iter().chain(b)));
        }

        #[test]
        fn what_another_lacks_is_the_difference(a in ids(), b in ids()) {
            let model: BTreeSet<_> = a.iter().filter(|id| !b.contains(id)).copied().collect();
            let (a, b) = (of(a), of(b));
            let found: Vec<_> = a
                .series()
                .flat_map(|author| a.beyond(author, b.intervals(author)).collect::<Vec<_>>())
                .map(|id| (id.author.0, id.number))
                .collect();
            prop_assert_eq!(b.lacks(&a), !model.is_empty());
            prop_assert_eq!(found, model.into_iter().collect::<Vec<_>>());
        }
    }
}
