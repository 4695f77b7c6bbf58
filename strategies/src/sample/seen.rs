//! Which samples a robot ever had, so that none is taken twice.

use std::collections::BTreeMap;

use gestalt_protocol::{RobotId, SampleId};
use thiserror::Error;

/// Authors that are kept track of.
pub const MAX_AUTHORS: usize = 4096;
/// Intervals of numbers kept per author. Beyond, the lowest gap counts as seen: what is missing there was lost long ago, or
/// forgotten by whoever could give it.
pub const MAX_GAPS: usize = 256;
/// Intervals kept of all authors together, so that a list of them always fits in a message.
pub const MAX_INTERVALS_IN_ALL: usize = 16_384;
/// How far a number may lie beyond the highest one seen of its author, once it is beyond [`LAST_NUMBER`].
const FAR_AHEAD: u32 = 1_000_000;
/// Up to here an author may begin with any number, as one does that has lost its memory. The last ones are for who came
/// there in sequence: nobody may use up the numbers of another.
pub const LAST_NUMBER: u32 = u32::MAX - FAR_AHEAD;

/// An identifier that cannot be remembered. What was seen is unchanged.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum SeenError {
    /// Authors number their samples from 1.
    #[error("sample {0}: numbers count from 1")]
    Zero(SampleId),
    /// Samples of as many authors as can be kept track of were seen already.
    #[error("sample {0}: samples of {MAX_AUTHORS} other authors were seen, which is the most that is kept")]
    TooManyAuthors(SampleId),
    /// More intervals are claimed of one author, or of all together, than are kept.
    #[error(
        "sample {0}: more than {MAX_GAPS} intervals of an author's numbers, or {MAX_INTERVALS_IN_ALL} in all"
    )]
    TooManyGaps(SampleId),
    /// The number lies further ahead than its author can have come.
    #[error("sample {0}: no author can have come so far")]
    FarAhead(SampleId),
    /// Intervals that touch, overlap, run backwards or are out of order.
    #[error("the intervals of author {0} are not ascending and apart")]
    Disorder(RobotId),
}

/// A set of sample identifiers: for each author the numbers seen, as intervals. A robot that misses nothing holds
/// one interval per author, however long it lives, and one more for each time that the author lost its memory and
/// numbered on from its boot number; [`MAX_AUTHORS`], [`MAX_GAPS`] and [`MAX_INTERVALS_IN_ALL`] hold whatever arrives.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SeenSamples {
    authors: BTreeMap<RobotId, Vec<(u32, u32)>>,
    /// How many intervals there are in all.
    intervals: usize,
}

impl SeenSamples {
    /// Takes up what was stored: each author with its intervals (inclusive, ascending, neither overlapping nor
    /// touching).
    ///
    /// # Errors
    /// [`SeenError::Disorder`], also for an author that comes twice; [`SeenError::Zero`],
    /// [`SeenError::TooManyAuthors`], [`SeenError::TooManyGaps`].
    pub fn from_intervals(
        authors: impl IntoIterator<Item = (RobotId, Vec<(u32, u32)>)>,
    ) -> Result<Self, SeenError> {
        let mut seen = Self::default();
        for (author, intervals) in authors {
            let Some(&(first, _)) = intervals.first() else { continue };
            let id = SampleId { author, number: first };
            if first == 0 {
                return Err(SeenError::Zero(id));
            }
            if intervals.len() > MAX_GAPS || seen.intervals + intervals.len() > MAX_INTERVALS_IN_ALL {
                return Err(SeenError::TooManyGaps(id));
            }
            if seen.authors.len() >= MAX_AUTHORS {
                return Err(SeenError::TooManyAuthors(id));
            }
            let forwards = intervals.iter().all(|(from, to)| from <= to);
            // Apart: at least one number is missing between two neighbours.
            let apart = intervals.windows(2).all(|pair| pair[1].0.saturating_sub(pair[0].1) > 1);
            if !(forwards && apart) {
                return Err(SeenError::Disorder(author));
            }
            seen.intervals += intervals.len();
            if seen.authors.insert(author, intervals).is_some() {
                return Err(SeenError::Disorder(author));
            }
        }
        Ok(seen)
    }

    /// Whether the sample was seen.
    #[must_use]
    pub fn contains(&self, id: SampleId) -> bool {
        let intervals = self.intervals(id.author);
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
        self.add(id.author, (id.number, id.number));
        Ok(true)
    }

