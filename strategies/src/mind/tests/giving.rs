//! What robots give each other of which some refuse words, or hold all that they can.

use gestalt_protocol::{Digest, InstructorId, Know, Lessons, MAX_LESSONS};

use super::believing::{ALL, BOTH, Roll, signed, was};
use super::*;
use crate::believe::Standing;

/// What that one says of that round; signed, where the swarm is sealed.
fn lesson(by: &str, round: RoundId, class: u32, is_sealed: bool) -> Lesson {
    let said = is_sealed.then(|| signed(by, 1, &was(round, class)));
    let instructor = by.parse().unwrap();
    Lesson { round, instructor, count: 1, at: 1, word: Word::Was(ClassId(class)), said }
}

impl Swarm {
    /// One robot hears what that one says of so many rounds that come after that one.
    fn hear_of_many(&mut self, i: usize, by: &str, after: RoundId, many: usize) {
        let is_sealed = self.believer.is_some();
        let name = |n: usize| RoundId { opener: RobotId(9), life: n as u32, ..after };
        let lessons: Vec<Lesson> = (0..many).map(|n| lesson(by, name(n), 1, is_sealed)).collect();
        for (sequence, lessons) in (1..).zip(lessons.chunks(64)) {
            let message = Message::Lessons(Lessons { lessons: lessons.to_vec() });
            let stamp = Stamp { boot: u32::MAX, sequence };
            let said = Envelope { author: RobotId(9), stamp, message, signature: None };
            self.input(i, Input::Received(said));
        }
    }

    fn last_word(&self, i: usize, round: RoundId, by: &str) -> Option<Word> {
        let by: InstructorId = by.parse().unwrap();
        self.minds[i].learning.as_ref().unwrap().latest(round, &by).map(|(.., word)| word)
    }

    fn count_told(&self, what: &str) -> usize {
        self.told.get(what).map_or(0, |(messages, _)| *messages)
    }
}

/// A member can vouch for ever so many words of somebody without a key.
#[test]
fn a_signed_word_reaches_a_book_that_is_full_of_newer_ones_without_a_key() {
    let mut swarm = Swarm::sealed(81);
    swarm.believe(ALL);
    let round = swarm.show(1);
    swarm.hear(0, "ada", 600, &was(round, 1));
    swarm.pass(Duration::from_secs(10));
    swarm.hear(0, "ada", 700, &was(round, 4));
    swarm.pass(Duration::from_secs(10));
    assert_eq!(swarm.of_class(4), [9, 9, 9]);
    (0..2).for_each(|i| swarm.hear_of_many(i, "guest", round, MAX_LESSONS));
    // Started again, these did not live through it, as far as they know.
    swarm.restart_all();
    swarm.loss = 1.0;
    swarm.restart_empty(2);
    swarm.hear_of_many(2, "guest", round, MAX_LESSONS);
    assert_eq!(swarm.lessons(), [MAX_LESSONS; 3]);
    swarm.loss = 0.0;
    swarm.pass(Duration::from_secs(60));
    assert_eq!(swarm.last_word(2, round, "ada"), Some(Word::Was(ClassId(4))));
    assert_eq!(swarm.of_class(4), [9, 9, 9]);
    swarm.pass(Duration::from_secs(120));
    swarm.check_rest();
    swarm.check();
}

#[test]
fn what_a_robot_lived_through_it_is_told_however_many_rounds_others_made_up_since() {
    let mut swarm = Swarm::new(2, config(3, 1.0), 82);
    let round = swarm.show(1);
    (0..2).for_each(|i| swarm.hear_of_many(i, "eve", round, MAX_LESSONS));
    swarm.pass(Duration::from_secs(60));
    let word = Instruction::Was { round, class: Gesture::Class(ClassId(4)) };
    let by = "ada".parse().unwrap();
    swarm.input(0, Input::Instructed(Instructed { by, at: 1 << 40, instruction: word, said: None }));
    swarm.pass(Duration::from_secs(60));
    assert_eq!(swarm.last_word(1, round, "ada"), Some(Word::Was(ClassId(4))));
    assert_eq!(swarm.of_class(4), [6, 6]);
    swarm.pass(Duration::from_secs(60));
    swarm.check_rest();
}

/// What is older than all of a full list, and is given all the same, is not given for ever.
#[test]
fn who_takes_no_word_however_often_is_given_it_no_more() {
    let mut swarm = Swarm::sealed(83);
    let round = swarm.show(1);
    swarm.hear(0, "ada", 700, &was(round, 1));
    swarm.pass(Duration::from_secs(10));
    let name = |n: u32| RoundId { counter: round.counter + 1, opener: RobotId(2), life: n };
    let mut ask = |sequence, lessons| {
        let digest = Digest { key: 1, samples: 0, lessons };
        let lessons = (0..MAX_LESSONS as u32).map(|n| (name(n), 1)).collect();
        let know = Know { samples: Vec::new(), lessons, named: 0, digest, answer: true, nothing_for: None };
        let (stamp, message) = (Stamp { boot: u32::MAX, sequence }, Message::Know(know));
        let said = Envelope { author: RobotId(2), stamp, message, signature: None };
        let before = swarm.count_told("lessons");
        swarm.input(0, Input::Received(said));
        swarm.pass(Duration::from_millis(500));
        swarm.count_told("lessons") - before
    };
    let given: usize = (0..100).map(|sequence| ask(sequence, 3)).sum();
    assert_eq!(given, 16);
    assert_eq!(ask(101, 4), 1, "it has taken something else");
}

#[test]
fn behind_ever_so_many_words_that_a_robot_cannot_prove_it_is_given_the_one_that_it_can() {
    const ADA: &[(&str, Standing)] = &[("ada", Standing::Overrules)];
    let mut swarm = Swarm::sealed(84);
    let before = swarm.show(2);
    (0..2).for_each(|i| swarm.hear_of_many(i, "bob", before, 700));
    let round = swarm.show(1);
    assert!(round.counter > before.counter);
    (0..2).for_each(|i| swarm.hear(i, "ada", 700, &was(round, 4)));
    swarm.pass(Duration::from_secs(10));
    // One of an older roster, on which bob is not.
    let starts = |swarm: &mut Swarm| {
        swarm.loss = 1.0;
        swarm.restart_empty(2);
        swarm.input(2, Input::Believe(Arc::new(Roll(ADA))));
        swarm.loss = 0.0;
    };
    starts(&mut swarm);
    let began = swarm.count_told("lessons");
    swarm.pass(Duration::from_secs(60));
    assert_eq!(swarm.last_word(2, round, "ada"), Some(Word::Was(ClassId(4))));
    assert_eq!(swarm.of_class(4), [9, 9, 9]);
    // They give it up at some time.
    swarm.pass(Duration::from_secs(600));
    let told = swarm.count_told("lessons") - began;
    assert!(told < 2 * 16 * 50, "{told} messages: of 44 that hold all of it, sixteen times each");
    swarm.check_rest();
    assert_eq!(swarm.lessons(), [701, 701, 1]);
    // And begin again once it has the newer one.
    swarm.input(2, Input::Believe(Arc::new(Roll(BOTH))));
    swarm.pass(Duration::from_secs(60));
    assert_eq!(swarm.lessons(), [701; 3]);
    swarm.check_rest();
}
