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
    let sample = |number| SharedSample {
        id: SampleId { author: RobotId(9), life: 5, number },
        class: ClassId(number % 6),
        round: RoundId { counter: 1, opener: RobotId(9), life: 0 },
        vector: Vector::F32(vec![number as f32 * 1e-3, 0.5, 0.5, 0.5]),
    };
    for batch in 0..20 {
        let samples = (0..30).map(|i| sample(1 + 3 * (30 * batch + i))).collect();
        let message = Message::Samples(Samples { space: space().id(), samples });
        let stamp = Stamp { boot: 1, sequence: batch };
        swarm.input(0, Input::Received(Envelope { author: RobotId(9), stamp, message, signature: None }));
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
