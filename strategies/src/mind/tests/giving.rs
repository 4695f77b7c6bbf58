//! What robots give each other of which some refuse words.

use gestalt_protocol::{InstructorId, Lessons};

use super::believing::{BOTH, Roll, signed, was};
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
