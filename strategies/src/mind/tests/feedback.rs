//! What instructors say, and what comes of it.

use gestalt_protocol::SignedWord;

use super::*;

#[test]
fn a_correction_reaches_all_also_who_was_away() {
    let mut swarm = Swarm::new(3, config(3, 1.0), 6);
    let round = swarm.show(1);
    swarm.was(round, 1);
    // The third hears nothing of the correction.
    let at = swarm.now.as_millis() as u64;
    for i in 0..2 {
        let instruction = Instruction::Was { round, class: Gesture::Label("4".to_owned()) };
        swarm.input(
            i,
            Input::Instructed(Instructed { by: "ada".parse().unwrap(), at, instruction, said: None }),
        );
    }
    swarm.pass(Duration::from_secs(10));
    assert_eq!(swarm.outcome(at), Outcome::Learned);
    for mind in &swarm.minds {
        assert_eq!(mind.training_set().unwrap().class_count(ClassId(4)), 9);
        assert_eq!(mind.training_set().unwrap().class_count(ClassId(1)), 0);
    }
    swarm.check();
}

/// All are switched off and on, the opener's disk is gone, so its first round has the count of yesterday's; and somebody calls it by that one's name.
#[test]
fn what_was_said_yesterday_labels_nothing_of_today() {
    let mut swarm = Swarm::new(3, config(3, 1.0), 31);
    let yesterday = swarm.show(1);
    swarm.was(yesterday, 1);
    swarm.disks[0].clear();
    swarm.restart_all();
    swarm.input(0, Input::Open);
    let vote = Vote {
        round: yesterday,
        vocabulary: VocabularyId::NONE,
        evidence: vec![],
        looks: 0.0,
        unknown: None,
        named: vec![],
    };
    for i in 0..3 {
        let stamp = Stamp { boot: 1, sequence: 1 };
        let message = Message::Vote(vote.clone());
        let said = Envelope { author: RobotId(9), stamp, message, signature: None };
        swarm.input(i, Input::Received(said));
    }
    let today = swarm.show(2);
    assert_eq!(today.counter, yesterday.counter, "or this test is of no use");
    assert_ne!(today, yesterday);
    swarm.was(today, 2);
    swarm.pass(Duration::from_secs(10));
    for mind in &swarm.minds {
        let of = |class| mind.training_set().unwrap().class_count(ClassId(class));
        assert_eq!((of(1), of(2)), (9, 9), "robot {}", mind.me());
    }
    swarm.check();
}

#[test]
fn what_is_taken_back_is_forgotten_and_what_is_said_then_counts() {
    let mut swarm = Swarm::new(3, config(3, 1.0), 7);
    let round = swarm.show(1);
    swarm.was(round, 1);
    let at = swarm.say("ada", Instruction::Retract { round });
    assert_eq!(swarm.outcome(at), Outcome::Learned);
    for i in 0..3 {
        assert_eq!(swarm.sizes(i), [0, 0, 0]);
    }
    swarm.check();
    swarm.restart(2);
    swarm.was(round, 5);
    for i in 0..3 {
        assert_eq!(swarm.sizes(i), [0, 3, 6], "robot {} has them back, once", i + 1);
        assert_eq!(swarm.minds[i].training_set().unwrap().class_count(ClassId(5)), 9);
    }
    assert_eq!(swarm.said.len(), 9, "nothing is shared again");
    swarm.check();
}

#[test]
fn who_takes_back_what_they_did_not_say_is_told_so_by_all_that_know_of_no_word() {
    let mut swarm = Swarm::new(3, config(3, 1.0), 16);
    let round = swarm.show(1);
    swarm.was(round, 1);
    for _ in 0..2 {
        let at = swarm.say("bob", Instruction::Retract { round });
        assert_eq!(swarm.outcome(at), Outcome::Known);
    }
    for mind in &swarm.minds {
        assert_eq!(mind.training_set().unwrap().class_count(ClassId(1)), 9, "what another said stands");
    }
    // One robot alone heard what is taken back: it answers for all.
    swarm.loss = 1.0;
    let at = swarm.now.as_millis() as u64;
    let said = |at, instruction| {
        Input::Instructed(Instructed { by: "cyn".parse().unwrap(), at, instruction, said: None })
    };
    swarm.input(2, said(at, Instruction::Was { round, class: Gesture::Class(ClassId(1)) }));
    (0..3).for_each(|i| swarm.input(i, said(at + 1, Instruction::Retract { round })));
    swarm.pass(Duration::from_secs(3));
    assert_eq!(swarm.outcome(at + 1), Outcome::Learned);
    swarm.loss = 0.0;
    swarm.pass(Duration::from_secs(10));
    swarm.check();
}

