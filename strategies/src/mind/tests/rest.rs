//! Repair comes to rest, also between robots that can never know the same.

use super::*;

impl Swarm {
    /// What robots tell each other from now on for so long.
    fn told_within(&mut self, time: Duration) -> BTreeMap<&'static str, (usize, usize)> {
        self.told.clear();
        self.pass(time);
        std::mem::take(&mut self.told)
    }

    pub(super) fn check_rest(&mut self) {
        let mut told = self.told_within(Duration::from_secs(60));
        // A robot that refuses a decision or a word is reminded of it now and then, by pauses that double: twice in this time at most.
        let reminders = 2 * self.minds.len() * (self.minds.len() - 1);
        if told.get("other").is_some_and(|(times, _)| *times <= reminders) {
            told.remove("other");
        }
        assert_eq!(told.keys().copied().collect::<Vec<_>>(), ["have"], "{told:?}");
    }
}

/// One robot hears that author share samples under these numbers of a life.
fn shares(swarm: &mut Swarm, i: usize, author: u32, life: u32, numbers: &[u32]) {
    shares_of_rounds(swarm, i, author, life, numbers, |_| 1);
}

/// The same of rounds of such counts.
fn shares_of_rounds(
    swarm: &mut Swarm,
    i: usize,
    author: u32,
    life: u32,
    numbers: &[u32],
    counter: impl Fn(u32) -> u32,
) {
    let sample = |number: &u32| SharedSample {
        id: SampleId { author: RobotId(author), life, number: *number },
        class: ClassId(number % 6),
        round: RoundId { counter: counter(*number), opener: RobotId(author), life: 0 },
        vector: Vector::F32(vec![(number % 1000) as f32 * 1e-3, 0.5, 0.5, 0.5]),
    };
    let samples = numbers.iter().map(sample).collect();
    let message = Message::Samples(Samples { space: space().id(), samples });
    let stamp = Stamp { boot: life, sequence: numbers[0] };
    swarm.input(i, Input::Received(Envelope { author: RobotId(author), stamp, message, signature: None }));
}

fn other_space() -> Arc<FeatureSpace> {
    let rows = [[0.0_f32; 8], [1.0; 8], [0.5, 0.0, 1.0, 0.2, 0.0, 1.0, 0.3, 0.1]];
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let rows = rows.iter().map(<[f32; 8]>::as_slice);
    let method = ScalingMethod::PerComponent;
    Arc::new(FeatureSpace::fit("other", rows, method, Components::Count(4), &mut rng))
}

/// With `GESTALT_LONG` ten thousand samples.
#[test]
fn robots_that_can_never_know_the_same_stop_telling_each_other() {
    let rounds = if std::env::var_os("GESTALT_LONG").is_some() { 400 } else { 80 };
    let spacing = Duration::from_millis(50);
    let mut swarm = Swarm::new(6, LearningConfig { capacity: 300, spacing, ..config(8, 1.0) }, 21);
    // The fifth learns in another space, the sixth knows fewer gestures.
    swarm.spaces[4] = other_space();
    swarm.vocabularies[5] = Vocabulary::new((0..4).map(|class| class.to_string())).unwrap();
    (4..6).for_each(|i| swarm.restart_empty(i));
    swarm.loss = 0.1;
    for class in 0..rounds {
        let round = swarm.show(class % CLASSES);
        swarm.was(round, class % CLASSES);
    }
    assert!(swarm.said.len() > 25 * rounds as usize, "{} samples", swarm.said.len());
    // The fourth has lost all, and meets robots that have forgotten most.
    swarm.restart_empty(3);
    swarm.loss = 0.0;
    swarm.pass(Duration::from_secs(30));
    swarm.check_rest();
    let held: Vec<usize> = swarm.minds.iter().map(|mind| mind.training_set().unwrap().len()).collect();
    assert!(held[..4].iter().all(|held| *held == 300), "{held:?}");

    // A new sample concerns them, what they settled does not.
    swarm.told.clear();
    let round = swarm.show(1);
    swarm.was(round, 1);
    swarm.pass(Duration::from_secs(60));
    let (_, bytes) = swarm.told.get("samples").copied().unwrap_or_default();
    assert!(bytes < 60_000, "{bytes} bytes of samples for 48 new ones");
    swarm.check_rest();
}

