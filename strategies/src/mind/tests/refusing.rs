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
    let in_anothers_name = {
        let theirs = sample(1, 1, sound.clone());
        SharedSample { id: SampleId { author: RobotId(8), ..theirs.id }, ..theirs }
    };
    for (space, sample, refusal) in [
        (space, in_anothers_name, Refusal::Impossible),
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
        swarm.input(0, Input::Received(Envelope { author: RobotId(9), stamp, message, signature: None }));
        assert_eq!(swarm.minds[0].refusals().count(refusal), before + 1, "{refusal:?}");
        assert_eq!(swarm.sizes(0), [0, 0, 0]);
    }
    let message = Message::Samples(Samples { space, samples: vec![sample(1, 1, sound)] });
    let stamp = Stamp { boot: 1, sequence: 2 };
    swarm.input(0, Input::Received(Envelope { author: RobotId(9), stamp, message, signature: None }));
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
    let new = |me, setup| Learning::new(RobotId(me), 1, false, setup).map(|_| ());
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

#[test]
fn records_without_a_head_are_refused_whichever_they_are() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 13);
    swarm.say("ana", Instruction::New { label: "circle".to_owned(), round: None });
    let round = swarm.show(1);
    swarm.was(round, 1);
    let round = swarm.show(2);
    swarm.say("ada", Instruction::Wrong { round, of: Gesture::Class(ClassId(2)) });
    let mut records = swarm.disks[0].clone();
    records.remove(&vec![0]);
    assert!(records.keys().map(|key| key[0]).collect::<BTreeSet<u8>>().into_iter().eq(1..=7));
    let aside = records.iter().find(|(key, _)| key[0] == 5).map(|(_, value)| value.clone()).unwrap();
    records.insert([&[5][..], &[u8::MAX; 8]].concat(), aside);
    for (key, value) in &records {
        let memory = RobotMemory::read([(key.as_slice(), value.as_slice())]).unwrap();
        let setup = LearningSetup {
            config: config(2, 1.0),
            space: space(),
            vocabulary: vocabulary(),
            rng: Box::new(ChaCha8Rng::seed_from_u64(1)),
            memory: Some(memory),
            rules: OwnRules::default(),
        };
        let refused = Learning::new(RobotId(1), 1, false, setup).map(|_| ()).unwrap_err();
        assert!(matches!(refused, LearningError::Memory(MemoryError::Damaged(_))), "{key:?}: {refused}");
    }
}

fn lessons(swarm: &mut Swarm, i: usize, lessons: Vec<Lesson>) {
    let stamp = Stamp { boot: 1, sequence: 1 };
    let message = Message::Lessons(gestalt_protocol::Lessons { lessons });
    swarm.input(i, Input::Received(Envelope { author: RobotId(9), stamp, message, signature: None }));
}

fn forged(round: RoundId, who: &str, count: u64, word: Word) -> Lesson {
    Lesson { round, instructor: who.parse().unwrap(), count, at: u64::MAX, word, said: None }
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
    assert_eq!(swarm.show(4).counter, first.counter + 3, "the counters are not run up");
}

#[test]
fn words_on_names_that_are_not_taken_in_are_counted() {
    let mut swarm = Swarm::new(1, config(1, 1.0), 38);
    let mut told = |labels: std::ops::Range<usize>, count| {
        let by: gestalt_protocol::InstructorId = "eve".parse().unwrap();
        let namings = labels.map(|label| gestalt_protocol::Naming {
            by: by.clone(),
            label: label.to_string(),
            count,
            at: 1,
            said_by: by.clone(),
            fate: gestalt_protocol::Fate::InUse,
            said: None,
        });
        let message = Message::Namings(gestalt_protocol::Namings { namings: namings.collect() });
        let stamp = Stamp { boot: 1, sequence: 1 };
        swarm.input(0, Input::Received(Envelope { author: RobotId(9), stamp, message, signature: None }));
        [Refusal::NamingFarAhead, Refusal::NamingFull].map(|cause| swarm.minds[0].refusals().count(cause))
    };
    let most = gestalt_protocol::MAX_NAMED;
    assert_eq!(told(0..3, u64::MAX), [3, 0]);
    assert_eq!(told(0..most, 1), [3, 0]);
    let [_, before] = told(most..most + 10, 1);
    // Ten of them are none of those that are kept, whichever they are.
    let again = [told(0..most, 1), told(most..most + 10, 1)];
    assert_eq!(again[1], [3, before + 10]);
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
fn a_newborn_that_starts_again_counts_from_no_round_that_it_was_only_told_of() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 36);
    let told = |counter| {
        let round = RoundId { counter, opener: RobotId(1), life: 0 };
        forged(round, "eve", 1, Word::Was(ClassId(1)))
    };
    lessons(&mut swarm, 0, vec![told(900_000), told(3)]);
    swarm.pass(Duration::from_secs(10));
    assert_eq!(swarm.minds.iter().map(|mind| mind.learned().unwrap().lessons).collect::<Vec<_>>(), [2, 2]);
    swarm.restart_all();
    lessons(&mut swarm, 0, vec![told(900_000), told(3)]);
    let round = swarm.show(1);
    assert_eq!(round.counter, 1);
    swarm.was(round, 1);
    // What it was told that can be true is kept from then on, and written when it is known to be.
    swarm.pass(Duration::from_secs(10));
    assert_eq!(swarm.minds.iter().map(|mind| mind.learned().unwrap().lessons).collect::<Vec<_>>(), [2, 2]);
    swarm.restart_all();
    assert_eq!(swarm.show(2).counter, 2);
    lessons(&mut swarm, 0, vec![told(3)]);
    assert_eq!(swarm.show(3).counter, 3);
    swarm.pass(Duration::from_secs(10));
    swarm.restart_all();
    assert_eq!(swarm.minds.iter().map(|mind| mind.learned().unwrap().lessons).collect::<Vec<_>>(), [2, 2]);
    assert_eq!(swarm.show(4).counter, 4);
}

