//! Gestures that are named while the swarm works.

use gestalt_protocol::{Fate, InstructorId, MAX_CLASSES, MAX_LABEL, MAX_NAMED, MAX_WORD, Naming, Namings};

use super::believing::was;
use super::*;
use crate::believe::Standing;
use crate::names::NameBook;

fn new(label: &str) -> Instruction {
    Instruction::New { label: label.to_owned(), round: None }
}

fn called(label: &str) -> Gesture {
    Gesture::Label(label.to_owned())
}

fn anas(label: &str) -> ClassId {
    ClassId::named(&"ana".parse().unwrap(), label)
}

impl Swarm {
    fn names(&self, i: usize) -> &NameBook {
        self.minds[i].learning.as_ref().unwrap().names()
    }

    /// How many samples each robot trains on as that gesture.
    fn trained_as(&self, class: ClassId) -> Vec<usize> {
        self.trained.iter().map(|trained| trained.values().filter(|of| **of == class).count()).collect()
    }

    fn check_names(&self) {
        for i in 1..self.minds.len() {
            assert_eq!(self.names(i), self.names(0), "robot {} knows other names", i + 1);
        }
    }
}

#[test]
fn what_is_named_and_shown_is_learned_by_all_and_can_become_another() {
    let mut swarm = Swarm::new(3, config(4, 1.0), 61);
    let circle = anas("circle");
    let named = swarm.say("ana", new("circle"));
    assert_eq!(swarm.outcome(named), Outcome::Learned);
    assert_eq!(swarm.answers.last().unwrap().class, Some(circle));
    let again = swarm.say("ana", new("circle"));
    assert_eq!(swarm.outcome(again), Outcome::Known);
    let round = swarm.show(2);
    let word = swarm.say("ana", Instruction::Was { round, class: called("circle") });
    assert_eq!(swarm.outcome(word), Outcome::Learned);
    assert_eq!(swarm.trained_as(circle), [12; 3], "four looks of each of three");

    // Another, named when it is shown: it looks like the third gesture of the list to all robots.
    let round = swarm.show(2);
    let word = swarm.say("bob", Instruction::New { label: "ring".to_owned(), round: Some(round) });
    let answer = swarm.answers.iter().find(|answer| answer.at == word).unwrap().clone();
    let ring = answer.class.unwrap();
    assert_eq!((answer.outcome, answer.looks_like), (Outcome::Learned, Some(ClassId(2))));
    assert_eq!(swarm.trained_as(ring), [12; 3]);

    // They are the same, and then they are not.
    swarm.say("cyn", Instruction::Same { class: called("ring"), of: called("circle") });
    assert_eq!((swarm.trained_as(circle), swarm.trained_as(ring)), (vec![24; 3], vec![0; 3]));
    swarm.restart(1);
    swarm.pass(Duration::from_secs(3));
    assert_eq!(swarm.trained_as(circle), [24; 3], "also after a restart");
    swarm.say("ana", Instruction::Restore { class: Gesture::Class(ring) });
    assert_eq!((swarm.trained_as(circle), swarm.trained_as(ring)), (vec![12; 3], vec![12; 3]));
    swarm.say("ana", Instruction::Retire { class: called("circle") });
    assert_eq!((swarm.trained_as(circle), swarm.trained_as(ring)), (vec![0; 3], vec![12; 3]));
    assert_eq!(swarm.sizes(0), [0, 8, 16], "what was seen is kept");
    swarm.say("ana", new("circle"));
    assert_eq!(swarm.trained_as(circle), [12; 3]);
    swarm.check_names();
}

#[test]
fn a_sample_of_a_gesture_that_nobody_named_here_waits_for_its_name() {
    let mut swarm = Swarm::new(2, config(4, 1.0), 62);
    let (circle, round) = (anas("circle"), RoundId { counter: 1, opener: RobotId(2), life: 9 });
    let sample = SharedSample {
        id: SampleId { author: RobotId(2), life: 5, number: 1 },
        class: circle,
        round,
        vector: Vector::F32(vec![0.5; 4]),
    };
    let message = Message::Samples(Samples { space: space().id(), samples: vec![sample] });
    let stamp = Stamp { boot: 1 << 20, sequence: 1 };
    swarm.input(0, Input::Received(Envelope { author: RobotId(2), stamp, message, signature: None }));
    assert_eq!((swarm.sizes(0), swarm.trained_as(circle)), ([0, 0, 1], vec![0; 2]));
    swarm.say("ana", new("circle"));
    assert_eq!(swarm.trained_as(circle)[0], 1);
}