#[test]
fn a_newborn_that_meets_no_round_says_what_it_was_told() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 24);
    let round = swarm.show(1);
    swarm.was(round, 1);
    // Nobody holds the decision any more, and what the second hears does not go to its disk.
    swarm.spaces[1] = other_space();
    swarm.disks[1].clear();
    swarm.restart_all();
    swarm.pass(Duration::from_secs(10));
    let digests = swarm.minds.iter().map(|mind| mind.learning.as_ref().unwrap().digest_under(7).lessons);
    let digests: Vec<u64> = digests.collect();
    assert!(digests[0] == digests[1] && digests[0] != 0, "{digests:?}");
    swarm.check_rest();
}

#[test]
fn what_is_left_in_scattered_places_is_all_given() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 22);
    for batch in 0..20 {
        let numbers: Vec<u32> = (0..30).map(|i| 1 + 3 * (30 * batch + i)).collect();
        shares(&mut swarm, 0, 9, 5, &numbers);
    }
    swarm.pass(Duration::from_secs(20));
    assert_eq!((swarm.sizes(0), swarm.sizes(1)), ([0, 0, 600], [0, 0, 600]));
    swarm.check_rest();
}

#[test]
fn instructors_beyond_those_kept_are_not_told_again_and_again() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 23);
    let round = swarm.show(1);
    for i in 0..2 {
        for instructor in 0..16 {
            let (by, at) = (format!("of-{i}-{instructor}").parse().unwrap(), 1);
            let instruction = Instruction::Was { round, class: Gesture::Class(ClassId(1)) };
            swarm.input(i, Input::Instructed(Instructed { by, at, instruction, said: None }));
        }
    }
    swarm.pass(Duration::from_secs(10));
    assert!(swarm.minds[0].refusals().count(Refusal::LessonFull) > 0);
    swarm.check_rest();
}

#[test]
fn numbers_full_of_gaps_keep_no_robot_from_starting_again() {
    let mut swarm = Swarm::new(1, config(2, 1.0), 25);
    let numbers: Vec<u32> = (0..256).map(|i| 1 + 2 * i).collect();
    for life in 0..64 {
        numbers.chunks(64).for_each(|numbers| shares(&mut swarm, 0, 9, life, numbers));
    }
    // Each of these closes a gap of that one's.
    (10..20).for_each(|author| shares(&mut swarm, 0, author, 1, &[1]));
    let intervals = |swarm: &Swarm| {
        let seen = swarm.minds[0].training_set().unwrap().seen();
        seen.series().map(|series| seen.intervals(series).len()).sum::<usize>()
    };
    assert_eq!(intervals(&swarm), 64 * 256);
    swarm.check();
    swarm.restart(0);
    assert_eq!(intervals(&swarm), 64 * 256);
    swarm.check();
}

#[test]
fn numbers_that_no_newcomer_takes_let_repair_rest() {
    let mut swarm = Swarm::new(3, config(2, 1.0), 26);
    let last = crate::sample::LAST_NUMBER;
    for i in 0..2 {
        // The second overlaps the first and is not passed on; from then on those behind it are in reach.
        for numbers in [&[1, last + 5][..], &[last], &[last + 10_000, last + 10_001], &[last + 20_000]] {
            shares(&mut swarm, i, 9, 1, numbers);
        }
    }
    let round = swarm.show(1);
    swarm.was(round, 1);
    swarm.restart_empty(2);
    swarm.pass(Duration::from_secs(30));
    assert!(swarm.minds[2].refusals().count(Refusal::SampleNumber) > 0);
    swarm.check_rest();
}

