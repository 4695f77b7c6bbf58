//! Whose words are believed in a sealed swarm, and by whom.

use gestalt_protocol::{Fate, InstructorId, Lessons, Naming, SignedWord, Word};
use gestalt_rounds::Follow;

use super::*;
use crate::believe::{Believe, Standing};

/// Who may teach. A word is signed by whoever's name stands before its count.
#[derive(Debug)]
pub(super) struct Roll(pub &'static [(&'static str, Standing)]);

impl Believe for Roll {
    fn believe(&self, by: &InstructorId, said: &SignedWord) -> Option<(u64, Standing)> {
        let name = by.to_string();
        let count = said.attachment.strip_prefix(name.as_bytes())?.try_into().ok()?;
        let (_, standing) = self.0.iter().find(|(known, _)| *known == name)?;
        Some((u64::from_le_bytes(count), *standing))
    }
}

/// A robot may speak for the guest.
pub(super) const ALL: &[(&str, Standing)] =
    &[("ada", Standing::Overrules), ("bob", Standing::Teaches), ("guest", Standing::Vouched)];

pub(super) const BOTH: &[(&str, Standing)] = &[("ada", Standing::Overrules), ("bob", Standing::Teaches)];

pub(super) fn signed(who: &str, count: u64, instruction: &Instruction) -> SignedWord {
    let attachment = [who.as_bytes(), &count.to_le_bytes()].concat();
    SignedWord { word: serde_json::to_vec(instruction).unwrap(), attachment }
}

pub(super) fn was(round: RoundId, class: u32) -> Instruction {
    Instruction::Was { round, class: Gesture::Class(ClassId(class)) }
}

impl Swarm {
    pub(super) fn sealed(seed: u64) -> Self {
        let mut swarm = Self::new(3, config(3, 1.0), seed);
        swarm.believe(BOTH);
        swarm
    }

    pub(super) fn believe(&mut self, roll: &'static [(&'static str, Standing)]) {
        let believer: Arc<dyn Believe> = Arc::new(Roll(roll));
        (0..self.minds.len()).for_each(|i| self.input(i, Input::Believe(believer.clone())));
        self.believer = Some(believer);
    }

    /// One robot hears that word itself.
    pub(super) fn hear(&mut self, i: usize, who: &str, count: u64, instruction: &Instruction) {
        let said = Some(signed(who, count, instruction));
        let (by, instruction) = (who.parse().unwrap(), instruction.clone());
        self.input(i, Input::Instructed(Instructed { by, at: count, instruction, said }));
    }

    pub(super) fn of_class(&self, class: u32) -> Vec<usize> {
        let count = |mind: &Mind| mind.training_set().unwrap().class_count(ClassId(class));
        self.minds.iter().map(count).collect()
    }

    pub(super) fn lessons(&self) -> Vec<usize> {
        self.minds.iter().map(|mind| mind.learned().unwrap().lessons).collect()
    }

    /// How many lessons are told in half a minute.
    fn told_from_now(&mut self) -> usize {
        let told = |swarm: &Self| swarm.told.get("lessons").map_or(0, |(messages, _)| *messages);
        let before = told(self);
        self.pass(Duration::from_secs(30));
        told(self) - before
    }
}

#[test]
fn who_was_away_believes_the_word_and_not_who_tells_it() {
    let mut swarm = Swarm::sealed(31);
    let round = swarm.show(1);
    swarm.hear(0, "ada", 700, &was(round, 4));
    swarm.pass(Duration::from_secs(10));
    assert_eq!(swarm.of_class(4), [9, 9, 9]);
    let instructor: InstructorId = "ada".parse().unwrap();
    let made_up = |said| {
        let (instructor, word) = (instructor.clone(), Word::Was(ClassId(2)));
        Lesson { round, instructor, count: 800, at: 800, word, said }
    };
    let of_bob = signed("bob", 800, &was(round, 2));
    let of_another_class = signed("ada", 800, &was(round, 3));
    let of_another_count = signed("ada", 801, &was(round, 2));
    for said in [None, Some(of_bob), Some(of_another_class), Some(of_another_count)] {
        let message = Message::Lessons(Lessons { lessons: vec![made_up(said)] });
        let stamp = Stamp { boot: u32::MAX, sequence: 1 };
        swarm.input(2, Input::Received(Envelope { author: RobotId(1), stamp, message, signature: None }));
    }
    assert_eq!(swarm.minds[2].refusals().count(gestalt_rounds::Refusal::LessonUnproven), 4);
    swarm.pass(Duration::from_secs(10));
    assert_eq!(swarm.of_class(4), [9, 9, 9]);
    swarm.check();
}