#[test]
fn right_and_wrong_are_about_the_decision() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 8);
    let round = swarm.show(3);
    let at = swarm.say("ada", Instruction::Right { round, of: Gesture::Class(ClassId(3)) });
    assert_eq!(swarm.outcome(at), Outcome::Learned);
    assert_eq!(swarm.minds[1].training_set().unwrap().class_count(ClassId(3)), 4);
    let round = swarm.show(2);
    let at = swarm.say("ada", Instruction::Wrong { round, of: Gesture::Label("2".to_owned()) });
    assert_eq!(swarm.outcome(at), Outcome::Learned, "what was seen is kept until its name is known");
    assert_eq!(swarm.minds[0].training_set().unwrap().class_count(ClassId(2)), 0);
    assert_eq!(swarm.minds[0].learned().unwrap().aside, 2);
    swarm.restart(0);
    assert_eq!(swarm.minds[0].learned().unwrap().aside, 2);
    let guessed =
        |swarm: &Swarm| swarm.trained[0].range(training_key(0)..).map(|(_, c)| *c).collect::<Vec<_>>();
    assert_eq!(guessed(&swarm), [ClassId(4); 2], "without 2, the classifier is sure of 4");
    assert_eq!(swarm.said.len(), 4, "a guess is shared with nobody");
    swarm.was(round, 5);
    assert_eq!(guessed(&swarm), [], "what is said counts more");
    assert_eq!(swarm.minds[0].training_set().unwrap().class_count(ClassId(5)), 4);
    swarm.check();
}

#[test]
fn every_word_is_answered_once() {
    let mut swarm = Swarm::new(3, config(2, 1.0), 9);
    let round = swarm.show(1);
    let unknown = RoundId { counter: 77, opener: RobotId(1), life: 0 };
    let was = |round, class: &str| Instruction::Was { round, class: Gesture::Label(class.to_owned()) };
    for (instruction, outcome) in [
        (was(round, "1"), Outcome::Learned),
        (was(round, "1"), Outcome::Known),
        (was(round, "seven"), Outcome::UnknownGesture),
        (was(unknown, "1"), Outcome::UnknownRound),
        (Instruction::Right { round: unknown, of: Gesture::Class(ClassId(1)) }, Outcome::UnknownRound),
    ] {
        let at = swarm.say("ada", instruction.clone());
        assert_eq!(swarm.outcome(at), outcome, "{instruction:?}");
    }
    let at = swarm.say("bob", was(round, "1"));
    assert_eq!(swarm.outcome(at), Outcome::Learned, "another instructor's word is a new one");
}

/// What is signed all robots hear, and one says for all that it is not allowed.
#[test]
fn what_was_said_to_one_robot_alone_and_is_not_allowed_it_answers_at_once() {
    let refused = |said: Option<SignedWord>| {
        let mut mind = Mind::new(RobotId(3), Life { boot: 1, nonce: 7 }, RoundsConfig::default()).unwrap();
        mind.handle(Duration::ZERO, Input::Alive(Arc::new([1, 2, 3].map(RobotId).into())));
        let (by, instruction) = ("ada".parse().unwrap(), Instruction::Open);
        let now = Duration::from_secs(1);
        let mut out = mind.handle(now, Input::Disallowed(Instructed { by, at: 1, instruction, said }));
        out.extend(mind.handle(now, Input::Tick));
        out.iter().any(|it| matches!(it, Output::Answer(_, answer) if answer.outcome == Outcome::NotAllowed))
    };
    assert!(refused(None));
    assert!(
        !refused(Some(SignedWord { word: vec![], attachment: vec![] })),
        "it leaves that to the others first"
    );
}