#[test]
fn two_samples_under_one_number_are_found_where_both_come_by() {
    let mut swarm = Swarm::new(1, config(2, 1.0), 29);
    let share = |swarm: &mut Swarm, sequence: u32, at: f32, signed: bool| {
        let sample = SharedSample {
            id: SampleId { author: RobotId(9), life: 1, number: 1 },
            class: ClassId(1),
            round: RoundId { counter: 1, opener: RobotId(9), life: 0 },
            vector: Vector::F32(vec![at, 0.5, 0.5, 0.5]),
        };
        let samples = Samples { space: space().id(), samples: vec![sample] };
        let signature = signed.then(|| gestalt_protocol::Signature::from_bytes([sequence as u8; 64]));
        let (stamp, message) = (Stamp { boot: 1, sequence }, Message::Samples(samples));
        swarm.input(0, Input::Received(Envelope { author: RobotId(9), stamp, message, signature }));
        let found = swarm.minds[0].take_contradictions();
        found.into_iter().map(|(one, other)| [one.stamp.sequence, other.stamp.sequence]).collect::<Vec<_>>()
    };
    assert!(share(&mut swarm, 1, 0.25, true).is_empty());
    assert!(share(&mut swarm, 2, 0.25, true).is_empty(), "the same again");
    assert!(share(&mut swarm, 3, 0.5, false).is_empty(), "whoever signs nothing can be nobody");
    assert_eq!(share(&mut swarm, 4, 0.5, true), [[1, 4]]);
    for _ in 0..3 {
        assert_eq!(share(&mut swarm, 5, 0.5, true), [[1, 5]], "once each time");
    }
}

#[test]
fn who_shares_much_keeps_nobody_else_from_being_passed_on() {
    let mut swarm = Swarm::new(2, LearningConfig { capacity: 5000, ..config(2, 1.0) }, 27);
    for batch in 0..60 {
        let numbers: Vec<u32> = (0..64).map(|i| 1 + 64 * batch + i).collect();
        shares(&mut swarm, 0, 5, 1, &numbers);
    }
    shares(&mut swarm, 0, 9, 1, &[1]);
    let learning = swarm.minds[0].learning.as_ref().unwrap();
    let first = learning.lacking(|_| true, 16 * 1024).next().unwrap();
    assert!(first.batches.iter().any(|batch| batch.robot == RobotId(9)), "each in turn");
}

#[test]
fn what_a_full_list_leaves_out_is_not_given_again_and_again() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 28);
    let round = swarm.show(1);
    // One that it did not live through: that it would keep, however full its list.
    let another = RoundId { opener: RobotId(9), ..round };
    let instructor = "ada".parse().unwrap();
    let word = Word::Was(ClassId(1));
    let lesson = Lesson { round: another, instructor, count: 1, at: 1, word, said: None };
    swarm.minds[0].learning.as_mut().unwrap().hear(&lesson);
    swarm.pass(Duration::from_secs(10));
    let told = |first: u32| {
        let name = |counter| RoundId { counter, opener: RobotId(2), life: 0 };
        let lessons = (0..gestalt_protocol::MAX_LESSONS as u32).map(|i| (name(first + i), 1)).collect();
        let digest = gestalt_protocol::Digest { key: 1, samples: 0, lessons: 3 };
        let know = gestalt_protocol::Know {
            samples: Vec::new(),
            lessons,
            named: 0,
            digest,
            answer: true,
            nothing_for: None,
        };
        let stamp = Stamp { boot: u32::MAX, sequence: first };
        Input::Received(Envelope { author: RobotId(2), stamp, message: Message::Know(know), signature: None })
    };
    swarm.told.clear();
    swarm.input(0, told(round.counter + 1));
    assert!(!swarm.told.contains_key("lessons"), "that round lies before all of its list");
    swarm.input(0, told(round.counter - 1));
    assert!(swarm.told.contains_key("lessons"), "that one is missing in it");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

    #[test]
    fn whatever_is_lost_and_forgotten_repair_comes_to_rest(
        seed in any::<u64>(), capacity in 2..40_usize, other in any::<bool>(), loss in 0.0..0.6_f64,
        events in prop::collection::vec((0..3_u8, 0..4_usize), 1..12),
    ) {
        let spacing = Duration::from_millis(50);
        let mut swarm = Swarm::new(4, LearningConfig { capacity, aside: 1000, spacing, ..config(3, 1.0) }, seed);
        if other {
            swarm.spaces[2] = other_space();
            swarm.restart_empty(2);
        }
        swarm.loss = loss;
        for (what, who) in events {
            match what {
                0 => swarm.restart(who),
                1 => swarm.restart_empty(who),
                _ => {
                    let class = who as u32;
                    let round = swarm.show(class);
                    swarm.was(round, class);
                }
            }
        }
        swarm.loss = 0.0;
        swarm.pass(Duration::from_secs(60));
        swarm.check_rest();
        swarm.check();
    }
}