#[test]
fn the_newest_word_is_the_one_that_its_instructor_counted_last() {
    let mut swarm = Swarm::sealed(32);
    let round = swarm.show(1);
    let (first, second) = (was(round, 2), was(round, 3));
    swarm.hear(0, "ada", 700, &second);
    swarm.hear(1, "ada", 600, &first);
    swarm.hear(2, "ada", 700, &second);
    swarm.hear(2, "ada", 600, &first);
    swarm.pass(Duration::from_secs(10));
    assert_eq!(swarm.of_class(3), [9, 9, 9]);
    swarm.check();
}

#[test]
fn what_was_taught_goes_on_from_disk_to_who_comes_late() {
    let mut swarm = Swarm::sealed(33);
    let round = swarm.show(1);
    (0..3).for_each(|i| swarm.hear(i, "ada", 700, &was(round, 4)));
    swarm.pass(Duration::from_secs(3));
    swarm.restart_all();
    swarm.restart_empty(2);
    swarm.pass(Duration::from_secs(10));
    assert_eq!(swarm.lessons(), [1, 1, 1]);
    // What its author says of a sample is not what ada says of it.
    swarm.hear(0, "ada", 800, &was(round, 5));
    swarm.pass(Duration::from_secs(10));
    assert_eq!(swarm.of_class(4), [0, 0, 0]);
    assert_eq!(swarm.told_from_now(), 0, "all know the same");
}

#[test]
fn what_a_memory_of_before_holds_counts_here_and_is_told_to_nobody() {
    let mut swarm = Swarm::new(3, config(3, 1.0), 34);
    let round = swarm.show(1);
    swarm.was(round, 4);
    // Releases without proofs wrote the words alone: no list of one proof, which is none.
    let lessons = swarm.disks.iter_mut().flatten().filter(|(key, _)| key[0] == 4);
    lessons.for_each(|(_, value)| assert_eq!(value.split_off(value.len() - 2), [1, 0]));
    swarm.believe(BOTH);
    swarm.restart_all();
    swarm.restart_empty(2);
    swarm.pass(Duration::from_secs(10));
    assert_eq!(swarm.lessons(), [1, 1, 0]);
    assert_eq!(swarm.told_from_now(), 0, "they rest, though they do not know the same");
    assert_eq!(swarm.of_class(4)[..2], [9, 9]);
    swarm.hear(2, "bob", 1, &was(round, 3));
    swarm.pass(Duration::from_secs(10));
    assert_eq!(swarm.of_class(4), [0, 0, 0], "what can be shown goes before it");
    assert_eq!(swarm.told_from_now(), 0);
}

#[test]
fn what_somebody_said_who_may_teach_no_more_stays_where_it_is_until_another_speaks() {
    let mut swarm = Swarm::sealed(35);
    let round = swarm.show(1);
    (0..3).for_each(|i| swarm.hear(i, "bob", 700, &was(round, 4)));
    swarm.pass(Duration::from_secs(3));
    swarm.believe(&BOTH[..1]);
    swarm.restart_empty(2);
    swarm.pass(Duration::from_secs(10));
    assert_eq!((swarm.lessons(), &swarm.of_class(4)[..2]), (vec![1, 1, 0], &[9, 9][..]));
    assert_eq!(swarm.told_from_now(), 0);
    swarm.hear(0, "ada", 1, &was(round, 5));
    swarm.pass(Duration::from_secs(10));
    assert_eq!(swarm.of_class(4), [0, 0, 0]);
    // He may again, and she goes before him.
    swarm.believe(BOTH);
    swarm.pass(Duration::from_secs(10));
    assert_eq!(swarm.of_class(4), [0, 0, 0]);
    assert_eq!(swarm.told_from_now(), 0);
}

#[test]
fn who_may_not_overrule_is_told_so() {
    let mut swarm = Swarm::sealed(36);
    let round = swarm.show(1);
    (0..3).for_each(|i| swarm.hear(i, "ada", 700, &was(round, 4)));
    (0..3).for_each(|i| swarm.hear(i, "bob", 800, &was(round, 5)));
    swarm.pass(Duration::from_secs(3));
    assert_eq!([swarm.outcome(700), swarm.outcome(800)], [Outcome::Learned, Outcome::NotAllowed]);
    assert_eq!(swarm.of_class(4), [9, 9, 9]);
}

