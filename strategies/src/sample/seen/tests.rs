//! Which samples were seen, in whatever order they came.

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
            row = (row.0.min(row.0 ^ known.0), if row.0 ^ known.0 < row.0 { row.1 ^ known.1 } else { row.1 });
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

#[test]
fn what_was_stored_with_too_many_gaps_is_read_and_what_is_said_so_is_not() {
    let stored = || {
        let series = (0..65).map(|life| SampleSeries { author: RobotId(life % 2), life });
        series.map(|series| (series, (0..256).map(|i| (1 + 2 * i, 1 + 2 * i)).collect()))
    };
    let said = SeenSamples::from_intervals(stored());
    assert!(matches!(said, Err(SeenError::TooManyGaps(_))), "{said:?}");
    let seen = SeenSamples::from_stored(stored()).unwrap();
    assert_eq!((seen.series_count(), seen.intervals.len()), (65, MAX_INTERVALS_IN_ALL));
    for (series, intervals) in stored() {
        assert!(intervals.iter().all(|(from, _): &(u32, u32)| seen.contains(series.sample(*from))));
    }
}