    /// Remembers all that another set has; of authors that there is no room for, nothing.
    pub fn extend(&mut self, other: &Self) {
        for (author, intervals) in &other.authors {
            if self.authors.contains_key(author) || self.authors.len() < MAX_AUTHORS {
                intervals.iter().for_each(|interval| self.add(*author, *interval));
            }
        }
    }

    /// Forgets an author.
    pub fn forget(&mut self, author: RobotId) {
        self.intervals -= self.authors.remove(&author).map_or(0, |intervals| intervals.len());
    }

    /// Adds an interval, and closes gaps until all is within the bounds.
    fn add(&mut self, author: RobotId, (mut from, mut to): (u32, u32)) {
        let intervals = self.authors.entry(author).or_default();
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
            // More than one each, as there are more intervals than authors.
            let Some(most) = self.authors.values_mut().max_by_key(|intervals| intervals.len()) else {
                return;
            };
            close_lowest_gap(most);
            self.intervals -= 1;
        }
    }

    /// What [`SeenSamples::insert`] would say: whether the sample is new.
    ///
    /// # Errors
    /// [`SeenError::Zero`], [`SeenError::FarAhead`] and [`SeenError::TooManyAuthors`]: an identifier that cannot be
    /// remembered within the bounds.
    pub fn would_accept(&self, id: SampleId) -> Result<bool, SeenError> {
        if id.number == 0 {
            return Err(SeenError::Zero(id));
        }
        if self.contains(id) {
            return Ok(false);
        }
        let intervals = self.intervals(id.author);
        let highest = intervals.last().map_or(0, |(_, to)| *to);
        if id.number > LAST_NUMBER.max(highest.saturating_add(FAR_AHEAD)) {
            return Err(SeenError::FarAhead(id));
        }
        if intervals.is_empty() && self.authors.len() >= MAX_AUTHORS {
            return Err(SeenError::TooManyAuthors(id));
        }
        Ok(true)
    }

    /// Names the set: the same samples give the same digest, whatever the order they came in; two different sets
    /// share it with probability 2⁻⁶⁴.
    #[must_use]
    pub fn digest(&self) -> u64 {
        let intervals = self.authors.iter().flat_map(|(author, of)| of.iter().map(|i| (*author, *i)));
        intervals.fold(0, |digest, (author, interval)| digest ^ mark(author, interval))
    }

    /// The authors of which a sample was seen, ascending.
    pub fn authors(&self) -> impl Iterator<Item = RobotId> + '_ {
        self.authors.keys().copied()
    }

    /// The numbers seen of an author: inclusive intervals, ascending, neither overlapping nor touching.
    #[must_use]
    pub fn intervals(&self, author: RobotId) -> &[(u32, u32)] {
        self.authors.get(&author).map_or(&[], Vec::as_slice)
    }

    /// Whether the other has seen a sample that this one has not.
    #[must_use]
    pub fn lacks(&self, other: &Self) -> bool {
        other.authors().any(|author| other.beyond(author, self.intervals(author)).next().is_some())
    }

    /// The samples of an author in this set that the given intervals (ascending) do not cover, by number. Lazy:
    /// take as many as are wanted. Intervals out of order may make it name a sample that they do cover.
    pub fn beyond<'a>(
        &'a self,
        author: RobotId,
        theirs: &'a [(u32, u32)],
    ) -> impl Iterator<Item = SampleId> + 'a {
        self.intervals(author)
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
            .map(move |number| SampleId { author, number: number as u32 })
    }
}

/// Takes what lies between the two lowest intervals as seen.
fn close_lowest_gap(intervals: &mut Vec<(u32, u32)>) {
    if intervals.len() > 1 {
        let (from, _) = intervals.remove(0);
        intervals[0].0 = from;
    }
}

/// What an interval of numbers adds to the digest. The mark of a number is an edge hash combined with that of its
/// predecessor, so the marks of an interval cancel but for its two ends, and an interval costs as little as a number.
fn mark(author: RobotId, (from, to): (u32, u32)) -> u64 {
    edge(author, from - 1) ^ edge(author, to)
}