#[test]
fn a_name_is_believed_by_the_word_that_gave_it() {
    let mut swarm = Swarm::sealed(37);
    let round = swarm.show(1);
    let (circle, ring) = ("circle".to_owned(), "ring".to_owned());
    swarm.hear(0, "bob", 500, &Instruction::New { label: circle.clone(), round: None });
    swarm.hear(0, "ada", 600, &Instruction::New { label: ring.clone(), round: Some(round) });
    // By a label that only another's gesture has.
    let same = Instruction::Same { class: Gesture::Label(circle.clone()), of: Gesture::Label(ring) };
    swarm.hear(0, "ada", 700, &same);
    swarm.pass(Duration::from_secs(10));
    let named = |mind: &Mind| mind.learned().unwrap().named.len();
    assert_eq!(swarm.minds.iter().map(named).collect::<Vec<_>>(), [1, 1, 1]);
    let ring = ClassId::named(&"ada".parse().unwrap(), "ring");
    assert_eq!(swarm.of_class(ring.0), [9, 9, 9]);
    let retired = gestalt_protocol::Naming {
        by: "bob".parse().unwrap(),
        label: circle,
        count: 900,
        at: 900,
        said_by: "ada".parse().unwrap(),
        fate: gestalt_protocol::Fate::Retired,
        said: Some(signed("ada", 900, &same)),
    };
    let message = Message::Namings(gestalt_protocol::Namings { namings: vec![retired] });
    let stamp = Stamp { boot: u32::MAX, sequence: 1 };
    swarm.input(2, Input::Received(Envelope { author: RobotId(1), stamp, message, signature: None }));
    assert_eq!(swarm.minds[2].refusals().count(gestalt_rounds::Refusal::NamingUnproven), 1);
    swarm.restart_all();
    swarm.restart_empty(2);
    swarm.pass(Duration::from_secs(10));
    assert_eq!(swarm.minds.iter().map(named).collect::<Vec<_>>(), [1, 1, 1]);
}

#[test]
fn a_word_is_kept_over_a_restart_whatever_its_instructor_counts() {
    let mut swarm = Swarm::sealed(38);
    let round = swarm.show(1);
    swarm.hear(0, "bob", 700, &was(round, 3));
    // Counts are times: this one is of the year 2038.
    swarm.hear(0, "ada", (1 << 63) + 1, &was(round, 4));
    swarm.pass(Duration::from_secs(10));
    assert_eq!(swarm.of_class(4), [9, 9, 9]);
    swarm.restart_all();
    swarm.pass(Duration::from_secs(10));
    assert_eq!((swarm.lessons(), swarm.of_class(4)), (vec![1, 1, 1], vec![9, 9, 9]));
    swarm.check();
}

#[test]
fn what_is_said_of_rounds_to_come_ends_none_of_them() {
    let mut swarm = Swarm::sealed(39);
    swarm.believe(ALL);
    let first = swarm.show(1);
    swarm.hear(0, "ada", 700, &was(first, 1));
    let taken_back = |counter| {
        let round = RoundId { counter, ..first };
        let said = signed("guest", 1, &Instruction::Retract { round });
        let instructor = "guest".parse().unwrap();
        Lesson { round, instructor, count: 1, at: 1, word: Word::Retracted, said: Some(said) }
    };
    for i in 0..3 {
        let lessons = (first.counter + 1..first.counter + 9).map(taken_back).collect();
        let message = Message::Lessons(Lessons { lessons });
        let stamp = Stamp { boot: u32::MAX, sequence: i };
        let said = Envelope { author: RobotId(2), stamp, message, signature: None };
        swarm.input(i as usize, Input::Received(said));
    }
    for class in [2, 3] {
        let round = swarm.show(class);
        swarm.hear(0, "ada", 800 + u64::from(class), &was(round, class));
        swarm.pass(Duration::from_secs(10));
        assert_eq!(swarm.of_class(class), [9, 9, 9]);
    }
    swarm.check_rest();
}