#[test]
fn what_is_corrected_from_or_to_a_gesture_that_nobody_named_here_is_trained_on_as_what_it_is() {
    let mut swarm = Swarm::new(1, config(2, 0.0), 68);
    let (circle, round) = (anas("circle"), swarm.show(3));
    swarm.was(round, 3);
    let mut hear = |count, word| {
        let instructor = "ana".parse().unwrap();
        let lesson = Lesson { round, instructor, count, at: count, word, said: None };
        swarm.minds[0].learning.as_mut().unwrap().hear(&lesson);
        swarm.input(0, Input::Tick);
        let of = |class| swarm.minds[0].training_set().unwrap().class_count(class);
        ((of(ClassId(3)), of(circle)), (swarm.trained_as(ClassId(3))[0], swarm.trained_as(circle)[0]))
    };
    assert_eq!(hear(2, Word::Was(circle)), ((0, 2), (0, 0)), "nobody named it that was heard");
    assert_eq!(hear(3, Word::Was(ClassId(3))), ((2, 0), (2, 0)));
    swarm.check();
}

#[test]
fn a_word_on_what_was_shown_means_what_is_in_use() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 69);
    for by in ["ana", "bob"] {
        swarm.say(by, new("circle"));
    }
    for (label, outcome) in [("circle (ana)", Outcome::NoRoom), ("circle (by ana)", Outcome::Learned)] {
        let named = swarm.say("bob", new(label));
        assert_eq!(swarm.outcome(named), outcome, "{label}");
    }
    swarm.say("ana", Instruction::Retire { class: called("circle") });
    let round = swarm.show(2);
    let word = swarm.say("ana", Instruction::Was { round, class: called("circle") });
    assert_eq!(swarm.outcome(word), Outcome::Learned);
    assert_eq!(swarm.trained_as(ClassId::named(&"bob".parse().unwrap(), "circle")), [4; 2]);
    swarm.say("ana", Instruction::Restore { class: called("circle") });
    assert_eq!(swarm.names(0).in_use(64).len(), 3, "her own is restored");
}

#[test]
fn a_label_that_is_shown_means_the_gesture_that_is_shown_under_it() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 70);
    for by in ["ana", "bob"] {
        swarm.say(by, new("loop"));
    }
    swarm.say("bob", Instruction::Same { class: called("loop"), of: called("3") });
    let round = swarm.show(2);
    let word = swarm.say("bob", Instruction::Was { round, class: called("loop") });
    assert_eq!(swarm.outcome(word), Outcome::Learned);
    assert_eq!((swarm.trained_as(anas("loop")), swarm.trained_as(ClassId(3))), (vec![4; 2], vec![0; 2]));
}

#[test]
fn of_a_round_the_answer_to_a_name_says_which_gesture_was_named_and_none_where_none_was() {
    let with = |label: &str, round| Instruction::New { label: label.to_owned(), round: Some(round) };
    let answer = |swarm: &Swarm, at| {
        let answer = swarm.answers.iter().find(|answer| answer.at == at).unwrap();
        (answer.outcome, answer.class)
    };
    let mut swarm = Swarm::new(2, config(2, 1.0), 73);
    let unknown = RoundId { counter: 77, opener: RobotId(9), life: 1 };
    let named = swarm.say("ana", with("triangle", unknown));
    assert_eq!(answer(&swarm, named), (Outcome::UnknownRound, Some(anas("triangle"))));
    let round = swarm.show(2);
    swarm.was(round, 3);
    let refused = swarm.say("ana", with("ok (left)", round));
    assert_eq!(answer(&swarm, refused), (Outcome::NoRoom, None), "though the round shows 3");

    let mut swarm = Swarm::sealed(74);
    let round = swarm.show(1);
    swarm.hear(0, "ada", 700, &was(round, 3));
    swarm.pass(Duration::from_secs(3));
    swarm.hear(0, "bob", 800, &with("circle", round));
    swarm.pass(Duration::from_secs(3));
    assert_eq!(answer(&swarm, 800), (Outcome::NotAllowed, None));
}

