//! Words of an open swarm that arrive twice, or late.

use gestalt_protocol::{Fate, InstructorId};

use super::*;

/// Zenoh's time, so many seconds after some day of these years.
fn seconds(after: u64) -> u64 {
    (1_790_000_000 + after) << 32
}

impl Swarm {
    /// One robot hears what ana said at that time.
    fn reaches(&mut self, i: usize, at: u64, instruction: &Instruction) {
        let (by, instruction) = ("ana".parse().unwrap(), instruction.clone());
        self.input(i, Input::Instructed(Instructed { by, at, instruction, said: None }));
    }

    fn reaches_all(&mut self, at: u64, instruction: &Instruction) {
        (0..self.minds.len()).for_each(|i| self.reaches(i, at, instruction));
        self.pass(Duration::from_secs(3));
    }

    /// What ana said last of that round, as each robot has it.
    fn last_words(&self, round: RoundId) -> Vec<Option<Word>> {
        let ana: InstructorId = "ana".parse().unwrap();
        let word = |mind: &Mind| mind.learning.as_ref().unwrap().latest(round, &ana).map(|(.., word)| word);
        self.minds.iter().map(word).collect()
    }

    fn fates(&self, gesture: ClassId) -> Vec<Option<Fate>> {
        let names = |mind: &Mind| mind.learning.as_ref().unwrap().names().get(gesture).map(|it| it.fate);
        self.minds.iter().map(names).collect()
    }
}

fn was(round: RoundId, class: u32) -> Instruction {
    Instruction::Was { round, class: Gesture::Class(ClassId(class)) }
}

#[test]
fn what_was_taken_back_stays_so_when_a_copy_of_it_arrives_also_after_a_restart() {
    let mut swarm = Swarm::new(3, config(2, 1.0), 71);
    let circle = ClassId::named(&"ana".parse().unwrap(), "circle");
    let round = swarm.show(1);
    swarm.reaches_all(seconds(0), &Instruction::New { label: "circle".to_owned(), round: None });
    let taught = (seconds(3), was(round, 3));
    let retired = (seconds(9), Instruction::Retire { class: Gesture::Class(circle) });
    swarm.reaches_all(taught.0, &taught.1);
    swarm.reaches_all(seconds(6), &Instruction::Retract { round });
    swarm.reaches_all(retired.0, &retired.1);
    swarm.reaches_all(seconds(12), &Instruction::Restore { class: Gesture::Class(circle) });
    for restarted in [false, true] {
        if restarted {
            swarm.restart_all();
        }
        swarm.reaches(2, taught.0, &taught.1);
        swarm.reaches(2, retired.0, &retired.1);
        swarm.pass(Duration::from_secs(10));
        assert_eq!(swarm.last_words(round), [Some(Word::Retracted); 3], "restarted: {restarted}");
        assert_eq!(swarm.fates(circle), [Some(Fate::InUse); 3], "restarted: {restarted}");
    }
    swarm.check();
}

#[test]
fn who_has_a_clock_that_was_set_back_teaches_on() {
    let mut swarm = Swarm::new(3, config(2, 1.0), 72);
    let round = swarm.show(1);
    // Two minutes, and to where clocks without a battery begin.
    for (at, class) in [(seconds(600), 1), (seconds(480), 2), (5 << 32, 3), (6 << 32, 4)] {
        swarm.reaches_all(at, &was(round, class));
        assert_eq!(swarm.outcome(at), Outcome::Learned);
        assert_eq!(swarm.last_words(round), [Some(Word::Was(ClassId(class))); 3]);
    }
    // By less it is taken for a word that comes late, and answered so.
    swarm.reaches_all(seconds(0), &was(round, 1));
    let before = seconds(0) - (30 << 32);
    swarm.reaches_all(before, &was(round, 2));
    assert_eq!(swarm.outcome(before), Outcome::Known);
    assert_eq!(swarm.last_words(round), [Some(Word::Was(ClassId(1))); 3]);
    // Of clients that say no time the lower half tells words apart, and no order.
    swarm.reaches_all(seconds(100) + 900, &was(round, 2));
    swarm.reaches_all(seconds(100) + 100, &was(round, 3));
    assert_eq!(swarm.last_words(round), [Some(Word::Was(ClassId(3))); 3]);
}