#[test]
fn a_newborn_knows_as_over_what_an_instructor_with_a_key_spoke_of_and_older_rounds_and_no_others() {
    let mut swarm = Swarm::sealed(42);
    swarm.believe(ALL);
    let mut taught = |by: &str, counter| {
        let round = RoundId { counter, opener: RobotId(9), life: 0 };
        let said = Some(signed(by, 1, &was(round, 1)));
        let instructor = by.parse().unwrap();
        let lesson = Lesson { round, instructor, count: 1, at: 1, word: Word::Was(ClassId(1)), said };
        let message = Message::Lessons(Lessons { lessons: vec![lesson] });
        let stamp = Stamp { boot: u32::MAX, sequence: counter };
        swarm.input(0, Input::Received(Envelope { author: RobotId(2), stamp, message, signature: None }));
        round
    };
    let old = taught("guest", 1);
    let proven = taught("bob", 8);
    let to_come = taught("guest", 9);
    let round = swarm.show(1);
    assert_eq!(round.counter, 1);
    swarm.pass(Duration::from_secs(10));
    let is_over = |swarm: &Swarm, round: RoundId| {
        swarm.minds[0].learning.as_ref().unwrap().taught(round.counter).contains(&round)
    };
    assert_eq!([old, proven, to_come].map(|round| is_over(&swarm, round)), [true, true, false]);
    // So it is for one that knows of earlier rounds.
    let taught = |swarm: &mut Swarm, by: &str| {
        let round = RoundId { counter: 3, opener: RobotId(9), life: by.len() as u32 };
        let said = Some(signed(by, 1, &was(round, 1)));
        let instructor = by.parse().unwrap();
        let lesson = Lesson { round, instructor, count: 1, at: 1, word: Word::Was(ClassId(1)), said };
        let message = Message::Lessons(Lessons { lessons: vec![lesson] });
        let stamp = Stamp { boot: u32::MAX, sequence: 100 + by.len() as u32 };
        swarm.input(0, Input::Received(Envelope { author: RobotId(2), stamp, message, signature: None }));
        is_over(swarm, round)
    };
    assert_eq!(["bob", "guest"].map(|by| taught(&mut swarm, by)), [true, false]);
    // What is proven is remembered, and counted on from.
    swarm.restart_all();
    assert_eq!([old, proven].map(|round| is_over(&swarm, round)), [true, true]);
    assert_eq!(swarm.show(2).counter, 9);
}

#[test]
fn names_that_robots_vouch_for_push_out_none_of_an_instructor_with_a_key() {
    let mut swarm = Swarm::sealed(40);
    swarm.believe(ALL);
    let round = swarm.show(1);
    let circle = ClassId::named(&"bob".parse().unwrap(), "circle");
    swarm.hear(0, "bob", 500, &Instruction::New { label: "circle".to_owned(), round: Some(round) });
    let guest: InstructorId = "guest".parse().unwrap();
    let smaller = (0_u32..).map(|n| format!("g{n}")).filter(|label| ClassId::named(&guest, label) < circle);
    for label in smaller.take(2 * gestalt_protocol::MAX_NAMED) {
        swarm.hear(1, "guest", 1, &Instruction::New { label, round: None });
    }
    swarm.pass(Duration::from_secs(10));
    let is_named = |mind: &Mind| mind.learned().unwrap().named.iter().any(|named| named.class == circle);
    assert!(swarm.minds.iter().all(is_named));
    assert_eq!(swarm.of_class(circle.0), [9, 9, 9]);
    swarm.check();
    // There is room for one more of hers, and none of the guest's.
    swarm.hear(0, "ada", 900, &Instruction::New { label: "square".to_owned(), round: None });
    swarm.pass(Duration::from_secs(10));
    let square = ClassId::named(&"ada".parse().unwrap(), "square");
    let is_there = |mind: &Mind| mind.learned().unwrap().named.iter().any(|named| named.class == square);
    assert!(swarm.minds.iter().all(|mind| is_there(mind) && is_named(mind)));
    // The guest's count no more, once no robot may speak for anybody.
    swarm.believe(BOTH);
    swarm.restart_all();
    swarm.pass(Duration::from_secs(10));
    assert!(swarm.minds.iter().all(is_named));
    swarm.check();
}