#[test]
fn a_life_that_is_let_go_of_stays_on_no_shelf() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 30);
    swarm.loss = 1.0;
    let oldest = RoundId { counter: 1, opener: RobotId(9), life: 0 };
    let lesson = Lesson {
        round: oldest,
        instructor: "ada".parse().unwrap(),
        count: 1,
        at: 1,
        word: Word::Not(ClassId(1)),
        said: None,
    };
    swarm.minds[0].learning.as_mut().unwrap().hear(&lesson);
    shares_of_rounds(&mut swarm, 0, 9, 1, &[1, 2], |_| 1);
    let offered = |swarm: &Swarm| {
        let learning = swarm.minds[0].learning.as_ref().unwrap();
        let told = learning.lacking(|id| id.life == 1, 1 << 20).flat_map(|told| told.batches);
        told.map(|batch| batch.samples.samples.len()).sum::<usize>()
    };
    let aside = |swarm: &Swarm| swarm.minds[0].learned().unwrap().aside;
    assert_eq!((aside(&swarm), offered(&swarm)), (2, 2), "what it shows is open");
    let before = swarm.disks[0].clone();
    for life in 2..=crate::sample::MAX_LIVES as u32 + 1 {
        shares_of_rounds(&mut swarm, 0, 9, life, &[1], |_| life);
    }
    assert_eq!((aside(&swarm), offered(&swarm)), (0, 0));
    swarm.check();
    // As releases left it on the disk that kept it there.
    let left: Vec<_> = before.into_iter().filter(|(key, _)| [5, 6].contains(&key[0])).collect();
    assert_eq!(left.len(), 3, "two samples, and their batch");
    swarm.disks[0].extend(left);
    swarm.restart(0);
    assert_eq!((aside(&swarm), offered(&swarm)), (0, 0));
    swarm.check();
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn of_more_lives_than_are_kept_all_robots_keep_the_newest_and_repair_comes_to_rest(
        seed in any::<u64>(), has_room in any::<bool>(),
        counters in prop::collection::vec(1..60_u32, 75),
        heard in prop::collection::vec(1..16_u8, 75),
        order in Just((0..75_usize).collect::<Vec<_>>()).prop_shuffle(),
        again in prop::option::of(0..4_usize),
    ) {
        // Where an author's share is full, most of what was seen of each life is forgotten.
        let capacity = if has_room { 2000 } else { 200 };
        let mut swarm = Swarm::new(4, LearningConfig { capacity, ..config(2, 1.0) }, seed);
        let life = |nth: usize| 7 + (nth as u32).wrapping_mul(2_654_435_761);
        for nth in order {
            for i in (0..4).filter(|i| heard[nth] >> i & 1 == 1) {
                let counter = |number| counters[nth] + 7 * (number % 3);
                shares_of_rounds(&mut swarm, i, 9, life(nth), &[1, 2, 3], counter);
            }
        }
        swarm.pass(Duration::from_secs(120));
        swarm.check_rest();
        if let Some(i) = again {
            swarm.restart(i);
            swarm.pass(Duration::from_secs(120));
            swarm.check_rest();
        }
        swarm.check();
        let mut newest: Vec<(u32, u32)> = (0..75).map(|nth| (counters[nth] + 14, life(nth))).collect();
        newest.sort_unstable();
        let newest: BTreeSet<u32> = newest.iter().rev().take(64).map(|(_, life)| *life).collect();
        for mind in swarm.minds.iter().filter(|_| has_room) {
            let seen = mind.training_set().unwrap().seen();
            let lives: BTreeSet<u32> = seen.lives(RobotId(9)).map(|series| series.life).collect();
            prop_assert_eq!(&lives, &newest);
        }
    }
}