#[test]
fn who_does_not_learn_says_so() {
    let mut mind = Mind::new(RobotId(1), Life { boot: 1, nonce: 7 }, RoundsConfig::default()).unwrap();
    let round = RoundId { counter: 1, opener: RobotId(1), life: 0 };
    let instruction = Instruction::Right { round, of: Gesture::Class(ClassId(0)) };
    mind.handle(
        Duration::ZERO,
        Input::Instructed(Instructed { by: "ada".parse().unwrap(), at: 1, instruction, said: None }),
    );
    let out = mind.handle(Duration::from_secs(2), Input::Tick);
    let answered = |output: &Output| matches!(output, Output::Answer(_, answer) if answer.outcome == Outcome::NotLearning);
    assert!(out.iter().any(answered));
}

#[test]
fn a_lesson_counts_for_samples_that_come_after_it() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 13);
    let round = swarm.show(1);
    let lesson = Lesson {
        round,
        instructor: "ada".parse().unwrap(),
        count: 1,
        at: 9,
        word: Word::Was(ClassId(3)),
        said: None,
    };
    swarm.minds[0].learning.as_mut().unwrap().hear(&lesson);
    let sample = SharedSample {
        id: SampleId { author: RobotId(9), life: 5, number: 1 },
        class: ClassId(1),
        round,
        vector: Vector::F32(vec![0.5; 4]),
    };
    let message = Message::Samples(Samples { space: space().id(), samples: vec![sample] });
    let stamp = Stamp { boot: 1, sequence: 1 };
    swarm.input(0, Input::Received(Envelope { author: RobotId(9), stamp, message, signature: None }));
    let set = swarm.minds[0].training_set().unwrap();
    assert_eq!((set.class_count(ClassId(3)), set.class_count(ClassId(1))), (3, 0));
}

#[test]
fn what_others_share_of_a_round_leaves_what_this_robot_saw_in_it_until_its_gesture_is_said() {
    let mut swarm = Swarm::new(1, config(2, 0.0), 14);
    let round = swarm.show(1);
    swarm.say("ada", Instruction::Wrong { round, of: Gesture::Class(ClassId(2)) });
    let most = swarm.config.aside as u32;
    let sample = |number| SharedSample {
        id: SampleId { author: RobotId(9), life: 5, number },
        class: ClassId(1),
        round,
        vector: Vector::F32(vec![0.5; 4]),
    };
    for number in 1..=most {
        let message = Message::Samples(Samples { space: space().id(), samples: vec![sample(number)] });
        let stamp = Stamp { boot: 1, sequence: number };
        swarm.input(0, Input::Received(Envelope { author: RobotId(9), stamp, message, signature: None }));
    }
    assert_eq!(swarm.minds[0].learned().unwrap().aside as u32, most);
    swarm.restart(0);
    swarm.was(round, 3);
    assert_eq!(swarm.sizes(0), [2, 0, most as usize - 2]);
    swarm.check();
}

#[test]
fn what_waits_for_its_name_takes_no_samples_place() {
    let mut swarm = Swarm::new(1, LearningConfig { capacity: 4, ..config(2, 0.0) }, 15);
    for class in [1, 2] {
        let round = swarm.show(class);
        swarm.was(round, class);
    }
    let taken_back = RoundId { counter: 2, opener: RobotId(9), life: 3 };
    let lesson = Lesson {
        round: taken_back,
        instructor: "ada".parse().unwrap(),
        count: 1,
        at: 9,
        word: Word::Retracted,
        said: None,
    };
    swarm.minds[0].learning.as_mut().unwrap().hear(&lesson);
    let sample = SharedSample {
        id: SampleId { author: RobotId(9), life: 5, number: 1 },
        class: ClassId(3),
        round: taken_back,
        vector: Vector::F32(vec![0.5; 4]),
    };
    let message = Message::Samples(Samples { space: space().id(), samples: vec![sample] });
    let stamp = Stamp { boot: 1, sequence: 1 };
    swarm.input(0, Input::Received(Envelope { author: RobotId(9), stamp, message, signature: None }));
    assert_eq!((swarm.sizes(0), swarm.minds[0].learned().unwrap().aside), ([4, 0, 0], 1));
    swarm.restart(0);
    assert_eq!((swarm.sizes(0), swarm.minds[0].learned().unwrap().aside), ([4, 0, 0], 1));
}
