//! The training set as its users see it: what holds under any order of operations.

mod operations;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use gestalt_protocol::{ClassId, RobotId};
use gestalt_strategies::sample::HeldSamples;
use gestalt_strategies::{
    Classify, Forgetting, ForgettingRule, HeldSample, RestoreError, SampleReceipt, SeenError, SeenSamples,
    Selection, SelectionRule, SetChange, SetPart, TrainingSet,
};
use operations::{
    ME, OWN, Operation, Store, as_is, generator, id, operations, round, rounded, rules, run, set,
};
use proptest::prelude::*;
use rand::Rng;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    #[test]
    fn the_set_holds_its_promises_whatever_happens(
        operations in operations(80), capacity in 1..20_usize, rules in rules(), seed: u64
    ) {
        let mut rng = generator(seed);
        let mut set = set(capacity, rules.0, rules.1);
        let mut store = Store::default();
        let mut shared_keys = BTreeSet::new();
        for operation in &operations {
            let before = store.clone();
            if let Operation::Restart = operation {
                set = self::set(capacity, rules.0, rules.1);
                store.restore_into(&mut set);
            }
            let (changes, new) = run(&mut set, operation, &mut rng);
            store.apply(&set, &changes);

            // What is stored from the changes is what is held.
            let held: BTreeMap<u64, HeldSample> = set.iter().map(|s| (s.key, s.clone())).collect();
            prop_assert_eq!(&held, &store.samples);
            prop_assert_eq!(set.seen(), &store.seen());
            prop_assert_eq!(set.seen().digest(7), store.seen().digest(7));
            prop_assert_eq!(set.next_key(), store.last_key + 1);
            prop_assert_eq!(set.next_number(), store.last_number + 1);

            // Never more than the capacity.
            prop_assert!(set.len() <= capacity);
            prop_assert_eq!(set.len(), held.len());

            // The counts agree with the samples.
            for class in (0..4).map(ClassId) {
                for part in SetPart::ALL {
                    let found = held.values().filter(|s| s.class == class && s.part == part).count();
                    prop_assert_eq!(set.count(part, class), found);
                }
                prop_assert_eq!(set.class_count(class), held.values().filter(|s| s.class == class).count());
            }
            for part in SetPart::ALL {
                prop_assert_eq!(set.total(part), held.values().filter(|s| s.part == part).count());
            }
            prop_assert_eq!(set.common().count(), held.values().filter(|s| s.part != SetPart::Personal).count());

            // Each sample is in the part its name says, once.
            let mut names = BTreeSet::new();
            for sample in held.values() {
                let part = match sample.id {
                    None => SetPart::Personal,
                    Some(id) if id.author == ME => SetPart::Shared,
                    Some(_) => SetPart::External,
                };
                prop_assert_eq!(sample.part, part);
                if let Some(id) = sample.id {
                    prop_assert!(names.insert(id));
                    prop_assert_eq!(set.find(id), Some(sample));
                }
            }

            // Only an own sample is shared, only once, as it is sent, and the numbers have no gaps.
            let mut number = before.last_number;
            for change in &changes {
                if let SetChange::Shared(key, id) = change {
                    number += 1;
                    prop_assert_eq!(*id, OWN.sample(number));
                    prop_assert!(shared_keys.insert(*key));
                    let personal = &before.samples[key];
                    prop_assert_eq!(personal.part, SetPart::Personal);
                    prop_assert_eq!(held[key].vector.to_vec(), rounded(&personal.vector));
                }
            }

            match operation {
                // What was seen is not taken in again; what was not, is.
                Operation::Receive { author, number, .. } => {
                    prop_assert_eq!(new, !before.seen.contains(&id(*author, *number)));
                    prop_assert!(new || store == before);
                }
                // As many are shared as were asked for, or all.
                Operation::Share { n, .. } => {
                    let personal = before.samples.values().filter(|s| s.part == SetPart::Personal).count();
                    prop_assert_eq!(changes.len(), personal.min(*n));
                }
                Operation::Relabel { round: r, class } => {
                    prop_assert!(held.values().all(|s| s.round != round(*r) || s.class == ClassId((*class).into())));
                }
                Operation::Retract { round: r } => prop_assert!(held.values().all(|s| s.round != round(*r))),
                // Only what was had and is not held is taken back.
                Operation::TakeBack { author, number, .. } => {
                    let id = id(*author, *number);
                    let held = before.samples.values().any(|s| s.id == Some(id));
                    prop_assert_eq!(!changes.is_empty(), before.seen.contains(&id) && !held);
                    prop_assert_eq!(&store.seen, &before.seen);
                }
                Operation::Restart => prop_assert_eq!(&store, &before),
                Operation::Keep { .. } => prop_assert_eq!(store.last_key, before.last_key + 1),
            }
        }
    }

    #[test]
    fn a_sample_is_in_a_robot_once_and_only_its_maker_shares_it(
        steps in prop::collection::vec((0..4_u8, 0..3_usize, any::<prop::sample::Index>()), 1..150),
        capacity in 1..12_usize, rules in rules(), seed: u64
    ) {
        let mut rng = generator(seed);
        let robot = |me: usize| {
            TrainingSet::new(RobotId(me as u32), capacity, rules.0.build(), rules.1.build())
        };
        let mut robots = [robot(0), robot(1), robot(2)];
        // All that was ever said; each sample made is told from all others by its first component.
        let mut said: Vec<HeldSample> = Vec::new();
        let mut makers = Vec::new();
        for (what, i, which) in steps {
            match what {
                0 => {
                    let tag = makers.len() as f32;
                    makers.push(i);
                    robots[i].keep(ClassId(makers.len() as u32 % 2), round(1), vec![tag, 1.0], &mut rng);
                }
                1 => {
                    for change in robots[i].share(2, None, &as_is, &mut rng) {
                        let SetChange::Shared(key, _) = change else { panic!("{change:?}") };
                        said.push(robots[i].get(key).unwrap().clone());
                    }
                }
                2 if !said.is_empty() => {
                    let HeldSample { id, class, round, vector, .. } = said[which.index(said.len())].clone();
                    robots[i].receive(id.unwrap(), class, round, vector.to_vec(), &mut rng);
                }
                _ => {
                    let old = std::mem::replace(&mut robots[i], robot(i));
                    let samples = old.iter().cloned().collect();
                    robots[i]
                        .restore(samples, old.seen().clone(), old.next_key())
                        .unwrap();
                }
            }
            for robot in &robots {
                let tags: BTreeSet<u32> = robot.iter().map(|s| s.vector[0] as u32).collect();
                prop_assert_eq!(tags.len(), robot.len());
            }
        }
        let shared: BTreeSet<u32> = said.iter().map(|s| s.vector[0] as u32).collect();
        prop_assert_eq!(shared.len(), said.len());
        for sample in &said {
            prop_assert_eq!(sample.id.unwrap().author.0 as usize, makers[sample.vector[0] as usize]);
        }
    }
}