#[test]
fn a_word_on_a_name_that_another_of_a_higher_count_goes_before_is_not_answered_as_known() {
    let mut swarm = Swarm::sealed(75);
    swarm.believe(&[("ana", Standing::Teaches), ("bob", Standing::Teaches)]);
    let retire = Instruction::Retire { class: called("square") };
    let restore = Instruction::Restore { class: called("square") };
    for (who, count, word, outcome) in [
        ("ana", 900, new("square"), Outcome::Learned),
        ("bob", 800, retire.clone(), Outcome::NotAllowed),
        ("bob", 810, restore, Outcome::Known),
        ("bob", 910, retire, Outcome::Learned),
    ] {
        (0..3).for_each(|i| swarm.hear(i, who, count, &word));
        swarm.pass(Duration::from_secs(10));
        assert_eq!(swarm.outcome(count), outcome, "{word:?}");
    }
}

#[test]
fn who_says_that_it_was_not_a_gesture_denies_what_that_was_merged_into_in_any_order() {
    let ring = anas("ring");
    // To the classifier what is aside is either 2 or 4.
    let guesses = |swarm: &mut Swarm| {
        (0..2).for_each(|i| swarm.input(i, Input::Learned(Arc::new(ByFirst))));
        let of = |trained: &BTreeMap<u64, ClassId>| {
            trained.range(training_key(0)..).map(|(_, class)| class.0).collect::<Vec<_>>()
        };
        swarm.trained.iter().map(of).collect::<Vec<_>>()
    };
    for merged_first in [false, true] {
        let mut swarm = Swarm::new(2, config(2, 1.0), 65);
        swarm.say("ana", new("ring"));
        let round = swarm.show(2);
        let same = Instruction::Same { class: called("ring"), of: called("4") };
        if merged_first {
            swarm.say("ana", same.clone());
        }
        swarm.say("bob", Instruction::Wrong { round, of: called("2") });
        swarm.say("ana", Instruction::Wrong { round, of: Gesture::Class(ring) });
        if !merged_first {
            assert_eq!(guesses(&mut swarm), [[4, 4], [4, 4]], "it is another gesture still");
            swarm.say("ana", same);
        }
        assert_eq!(guesses(&mut swarm), [[]; 2] as [[u32; 0]; 2]);
        swarm.restart(1);
        assert_eq!(guesses(&mut swarm), [[]; 2] as [[u32; 0]; 2]);
        swarm.say("ana", Instruction::Restore { class: called("ring") });
        assert_eq!(guesses(&mut swarm), [[4, 4], [4, 4]], "what was merged is restored");
        swarm.check();
    }
}

#[test]
fn what_makes_no_gesture_is_answered_and_changes_nothing() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 63);
    let room = MAX_CLASSES - CLASSES as usize;
    for n in 0..room {
        let named = swarm.say("ana", new(&format!("gesture {n}")));
        assert_eq!(swarm.outcome(named), Outcome::Learned, "{n}");
    }
    let before = swarm.names(0).clone();
    for (word, outcome) in [
        (new("one more"), Outcome::NoRoom),
        (new(""), Outcome::NoRoom),
        (new(&"x".repeat(65)), Outcome::NoRoom),
        (new("3"), Outcome::Known),
        (Instruction::Retire { class: called("circle") }, Outcome::UnknownGesture),
        (Instruction::Retire { class: Gesture::Class(ClassId(3)) }, Outcome::UnknownGesture),
        (Instruction::Same { class: called("gesture 1"), of: called("gesture 1") }, Outcome::UnknownGesture),
        (Instruction::Same { class: called("gesture 1"), of: called("circle") }, Outcome::UnknownGesture),
    ] {
        let said = swarm.say("ana", word.clone());
        assert_eq!(swarm.outcome(said), outcome, "{word:?}");
    }
    assert_eq!(swarm.names(0), &before);
    swarm.say("ana", Instruction::Retire { class: called("gesture 7") });
    let named = swarm.say("ana", new("one more"));
    assert_eq!(swarm.outcome(named), Outcome::Learned);
}

/// Clients may write each sign of a label as a number, as JSON lets them; who named it is letters.
#[test]
fn the_longest_word_on_names_fits_in_what_a_word_may_take() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 76);
    let long = |letter: &str| format!("{letter:-<32}");
    let label = "<".repeat(MAX_LABEL);
    for by in [long("a"), long("b")] {
        swarm.say(&by, new(&label));
    }
    let class = |by| called(&format!("{label} ({})", long(by)));
    let word = Instruction::Same { class: class("a"), of: class("b") };
    let json = serde_json::to_string(&word).unwrap().replace('<', "\\u003c");
    assert!((800..=MAX_WORD).contains(&json.len()), "{} bytes", json.len());
    let read: Instruction = gestalt_protocol::decode_json(json.as_bytes()).unwrap();
    let said = swarm.say("ana", read);
    assert_eq!(swarm.outcome(said), Outcome::Learned);
}