#[test]
fn on_a_name_the_word_of_somebody_with_a_key_goes_before_a_later_one_without_in_any_order() {
    let circle = || Gesture::Label("circle (guest)".to_owned());
    let merged = Instruction::Same { class: circle(), of: Gesture::Class(ClassId(3)) };
    let retired = Instruction::Retire { class: circle() };
    let id = ClassId::named(&"guest".parse().unwrap(), "circle");
    for turned in [false, true] {
        let mut swarm = Swarm::sealed(41);
        swarm.believe(ALL);
        swarm.hear(0, "guest", 500, &Instruction::New { label: "circle".to_owned(), round: None });
        swarm.pass(Duration::from_secs(10));
        if turned {
            swarm.hear(2, "guest", 700, &merged);
            swarm.pass(Duration::from_secs(10));
        }
        // Neither of the two has heard of the other's word.
        swarm.hear(0, "bob", 600, &retired);
        swarm.hear(1, "guest", 700, &merged);
        swarm.pass(Duration::from_secs(10));
        for mind in &swarm.minds {
            let names = mind.learning.as_ref().unwrap().names();
            assert_eq!(names.get(id).unwrap().said_by.to_string(), "bob", "robot {}", mind.me());
        }
        assert_eq!(swarm.outcome(600), Outcome::Learned);
        swarm.check_rest();
        swarm.check();
    }
}

/// A liar with a signed word on one gesture says it of others, of whichever names it likes.
#[test]
fn what_is_said_of_a_name_is_said_of_none_that_nobody_gave() {
    let mut swarm = Swarm::sealed(44);
    swarm.hear(0, "bob", 500, &Instruction::New { label: "circle".to_owned(), round: None });
    swarm.pass(Duration::from_secs(10));
    let label = Gesture::Label("circle".to_owned());
    let bobs = ClassId::named(&"bob".parse().unwrap(), "circle");
    let ada: InstructorId = "ada".parse().unwrap();
    let words = [
        (700, Instruction::Retire { class: label }, Fate::Retired),
        (800, Instruction::Restore { class: Gesture::Label("circle (bob)".to_owned()) }, Fate::InUse),
        (900, Instruction::Restore { class: Gesture::Class(bobs) }, Fate::InUse),
    ];
    for (sequence, (count, word, fate)) in (1..).zip(words) {
        swarm.hear(0, "ada", count, &word);
        swarm.pass(Duration::from_secs(10));
        let names = |swarm: &Swarm| swarm.minds[0].learning.as_ref().unwrap().names().clone();
        let before = names(&swarm);
        assert_eq!(before.get(bobs).unwrap().count, count);
        let made_up = (0..40).map(|n| Naming {
            by: format!("nobody{n}").parse().unwrap(),
            label: "circle".to_owned(),
            count,
            at: count,
            said_by: ada.clone(),
            fate,
            said: Some(signed("ada", count, &word)),
        });
        let message = Message::Namings(gestalt_protocol::Namings { namings: made_up.collect() });
        let stamp = Stamp { boot: u32::MAX, sequence };
        swarm.input(0, Input::Received(Envelope { author: RobotId(2), stamp, message, signature: None }));
        assert_eq!(names(&swarm), before);
    }
    // Whoever comes new, or lost all, is told by which word it was named, and believes what came of it, also after all have started again.
    for again in [false, true] {
        if again {
            swarm.restart_all();
        }
        swarm.restart_empty(1);
        swarm.pass(Duration::from_secs(20));
        let known = swarm.minds[1].learning.as_ref().unwrap().names().get(bobs).map(|naming| naming.count);
        assert_eq!(known, Some(900));
    }
    swarm.check_rest();
    swarm.check();
}

/// Nor is a label the name of what nobody named: only one bears it.
#[test]
fn nobody_means_a_gesture_that_nobody_named() {
    let mut swarm = Swarm::sealed(45);
    let round = swarm.show(1);
    swarm.hear(0, "bob", 500, &Instruction::New { label: "circle".to_owned(), round: None });
    let was = Instruction::Was { round, class: Gesture::Label("circle".to_owned()) };
    swarm.hear(0, "ada", 700, &was);
    swarm.pass(Duration::from_secs(10));
    let [adas, bobs] = ["ada", "bob"].map(|by| ClassId::named(&by.parse().unwrap(), "circle"));
    let labels = swarm.of_class(bobs.0);
    assert!(labels.iter().all(|count| *count > 0));
    let said = Some(signed("ada", 700, &was));
    let lesson = Lesson {
        round,
        instructor: "ada".parse().unwrap(),
        count: 700,
        at: 700,
        word: Word::Was(adas),
        said,
    };
    let message = Message::Lessons(Lessons { lessons: vec![lesson] });
    let stamp = Stamp { boot: u32::MAX, sequence: 1 };
    swarm.input(1, Input::Received(Envelope { author: RobotId(2), stamp, message, signature: None }));
    swarm.pass(Duration::from_secs(10));
    assert_eq!((swarm.of_class(bobs.0), swarm.of_class(adas.0)), (labels, vec![0, 0, 0]));
}