/// Every robot sees `m` samples of each of `k` classes and shares that part of them; everybody hears everything.
fn swarm(
    n: usize,
    k: usize,
    m: usize,
    part: f64,
    rules: (SelectionRule, ForgettingRule),
) -> Vec<TrainingSet> {
    let mut rng = generator(7);
    let mut said = Vec::new();
    let mut robots: Vec<TrainingSet> = (0..n)
        .map(|i| {
            let me = RobotId(i as u32);
            let mut robot = TrainingSet::new(me, 100_000, rules.0.build(), rules.1.build());
            for sample in 0..k * m {
                let vector = vec![sample as f32, i as f32];
                robot.keep(ClassId((sample % k) as u32), round(1), vector, &mut rng);
            }
            let share = (part * (k * m) as f64).round() as usize;
            robot.share(share, None, &as_is, &mut rng);
            said.extend(robot.iter().filter(|sample| sample.part == SetPart::Shared).cloned());
            robot
        })
        .collect();
    for robot in &mut robots {
        for sample in &said {
            let vector = sample.vector.to_vec();
            robot.receive(sample.id.unwrap(), sample.class, sample.round, vector, &mut rng);
        }
    }
    robots
}

#[test]
fn ten_robots_hold_eighty_four_samples_each() {
    for selection in SelectionRule::ALL {
        let robots = swarm(10, 6, 5, 0.2, (selection, ForgettingRule::default()));
        for robot in &robots {
            assert_eq!(robot.len(), 84);
            assert_eq!(SetPart::ALL.map(|part| robot.total(part)), [24, 6, 54]);
            assert_eq!(robot.common().count(), 60);
            assert_eq!(robot.seen().digest(7), robots[0].seen().digest(7));
        }
    }
}

#[test]
fn the_set_grows_with_the_swarm_and_with_what_it_shares() {
    let (k, m) = (6, 5);
    for n in [5, 10, 20] {
        for (part, shared) in [(0.0, 0), (0.1, 3), (0.2, 6), (0.5, 15), (1.0, 30)] {
            for robot in swarm(n, k, m, part, Default::default()) {
                assert_eq!(robot.len(), k * m + shared * (n - 1), "N = {n}, B = {part}");
                assert_eq!(
                    SetPart::ALL.map(|part| robot.total(part)),
                    [k * m - shared, shared, shared * (n - 1)]
                );
            }
        }
    }
}