/// As with what was shown: of two parts of a cut swarm the one in which the last word was said is right.
#[test]
fn what_is_said_of_a_name_again_goes_before_what_was_said_otherwise_elsewhere_meanwhile() {
    let mut swarm = Swarm::new(4, config(2, 1.0), 73);
    let circle = ClassId::named(&"ana".parse().unwrap(), "circle");
    let class = || Gesture::Class(circle);
    swarm.reaches_all(seconds(0), &Instruction::New { label: "circle".to_owned(), round: None });
    let count = |swarm: &Swarm, i: usize| {
        swarm.minds[i].learning.as_ref().unwrap().names().get(circle).unwrap().count
    };
    swarm.loss = 1.0;
    for i in [2, 3] {
        let (by, instruction) = ("bob".parse().unwrap(), Instruction::Retire { class: class() });
        swarm.input(i, Input::Instructed(Instructed { by, at: seconds(10), instruction, said: None }));
    }
    swarm.pass(Duration::from_secs(3));
    let restored = (seconds(20), Instruction::Restore { class: class() });
    (0..2).for_each(|i| swarm.reaches(i, restored.0, &restored.1));
    swarm.pass(Duration::from_secs(3));
    assert_eq!(swarm.outcome(restored.0), Outcome::Known, "it was in use there");
    let [used, retired] = [Some(Fate::InUse), Some(Fate::Retired)];
    assert_eq!(swarm.fates(circle), [used, used, retired, retired]);
    swarm.loss = 0.0;
    swarm.pass(Duration::from_secs(20));
    assert_eq!(swarm.fates(circle), [used; 4], "she spoke last");
    // Copies of it are no further words, whoever hears them, how often, and after which start.
    let counted = count(&swarm, 0);
    for again in 0..5 {
        (0..4).for_each(|i| swarm.reaches(i, restored.0, &restored.1));
        swarm.pass(Duration::from_secs(3));
        if again % 2 == 1 {
            swarm.restart_all();
        }
    }
    assert_eq!((0..4).map(|i| count(&swarm, i)).collect::<Vec<_>>(), [counted; 4]);
    swarm.pass(Duration::from_secs(10));
    swarm.check_rest();
    swarm.check();
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn copies_of_words_at_whatever_robot_and_time_change_nothing(
        words in prop::collection::vec((0..7_usize, any::<u8>(), any::<u8>()), 1..14),
        seed in any::<u64>(),
    ) {
        let mut swarm = Swarm::new(3, config(2, 1.0), seed);
        let circle = ClassId::named(&"ana".parse().unwrap(), "circle");
        let round = swarm.show(1);
        swarm.reaches_all(seconds(0), &Instruction::New { label: "circle".to_owned(), round: None });
        let (mut last_word, mut fate, mut said) = (None, Fate::InUse, Vec::new());
        for (word, missed, copied) in words {
            let (class, at) = (Gesture::Class(circle), seconds(4 * (said.len() as u64 + 1)));
            let instruction = match word {
                0 | 1 => was(round, word as u32),
                2 => Instruction::Wrong { round, of: Gesture::Class(ClassId(3)) },
                3 => Instruction::Retract { round },
                4 => Instruction::Retire { class },
                5 => Instruction::Restore { class },
                _ => Instruction::Same { class, of: Gesture::Class(ClassId(2)) },
            };
            match word {
                0 | 1 => last_word = Some(Word::Was(ClassId(word as u32))),
                2 => last_word = Some(Word::Not(ClassId(3))),
                3 => last_word = Some(Word::Retracted),
                4 => fate = Fate::Retired,
                5 => fate = Fate::InUse,
                _ => fate = Fate::Same(ClassId(2)),
            }
            // One may not hear it, and is told.
            (0..3).filter(|i| *i != usize::from(missed % 6)).for_each(|i| swarm.reaches(i, at, &instruction));
            swarm.pass(Duration::from_secs(3));
            said.push((at, instruction));
            let (at, instruction) = said[usize::from(copied / 3) % said.len()].clone();
            swarm.reaches(usize::from(copied % 3), at, &instruction);
            swarm.pass(Duration::from_secs(1));
        }
        swarm.pass(Duration::from_secs(10));
        prop_assert_eq!(swarm.last_words(round), vec![last_word; 3]);
        prop_assert_eq!(swarm.fates(circle), vec![Some(fate); 3]);
        for at in said.iter().map(|(at, _)| *at) {
            prop_assert_eq!(swarm.answers.iter().filter(|answer| answer.at == at).count(), 1, "one answer each");
        }
    }
}