#[test]
fn what_is_said_of_rounds_to_come_ends_none_at_robots_that_start_again_or_are_new() {
    let mut swarm = Swarm::new(3, config(2, 1.0), 37);
    let first = swarm.show(1);
    swarm.was(first, 1);
    let to_come = || {
        let round = |counter| RoundId { counter, ..first };
        let lesson = |counter| forged(round(counter), "eve", 1, Word::Retracted);
        (first.counter + 1..first.counter + 9).map(lesson).collect::<Vec<_>>()
    };
    lessons(&mut swarm, 1, to_come());
    swarm.pass(Duration::from_secs(10));
    swarm.restart(1);
    // A newborn, which knows of no round when it is told.
    swarm.loss = 1.0;
    swarm.restart_empty(2);
    lessons(&mut swarm, 2, to_come());
    swarm.loss = 0.0;
    swarm.pass(Duration::from_secs(10));
    assert_eq!(swarm.minds.iter().map(|mind| mind.learned().unwrap().lessons).collect::<Vec<_>>(), [9; 3]);
    for class in [2, 3, 4] {
        let round = swarm.show(class);
        assert_eq!(
            round,
            RoundId { counter: first.counter + class - 1, ..first },
            "or this test is of no use"
        );
        assert!(swarm.minds.iter().all(|mind| mind.round() == Some(round)));
        swarm.was(round, class);
        for mind in &swarm.minds {
            let learned = mind.training_set().unwrap().class_count(ClassId(class));
            assert_eq!(learned, 6, "robot {} of {class}", mind.me());
        }
        // In the midst of what was said it starts again, too.
        swarm.restart(1);
        swarm.pass(Duration::from_secs(10));
    }
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
            let instructed =
                Instructed { by: "ada".parse().unwrap(), at, instruction: instruction.clone(), said: None };
            swarm.input(i, Input::Instructed(instructed));
        }
        swarm.pass(Duration::from_secs(5));
        for mind in &swarm.minds {
            assert_eq!(mind.training_set().unwrap().class_count(ClassId(class)), 6);
        }
    }
}

#[test]
fn a_question_in_the_name_of_another_brings_no_flood_upon_it() {
    let mut swarm = Swarm::new(3, config(2, 1.0), 35);
    let sample = |number| SharedSample {
        id: SampleId { author: RobotId(9), life: 5, number },
        class: ClassId(1),
        round: RoundId { counter: 1, opener: RobotId(9), life: 0 },
        vector: Vector::F32(vec![number as f32 * 1e-3, 0.5, 0.5, 0.5]),
    };
    let message =
        Message::Samples(Samples { space: space().id(), samples: (1..=1000).map(sample).collect() });
    let stamp = Stamp { boot: 1, sequence: 1 };
    for i in 0..3 {
        swarm.input(
            i,
            Input::Received(Envelope {
                author: RobotId(9),
                stamp,
                message: message.clone(),
                signature: None,
            }),
        );
    }
    swarm.pass(Duration::from_secs(10));
    let ask = |swarm: &mut Swarm, author| {
        swarm.told.clear();
        let digest = gestalt_protocol::Digest { key: 1, samples: 2, lessons: 3 };
        let (samples, lessons) = (vec![], vec![]);
        let know =
            gestalt_protocol::Know { samples, lessons, digest, answer: true, nothing_for: None, named: 0 };
        for _ in 0..1000 {
            let message = Message::Know(know.clone());
            let out = swarm.minds[0]
                .handle(swarm.now, Input::Received(Envelope { author, stamp, message, signature: None }));
            let told = out.iter().filter(|output| matches!(output, Output::Tell(..)));
            swarm.told.entry("all").or_default().0 += told.count();
        }
        swarm.told["all"].0
    };
    assert_eq!(ask(&mut swarm, RobotId(7)), 0, "no neighbour");
    assert_eq!(swarm.minds[0].refusals().count(Refusal::Stranger), 1000);
    let told = ask(&mut swarm, RobotId(2));
    assert!((1..=128).contains(&told), "{told} messages for 1000 questions");
    assert!(swarm.minds[0].refusals().count(Refusal::TooOften) > 0);
    swarm.pass(Duration::from_secs(10));
    let again = ask(&mut swarm, RobotId(2));
    assert!((1..=128).contains(&again), "who waited is answered again: {again}");
}

#[test]
fn what_was_chosen_to_look_alike_is_found_all_the_same() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 36);
    let sample = |number| SharedSample {
        id: SampleId { author: RobotId(9), life: 5, number },
        class: ClassId(1),
        round: RoundId { counter: 1, opener: RobotId(9), life: 0 },
        vector: Vector::F32(vec![number as f32 * 1e-3, 0.5, 0.5, 0.5]),
    };
    // The key that the second robot told last is known; it is not the one that it will compare under.
    let before = swarm.minds[1].learning.as_ref().unwrap().digest();
    let message = Message::Samples(Samples { space: space().id(), samples: vec![sample(1)] });
    let stamp = Stamp { boot: 1, sequence: 1 };
    swarm.input(1, Input::Received(Envelope { author: RobotId(9), stamp, message, signature: None }));
    let after = swarm.minds[1].learning.as_ref().unwrap().digest();
    assert_ne!(before.key, after.key);
    swarm.pass(Duration::from_secs(10));
    assert_eq!(swarm.sizes(0), [0, 0, 1]);
}