#[test]
fn a_robot_that_lost_its_memory_gets_its_samples_back_and_numbers_under_another_life() {
    let mut rng = generator(1);
    let mut robot = set(10, SelectionRule::Random, ForgettingRule::Fifo);
    for number in [2, 5] {
        let receipt = robot.receive(id(0, number), ClassId(1), round(1), vec![1.0], &mut rng);
        assert!(matches!(receipt, SampleReceipt::New(_)));
        assert_eq!(robot.find(id(0, number)).unwrap().part, SetPart::Shared);
    }
    robot.keep(ClassId(0), round(2), vec![2.0], &mut rng);
    assert_eq!(robot.share(3, None, &as_is, &mut rng), [SetChange::Shared(3, OWN.sample(1))]);
    assert_eq!(robot.receive(OWN.sample(1), ClassId(0), round(2), vec![2.0], &mut rng), SampleReceipt::Known);
}

#[test]
fn a_name_beyond_the_bounds_is_refused_and_changes_nothing() {
    let mut rng = generator(1);
    let mut robot = set(10, SelectionRule::Novelty, ForgettingRule::Redundancy);
    for bad in [id(3, 0), id(3, u32::MAX), id(0, u32::MAX), OWN.sample(1), OWN.sample(9)] {
        let receipt = robot.receive(bad, ClassId(1), round(1), vec![1.0], &mut rng);
        assert!(matches!(receipt, SampleReceipt::Refused(_)), "{bad}");
    }
    assert!(robot.is_empty());
    assert_eq!((robot.seen(), robot.next_key(), robot.next_number()), (&SeenSamples::default(), 1, 1));
}

#[test]
fn strangers_cannot_keep_a_robot_from_sharing() {
    let mut rng = generator(1);
    let mut robot = set(10, SelectionRule::Random, ForgettingRule::Fifo);
    let mut refused = 0;
    for author in 1..=gestalt_strategies::sample::MAX_SERIES as u32 {
        let receipt = robot.receive(id(author, 1), ClassId(1), round(1), vec![1.0], &mut rng);
        refused += u32::from(matches!(receipt, SampleReceipt::Refused(SeenError::TooManyAuthors(_))));
    }
    assert_eq!(refused, 1);
    robot.keep(ClassId(0), round(1), vec![1.0], &mut rng);
    assert_eq!(robot.share(1, None, &as_is, &mut rng).len(), 1);
}

#[test]
fn robots_that_are_there_are_heard_however_many_strangers_were() {
    let mut rng = generator(1);
    let mut robot = set(10, SelectionRule::Random, ForgettingRule::Fifo);
    for author in 1..=gestalt_strategies::sample::MAX_SERIES as u32 {
        robot.receive(id(author, 1), ClassId(1), round(1), vec![1.0], &mut rng);
    }
    let alive = [RobotId(70_000), RobotId(70_001)];
    let refused = robot.receive(id(70_000, 1), ClassId(1), round(1), vec![1.0], &mut rng);
    assert!(matches!(refused, SampleReceipt::Refused(SeenError::TooManyAuthors(_))));
    robot.meet(Arc::new(alive.into()));
    for author in [70_000, 70_001] {
        let SampleReceipt::New(changes) =
            robot.receive(id(author, 1), ClassId(1), round(1), vec![1.0], &mut rng)
        else {
            panic!("robot {author} is not heard")
        };
        let Some(SetChange::Seen(gone)) = changes.first() else { panic!("{changes:?}") };
        assert!(robot.seen().intervals(*gone).is_empty() && gone.author < RobotId(70_000));
    }
    let refused = robot.receive(id(80_000, 1), ClassId(1), round(1), vec![1.0], &mut rng);
    assert!(matches!(refused, SampleReceipt::Refused(SeenError::TooManyAuthors(_))));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn whoever_floods_a_robot_has_no_more_than_its_share_of_a_full_set(
        sent in prop::collection::vec((0..14_u32, 0..4_u8, any::<u8>()), 300..600),
        capacity in 20..80_usize, rules in rules(), seed: u64
    ) {
        const ALIVE: std::ops::Range<u32> = 1..5;
        let mut rng = generator(seed);
        let mut robot = set(capacity, rules.0, rules.1);
        robot.meet(Arc::new(ALIVE.map(RobotId).collect()));
        // An author that says more than all others, and strangers beside it.
        let mut numbers = BTreeMap::new();
        let mut own = 0;
        for (who, class, place) in sent {
            let author = if who < 5 { who } else if who < 10 { 2 } else { 100 + who };
            let (class, at) = (ClassId(class.into()), vec![f32::from(place), if author == 2 { 1e4 } else { 0.0 }]);
            if author == 0 {
                own += 1;
                robot.keep(class, round(1), at, &mut rng);
                continue;
            }
            let number = numbers.entry(author).and_modify(|n| *n += 1).or_insert(1);
            robot.receive(id(author, *number), class, round(1), at, &mut rng);
        }
        prop_assert_eq!(robot.len(), capacity);
        let each = 5.max((5 * capacity).div_ceil(20));
        for author in ALIVE {
            let held = robot.authors().find(|(a, _)| *a == RobotId(author)).map_or(0, |(_, held)| held);
            prop_assert!(held <= each, "robot {} has {} of {}", author, held, each);
        }
        let strange: usize = robot.authors().filter(|(a, _)| a.0 >= 100).map(|(_, held)| held).sum();
        prop_assert!(strange <= 5.max(capacity.div_ceil(4)), "strangers have {}", strange);
        let kept = robot.total(SetPart::Personal) + robot.total(SetPart::Shared);
        prop_assert!(kept >= own.min(5.max(capacity.div_ceil(5)).min(capacity / 2)), "{} own of {}", kept, own);
    }
}