/// The finaliser of SplitMix64 (Steele, Lea & Flood 2014): a bijection that changes half of the bits for one.
fn edge(author: RobotId, number: u32) -> u64 {
    let mut z = (u64::from(author.0) << 32 | u64::from(number)).wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;

    fn id(author: u32, number: u32) -> SampleId {
        SampleId { author: RobotId(author), number }
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
        assert_eq!(seen.intervals(RobotId(7)), [(1, 3), (9, 9)]);
        assert_eq!(seen.intervals(RobotId(8)), []);
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
        assert_eq!(seen.intervals(RobotId(1)).len(), MAX_GAPS);
        assert!(seen.contains(id(1, 2)) && !seen.contains(id(1, 4)));
        assert_eq!(seen.insert(id(1, 4)), Ok(true), "the others can still be filled");
    }

    #[test]
    fn the_gaps_of_all_authors_together_are_bounded() {
        let authors = (MAX_INTERVALS_IN_ALL / MAX_GAPS) as u32 + 3;
        let seen = of((0..authors).flat_map(|author| (0..MAX_GAPS as u32).map(move |i| (author, 1 + 2 * i))));
        let kept: Vec<usize> = seen.authors().map(|author| seen.intervals(author).len()).collect();
        assert_eq!(kept.iter().sum::<usize>(), MAX_INTERVALS_IN_ALL);
        assert!(kept.iter().all(|kept| *kept > MAX_GAPS / 2), "all give way alike: {kept:?}");
        let last = 1 + 2 * (MAX_GAPS as u32 - 1);
        assert!((0..authors).all(|author| seen.contains(id(author, last))), "nothing seen is lost");
    }

    #[test]
    fn the_authors_are_bounded() {
        let mut seen = of((0..MAX_AUTHORS as u32).map(|author| (author, 1)));
        let stranger = id(MAX_AUTHORS as u32, 1);
        assert_eq!(seen.insert(stranger), Err(SeenError::TooManyAuthors(stranger)));
        assert_eq!(seen.insert(id(0, 2)), Ok(true));
    }

    #[test]
    fn the_last_number_of_all_overflows_nothing() {
        let author = RobotId(3);
        let mut seen = SeenSamples::from_intervals([(author, vec![(1, u32::MAX - 1)])]).unwrap();
        assert_eq!(seen.insert(id(3, u32::MAX)), Ok(true));
        assert_eq!(seen.insert(id(3, u32::MAX)), Ok(false));
        assert!(!seen.lacks(&seen.clone()));
        assert_eq!(seen.beyond(author, &[(1, u32::MAX - 2)]).count(), 2);
    }

    #[test]
    fn disordered_intervals_are_refused() {
        for bad in [vec![(3, 2)], vec![(1, 2), (3, 4)], vec![(5, 6), (1, 2)], vec![(1, 4), (2, 6)]] {
            let found = SeenSamples::from_intervals([(RobotId(1), bad.clone())]);
            assert_eq!(found, Err(SeenError::Disorder(RobotId(1))), "{bad:?}");
        }
        let zero = SeenSamples::from_intervals([(RobotId(1), vec![(0, 2)])]);
        assert_eq!(zero, Err(SeenError::Zero(id(1, 0))));
        let twice = SeenSamples::from_intervals([(RobotId(1), vec![(1, 2)]), (RobotId(1), vec![(4, 5)])]);
        assert_eq!(twice, Err(SeenError::Disorder(RobotId(1))));
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
            let stored = seen.authors().map(|a| (a, seen.intervals(a).to_vec())).collect::<Vec<_>>();
            prop_assert_eq!(SeenSamples::from_intervals(stored), Ok(seen));
        }

        #[test]
        fn the_digest_names_the_set_whatever_the_order(
            (a, shuffled, b) in ids().prop_flat_map(|a| (Just(a.clone()), Just(a).prop_shuffle(), ids()))
        ) {
            prop_assert_eq!(of(a.clone()).digest(), of(shuffled).digest());
            let (a, b) = (of(a), of(b));
            prop_assert_eq!(a.digest() == b.digest(), a == b);
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
                .authors()
                .flat_map(|author| a.beyond(author, b.intervals(author)).collect::<Vec<_>>())
                .map(|id| (id.author.0, id.number))
                .collect();
            prop_assert_eq!(b.lacks(&a), !model.is_empty());
            prop_assert_eq!(found, model.into_iter().collect::<Vec<_>>());
        }
    }
}