#[test]
fn what_would_leave_more_gestures_in_use_than_there_is_room_for_is_refused() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 66);
    let gesture = |n: usize| called(&format!("gesture {n}"));
    let room = MAX_CLASSES - CLASSES as usize;
    let expect = |swarm: &mut Swarm, word: Instruction, outcome: Outcome| {
        let before = swarm.names(0).clone();
        let said = swarm.say("ana", word.clone());
        assert_eq!(swarm.outcome(said), outcome, "{word:?}");
        if outcome != Outcome::Learned {
            let fates = |names: &NameBook| -> Vec<_> {
                names.iter().map(|naming| (naming.gesture(), naming.fate)).collect()
            };
            assert_eq!(fates(swarm.names(0)), fates(&before), "{word:?}");
        }
        assert!(swarm.names(0).in_use(MAX_CLASSES).len() <= room, "{word:?}");
        swarm.check_names();
    };
    for n in 0..room {
        expect(&mut swarm, new(&format!("gesture {n}")), Outcome::Learned);
    }
    expect(&mut swarm, Instruction::Retire { class: gesture(7) }, Outcome::Learned);
    expect(&mut swarm, new("one more"), Outcome::Learned);
    expect(&mut swarm, Instruction::Restore { class: gesture(7) }, Outcome::NoRoom);
    // A merge taken back.
    expect(&mut swarm, Instruction::Same { class: gesture(1), of: called("3") }, Outcome::Learned);
    expect(&mut swarm, new("yet one"), Outcome::Learned);
    expect(&mut swarm, Instruction::Restore { class: gesture(1) }, Outcome::NoRoom);
    // What is the same in a circle is one gesture, where each was none.
    expect(&mut swarm, Instruction::Same { class: gesture(1), of: gesture(7) }, Outcome::Learned);
    expect(&mut swarm, Instruction::Same { class: gesture(7), of: gesture(1) }, Outcome::NoRoom);
    expect(&mut swarm, Instruction::Restore { class: gesture(2) }, Outcome::Known);
    expect(&mut swarm, Instruction::Retire { class: gesture(2) }, Outcome::Learned);
    expect(&mut swarm, Instruction::Restore { class: gesture(7) }, Outcome::Learned);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn three_instructors_at_once_end_with_equal_tables_whatever_is_lost(
        words in prop::collection::vec((0..3_usize, 0..4_usize, 0..5_usize, any::<u8>()), 1..40),
        seed in any::<u64>(),
    ) {
        let mut swarm = Swarm::new(4, config(2, 1.0), seed);
        let labels = ["circle", "ring", "hook", "3"];
        for (who, label, word, chance) in words {
            let class = || called(labels[label]);
            let of = || called(labels[usize::from(chance) % 4]);
            let word = match word {
                0 | 1 => new(labels[label]),
                2 => Instruction::Same { class: class(), of: of() },
                3 => Instruction::Retire { class: class() },
                _ => Instruction::Restore { class: class() },
            };
            // Some hear it and some do not; the network loses, and robots die.
            swarm.loss = f64::from(chance % 4) * 0.25;
            let by: InstructorId = ["ana", "bob", "cyn"][who].parse().unwrap();
            let at = swarm.now.as_millis() as u64;
            for i in 0..swarm.minds.len() {
                if chance >> i & 1 == 0 {
                    let instruction = word.clone();
                    swarm.input(i, Input::Instructed(Instructed { by: by.clone(), at, instruction, said: None }));
                }
            }
            swarm.pass(Duration::from_millis(200));
            match chance {
                0..20 => swarm.restart(usize::from(chance) % 4),
                20..25 => swarm.restart_all(),
                _ => {}
            }
        }
        swarm.loss = 0.0;
        swarm.pass(Duration::from_secs(30));
        swarm.check_names();
        for i in 0..swarm.minds.len() {
            let before = swarm.names(i).clone();
            swarm.restart(i);
            prop_assert_eq!(swarm.names(i), &before, "a restart forgets nothing");
        }
        swarm.check_rest();
    }
}