#[test]
fn who_hides_has_no_more_than_who_is_there_and_takes_nothing_from_who_is_off() {
    let mut rng = generator(1);
    let mut robot = set(100, SelectionRule::Random, ForgettingRule::Fifo);
    robot.meet(Arc::new((0..10).map(RobotId).collect()));
    // Honest robots that are there, two that are off, and one that hides.
    let there = (1..10).map(|author| (author, 9));
    for (author, samples) in there.chain([(50, 8), (51, 8), (60, 200)]) {
        for number in 1..=samples {
            robot.receive(id(author, number), ClassId(1), round(1), vec![number as f32], &mut rng);
        }
    }
    let held = |author| robot.authors().find(|(a, _)| *a == RobotId(author)).map_or(0, |(_, held)| held);
    assert_eq!(robot.len(), 100);
    assert!(held(60) <= 13, "{}", held(60));
    assert!(held(50) > 0 && held(51) > 0, "{} and {}", held(50), held(51));
}

#[test]
fn a_robot_that_was_started_ever_so_often_still_shares_and_is_heard() {
    let mut rng = generator(1);
    let mut hearer = set(100, SelectionRule::Random, ForgettingRule::Fifo);
    let (mut stored, mut next_key) = (Vec::new(), 1);
    let mut seen = SeenSamples::default();
    for life in 1..300 {
        let mut robot =
            TrainingSet::new(RobotId(5), 100, SelectionRule::Random.build(), ForgettingRule::Fifo.build());
        robot = robot.in_life(life * 7919 % 1009);
        robot.restore(stored, seen, next_key).unwrap();
        // Of many lives those of the newest rounds are known.
        robot.keep(ClassId(0), round(life), vec![life as f32], &mut rng);
        let changes = robot.share(1, None, &as_is, &mut rng);
        let [.., SetChange::Shared(key, id)] = &changes[..] else { panic!("{changes:?}") };
        let sample = robot.get(*key).unwrap();
        let receipt = hearer.receive(*id, sample.class, sample.round, sample.vector.to_vec(), &mut rng);
        assert!(matches!(receipt, SampleReceipt::New(_)), "{receipt:?}");
        (stored, seen, next_key) = (robot.iter().cloned().collect(), robot.seen().clone(), robot.next_key());
        assert!(seen.series_count() <= gestalt_strategies::sample::MAX_LIVES);
    }
    assert_eq!(hearer.len(), gestalt_strategies::sample::MAX_LIVES);
}

