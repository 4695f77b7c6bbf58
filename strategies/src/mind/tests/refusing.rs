//! What is not taken in.

use super::*;

#[test]
fn a_sample_that_is_none_is_refused_and_counted() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 11);
    let space = space().id();
    let sample = |number, class, vector| SharedSample {
        id: SampleId { author: RobotId(9), life: 5, number },
        class: ClassId(class),
        round: RoundId { counter: 1, opener: RobotId(9), life: 0 },
        vector,
    };
    let sound = Vector::F32(vec![0.5; 4]);
    for (space, sample, refusal) in [
        (FeatureSpaceId(1), sample(1, 1, sound.clone()), Refusal::OtherSpace),
        (space, sample(1, 1, Vector::F32(vec![0.5; 3])), Refusal::BadVector),
        (space, sample(1, 1, Vector::I8(vec![1; 5])), Refusal::BadVector),
        (space, sample(1, 1, Vector::F32(vec![0.5, f32::NAN, 0.5, 0.5])), Refusal::BadVector),
        (space, sample(1, 1, Vector::F16(vec![0, 0x7c, 0, 0, 0, 0, 0, 0])), Refusal::BadVector),
        (space, sample(1, CLASSES, sound.clone()), Refusal::UnknownClass),
        (space, sample(u32::MAX, 1, sound.clone()), Refusal::SampleNumber),
    ] {
        let before = swarm.minds[0].refusals().count(refusal);
        let message = Message::Samples(Samples { space, samples: vec![sample] });
        let stamp = Stamp { boot: 1, sequence: 1 };
        swarm.input(0, Input::Received(Envelope { author: RobotId(9), stamp, message }));
        assert_eq!(swarm.minds[0].refusals().count(refusal), before + 1, "{refusal:?}");
        assert_eq!(swarm.sizes(0), [0, 0, 0]);
    }
    let message = Message::Samples(Samples { space, samples: vec![sample(1, 1, sound)] });
    let stamp = Stamp { boot: 1, sequence: 2 };
    swarm.input(0, Input::Received(Envelope { author: RobotId(9), stamp, message }));
    assert_eq!(swarm.sizes(0), [0, 0, 1], "a sound one is taken");
    swarm.check();
}

#[test]
fn a_memory_of_another_robot_or_space_is_refused() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 12);
    let round = swarm.show(1);
    swarm.was(round, 1);
    let records = swarm.disks[0].iter().map(|(key, value)| (key.as_slice(), value.as_slice()));
    let memory = RobotMemory::read(records).unwrap();
    let setup = |space: Arc<FeatureSpace>, vocabulary| LearningSetup {
        config: config(2, 1.0),
        space,
        vocabulary,
        rng: Box::new(ChaCha8Rng::seed_from_u64(1)),
        memory: Some(memory.clone()),
        rules: OwnRules::default(),
    };
    let new = |me, setup| Learning::new(RobotId(me), 1, setup).map(|_| ());
    assert_eq!(new(1, setup(space(), vocabulary())), Ok(()));
    let robot = new(2, setup(space(), vocabulary())).unwrap_err();
    assert!(matches!(robot, LearningError::Memory(MemoryError::Robot { .. })));
    let other = Vocabulary::new(["a", "b", "c", "d", "e", "f"]).unwrap();
    let vocabulary_error = new(1, setup(space(), other)).unwrap_err();
    assert_eq!(vocabulary_error, LearningError::Memory(MemoryError::Vocabulary));
    let rows = [[0.0_f32; 8], [1.0; 8]];
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let rows = rows.iter().map(<[f32; 8]>::as_slice);
    let other = FeatureSpace::fit("test", rows, ScalingMethod::PerComponent, Components::Count(1), &mut rng);
    let space_error = new(1, setup(Arc::new(other), vocabulary())).unwrap_err();
    assert!(matches!(space_error, LearningError::Memory(MemoryError::Space { .. })));
}

fn lessons(swarm: &mut Swarm, i: usize, lessons: Vec<Lesson>) {
    let stamp = Stamp { boot: 1, sequence: 1 };
    let message = Message::Lessons(gestalt_protocol::Lessons { lessons });
    swarm.input(i, Input::Received(Envelope { author: RobotId(9), stamp, message }));
}