#[test]
fn names_that_cannot_be_taken_in_do_not_keep_robots_talking() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 64);
    swarm.say("ana", new("circle"));
    // Somebody has put a count there that nobody takes in.
    let (by, said_by): (InstructorId, InstructorId) = ("ana".parse().unwrap(), "eve".parse().unwrap());
    let label = "circle".to_owned();
    let wild = Naming { by, label, count: u64::MAX, at: 1, said_by, fate: Fate::Retired, said: None };
    swarm.minds[0].learning.as_mut().unwrap().remember_naming(&wild);
    swarm.pass(Duration::from_secs(120));
    assert_ne!(swarm.names(0), swarm.names(1));
    swarm.check_rest();
}

#[test]
fn as_many_words_as_one_message_brings_train_each_sample_once() {
    let mut swarm = Swarm::new(2, config(4, 1.0), 67);
    swarm.say("ana", new("circle"));
    let round = swarm.show(2);
    swarm.say("ana", Instruction::Was { round, class: called("circle") });
    let by: InstructorId = "ana".parse().unwrap();
    let word = |label: &str, count: u64, fate| {
        let (by, said_by, label) = (by.clone(), by.clone(), label.to_owned());
        Naming { by, label, count, at: count, said_by, fate, said: None }
    };
    let mut trained = |namings: Vec<Naming>, sequence| {
        let (stamp, message) = (Stamp { boot: 1 << 20, sequence }, Message::Namings(Namings { namings }));
        let envelope = Envelope { author: RobotId(9), stamp, message, signature: None };
        let outputs = swarm.minds[0].handle(swarm.now, Input::Received(envelope));
        let changes = outputs.into_iter().filter_map(|output| match output {
            Output::Train(changes) => Some(changes),
            _ => None,
        });
        let mut classes: BTreeMap<Option<ClassId>, usize> = BTreeMap::new();
        for change in changes.flatten() {
            *classes.entry(inserted(change).map(|(_, class)| class)).or_default() += 1;
        }
        classes
    };
    let first = 1 << 20;
    // Retired and restored, by turns; the last word stands.
    let turns = (0..MAX_NAMED as u64).map(|n| {
        let fate = if n % 2 == 0 { Fate::InUse } else { Fate::Retired };
        word("circle", first + n, fate)
    });
    assert_eq!(trained(turns.collect(), 1), [(None, 8)].into(), "four looks of each of two");
    // The same as another, which is the same as another, and so on.
    let chain = (1..MAX_NAMED).map(|n| {
        let label = if n == 1 { "circle".to_owned() } else { n.to_string() };
        let of = anas(&(n + 1).to_string());
        word(&label, 2 * first, if n == MAX_NAMED - 1 { Fate::InUse } else { Fate::Same(of) })
    });
    let last = anas(&(MAX_NAMED - 1).to_string());
    assert_eq!(trained(chain.collect(), 2), [(Some(last), 8)].into());
}

#[test]
fn what_goes_is_trained_on_no_more_before_another_gesture_takes_its_place() {
    let mut swarm = Swarm::new(1, config(2, 0.0), 71);
    // Samples of the first gesture, by number, are trained on before those of the second.
    let mut labels = ["circle", "ring"];
    labels.sort_unstable_by_key(|label| anas(label));
    for label in labels {
        let round = swarm.show(2);
        swarm.say("ana", Instruction::New { label: label.to_owned(), round: Some(round) });
    }
    for retired in [0, 1, 0] {
        let known = |at: usize| swarm.names(0).get(anas(labels[at])).unwrap().clone();
        let word = |at: usize, fate| Naming { count: known(at).count + 1, fate, ..known(at) };
        let namings = vec![word(1 - retired, Fate::InUse), word(retired, Fate::Retired)];
        let message = Message::Namings(Namings { namings });
        let stamp = Stamp { boot: 1 << 20, sequence: 1 };
        let said = Envelope { author: RobotId(9), stamp, message, signature: None };
        let outputs = swarm.minds[0].handle(swarm.now, Input::Received(said));
        let changes = outputs.into_iter().filter_map(|output| match output {
            Output::Train(changes) => Some(changes),
            _ => None,
        });
        let goes: Vec<bool> = changes.flatten().map(|change| inserted(change).is_none()).collect();
        assert!(goes.contains(&true) && goes.is_sorted_by(|before, after| before >= after), "{goes:?}");
    }
}