#[test]
fn a_stored_set_that_contradicts_itself_is_refused() {
    let sample = |key, part, id| HeldSample {
        key,
        part,
        id,
        class: ClassId(0),
        round: round(1),
        vector: vec![1.0].into(),
    };
    let seen = |intervals: &[(u32, u32)]| {
        let (own, other) = (id(0, 1).series(), id(4, 1).series());
        SeenSamples::from_intervals([(own, intervals.to_vec()), (other, vec![(1, 3)])]).unwrap()
    };
    let (own, other) = (Some(id(0, 1)), Some(id(4, 2)));
    use SetPart::{External, Personal, Shared};
    for (samples, error) in [
        (vec![sample(1, Personal, None), sample(1, Personal, None)], RestoreError::Key(1)),
        (vec![sample(9, Personal, None)], RestoreError::KeyAhead { key: 9, next: 9 }),
        (vec![sample(1, External, other), sample(2, External, other)], RestoreError::Name(id(4, 2))),
        (vec![sample(1, Personal, own)], RestoreError::Part(1)),
        (vec![sample(1, Shared, other)], RestoreError::Part(1)),
        (vec![sample(1, External, own)], RestoreError::Part(1)),
        (vec![sample(1, External, None)], RestoreError::Part(1)),
        (vec![sample(1, External, Some(id(4, 4)))], RestoreError::Unseen(id(4, 4))),
    ] {
        let mut robot = set(10, SelectionRule::Novelty, ForgettingRule::Redundancy);
        assert_eq!(robot.restore(samples, seen(&[(1, 2)]), 9), Err(error));
        assert!(robot.is_empty() && robot.seen() == &SeenSamples::default());
    }
    let mut robot = set(10, SelectionRule::Novelty, ForgettingRule::Redundancy);
    assert_eq!(robot.restore(vec![], seen(&[]), u64::MAX), Err(RestoreError::NextKey(u64::MAX)));
}

#[test]
fn a_set_stored_under_a_greater_capacity_is_trimmed() {
    let mut rng = generator(1);
    let mut large = set(10, SelectionRule::Random, ForgettingRule::Redundancy);
    for i in 0..10 {
        large.keep(ClassId(i % 2), round(1), vec![(i * i) as f32], &mut rng);
    }
    let mut small = set(4, SelectionRule::Random, ForgettingRule::Redundancy);
    let samples = large.iter().cloned().collect();
    small.restore(samples, large.seen().clone(), large.next_key()).unwrap();
    assert_eq!(small.trim(&mut rng).len(), 6);
    assert_eq!(small.len(), 4);
    assert!(small.trim(&mut rng).is_empty());
}

/// A rule that always names the sample with this key, whatever it is.
#[derive(Debug)]
struct Stubborn(u64);

impl Selection for Stubborn {
    fn select(&mut self, _: &HeldSamples, _: Option<&dyn Classify>, _: &mut dyn Rng) -> Option<u64> {
        Some(self.0)
    }
}

impl Forgetting for Stubborn {
    fn victim(&mut self, _: &HeldSamples, _: &mut dyn Rng) -> Option<u64> {
        Some(self.0)
    }
}

#[test]
fn the_promises_hold_whatever_a_rule_says() {
    let mut rng = generator(1);
    // Key 2 is external, key 99 is nothing.
    for stubborn in [2, 99] {
        let mut robot = TrainingSet::new(ME, 3, Box::new(Stubborn(stubborn)), Box::new(Stubborn(99)));
        robot.keep(ClassId(0), round(1), vec![1.0], &mut rng);
        robot.receive(id(1, 1), ClassId(0), round(1), vec![1.0], &mut rng);
        robot.keep(ClassId(0), round(1), vec![1.0], &mut rng);
        assert_eq!(robot.share(5, None, &as_is, &mut rng), []);
        assert_eq!(robot.next_number(), 1);
        robot.keep(ClassId(0), round(1), vec![1.0], &mut rng);
        assert!(robot.iter().map(|sample| sample.key).eq([2, 3, 4]), "the oldest goes");
    }
    // The first is shared, and then named again.
    let mut robot = TrainingSet::new(ME, 3, Box::new(Stubborn(1)), Box::new(Stubborn(99)));
    robot.keep(ClassId(0), round(1), vec![1.0], &mut rng);
    assert_eq!(robot.share(5, None, &as_is, &mut rng), [SetChange::Shared(1, OWN.sample(1))]);
}

#[test]
fn vectors_of_other_lengths_are_compared_as_if_filled_up_with_zeros() {
    let mut rng = generator(1);
    let mut robot = set(3, SelectionRule::Novelty, ForgettingRule::Redundancy);
    robot.keep(ClassId(0), round(1), vec![1.0], &mut rng);
    robot.keep(ClassId(0), round(1), vec![1.0, 3.0, 0.0], &mut rng);
    robot.keep(ClassId(0), round(1), vec![], &mut rng);
    let changes = robot.keep(ClassId(0), round(1), vec![1.0, 2.5], &mut rng);
    let [_, SetChange::Removed(gone)] = &changes[..] else { panic!("{changes:?}") };
    assert!([2, 4].contains(&gone.key), "{gone:?}");
}