fn forged(round: RoundId, who: &str, count: u64, word: Word) -> Lesson {
    Lesson { round, instructor: who.parse().unwrap(), count, at: u64::MAX, word }
}

#[test]
fn lessons_on_rounds_to_come_keep_nobody_from_teaching() {
    let mut swarm = Swarm::new(3, config(2, 1.0), 31);
    let first = swarm.show(1);
    let to_come = |i| {
        let round = RoundId { counter: u32::MAX - i, opener: RobotId(1), life: 0 };
        forged(round, "eve", 1, Word::Was(ClassId(1)))
    };
    lessons(&mut swarm, 0, (0..1024).map(to_come).collect());
    assert_eq!(swarm.minds[0].refusals().count(Refusal::LessonFarAhead), 1024);
    // As far ahead as may be, under many names.
    let near = |i: u32| {
        let round = RoundId { counter: first.counter + i % 64, opener: RobotId(u32::MAX), life: i };
        forged(round, "eve", 1, Word::Was(ClassId(1)))
    };
    for part in 0..4 {
        lessons(&mut swarm, 0, (0..1024).map(|i| near(1024 * part + i)).collect());
    }
    swarm.pass(Duration::from_secs(10));
    for class in [2, 3] {
        let round = swarm.show(class);
        let at = swarm.was(round, class);
        assert_eq!(swarm.outcome(at), Outcome::Learned);
        for mind in &swarm.minds {
            assert_eq!(mind.training_set().unwrap().class_count(ClassId(class)), 6);
        }
    }
    swarm.restart(0);
    swarm.pass(Duration::from_secs(1));
    assert!(swarm.show(4).counter <= first.counter + 3 + 64, "the counters are not run up");
}

#[test]
fn what_a_newborn_was_told_of_rounds_to_come_is_forgotten_when_it_knows_better() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 32);
    let far = RoundId { counter: 900_000, opener: RobotId(1), life: 0 };
    lessons(&mut swarm, 0, vec![forged(far, "eve", 1, Word::Was(ClassId(1)))]);
    assert_eq!(swarm.minds[0].learned().unwrap().lessons, 1);
    let round = swarm.show(1);
    swarm.was(round, 1);
    swarm.pass(Duration::from_secs(10));
    assert_eq!(swarm.minds.iter().map(|mind| mind.learned().unwrap().lessons).collect::<Vec<_>>(), [1, 1]);
    swarm.check();
}

#[test]
fn an_instructor_can_correct_whatever_was_said_in_its_name() {
    let mut swarm = Swarm::new(3, config(2, 1.0), 33);
    let round = swarm.show(1);
    swarm.was(round, 1);
    lessons(&mut swarm, 0, vec![forged(round, "ada", 1 << 32, Word::Retracted)]);
    lessons(&mut swarm, 0, (0..16).map(|i| forged(round, &format!("eve{i}"), 9, Word::Retracted)).collect());
    swarm.pass(Duration::from_secs(10));
    let at = swarm.was(round, 5);
    assert_eq!(swarm.outcome(at), Outcome::Learned);
    swarm.pass(Duration::from_secs(10));
    for mind in &swarm.minds {
        assert_eq!(mind.training_set().unwrap().class_count(ClassId(5)), 6);
    }
}

#[test]
fn no_clock_orders_the_words_of_an_instructor() {
    let mut swarm = Swarm::new(3, config(2, 1.0), 34);
    let round = swarm.show(1);
    for (at, class) in [(u64::MAX, 1), (500, 2), (400, 3)] {
        let instruction = Instruction::Was { round, class: Gesture::Class(ClassId(class)) };
        for i in 0..3 {
            let instructed = Instructed { by: "ada".parse().unwrap(), at, instruction: instruction.clone() };
            swarm.input(i, Input::Instructed(instructed));
        }
        swarm.pass(Duration::from_secs(5));
        for mind in &swarm.minds {
            assert_eq!(mind.training_set().unwrap().class_count(ClassId(class)), 6);
        }
    }
}
