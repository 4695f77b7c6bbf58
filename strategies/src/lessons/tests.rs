//! What books of lessons hold.

use gestalt_protocol::RobotId;
use proptest::prelude::*;

use super::*;

fn lesson(counter: u32, who: &str, count: u64, word: Word) -> Lesson {
    let round = RoundId { counter, opener: RobotId(1), life: 0 };
    Lesson { round, instructor: who.parse().unwrap(), count, at: 7, word, said: None }
}

fn six() -> Candidates {
    Candidates::of((0..6).map(ClassId))
}

fn was(class: u32) -> Word {
    Word::Was(ClassId(class))
}

fn not(class: u32) -> Word {
    Word::Not(ClassId(class))
}

fn verdict(words: &[(&str, u64, Word)]) -> Verdict {
    let mut book = LessonBook::default();
    for (who, at, word) in words {
        book.hear(&lesson(1, who, *at, *word));
    }
    book.verdict(RoundId { counter: 1, opener: RobotId(1), life: 0 }, &six())
}

#[test]
fn words_add_up_and_the_latest_settles_a_contradiction() {
    let class = |class| Verdict::Class(ClassId(class));
    assert_eq!(verdict(&[]), Verdict::Unsaid);
    assert_eq!(verdict(&[("ada", 1, was(3))]), class(3));
    assert_eq!(verdict(&[("ada", 1, was(3)), ("ada", 2, was(4))]), class(4));
    assert_eq!(verdict(&[("ada", 1, was(3)), ("bob", 2, was(4))]), class(4));
    assert_eq!(verdict(&[("ada", 1, was(3)), ("bob", 2, not(4))]), class(3), "no contradiction");
    assert_eq!(verdict(&[("ada", 1, was(3)), ("ada", 2, Word::Retracted)]), Verdict::Retracted);
    assert_eq!(verdict(&[("ada", 1, was(3)), ("ada", 2, Word::Retracted), ("bob", 1, was(2))]), class(2));
    let Verdict::Among(candidates) = verdict(&[("ada", 1, not(3)), ("bob", 2, not(5))]) else {
        panic!("not one alone")
    };
    let left: Vec<u32> = (0..8).filter(|class| candidates.contains(ClassId(*class))).collect();
    assert_eq!(left, [0, 1, 2, 4]);
    let four = [("a", 1, not(0)), ("b", 1, not(1)), ("c", 1, not(2)), ("d", 1, not(3)), ("e", 1, not(5))];
    assert_eq!(verdict(&four), class(4), "only one is left");
}

#[test]
fn who_denies_a_gesture_denies_what_it_has_become() {
    let ring = ClassId::named(&"ana".parse().unwrap(), "ring");
    let merged = six().with_merged([(ring, ClassId(4))]);
    let (was_ring, not_ring) = (Word::Was(ring), Word::Not(ring));
    for (words, left) in [
        (vec![not_ring], vec![0, 1, 2, 3, 5]),
        (vec![not(4)], vec![0, 1, 2, 3, 5]),
        // A contradiction: the later counts.
        (vec![was(4), not_ring], vec![0, 1, 2, 3, 5]),
        (vec![was_ring, not(4)], vec![0, 1, 2, 3, 5]),
        (vec![not_ring, was(4)], vec![4]),
        // None, whichever was said first.
        (vec![was_ring, not(3)], vec![ring.0]),
        (vec![not(3), was_ring], vec![ring.0]),
    ] {
        let mut book = LessonBook::default();
        for (n, word) in words.iter().enumerate() {
            book.hear(&lesson(1, &format!("i{n}"), n as u64 + 1, *word));
        }
        let found = match book.verdict(RoundId { counter: 1, opener: RobotId(1), life: 0 }, &merged) {
            Verdict::Class(class) => vec![class.0],
            Verdict::Among(candidates) => candidates.classes.iter().map(|class| class.0).collect(),
            verdict => panic!("{verdict:?}"),
        };
        assert_eq!(found, left, "{words:?}");
    }
    let names: Vec<ClassId> = merged.all_names_of(ring).classes.into_iter().collect();
    assert_eq!(names, [ClassId(4), ring]);
    assert_eq!(merged.all_names_of(ClassId(3)).only(), Some(ClassId(3)));
}

#[test]
fn who_said_the_same_before_and_after_a_merge_agree_until_it_is_undone() {
    let ring = ClassId::named(&"ana".parse().unwrap(), "ring");
    let apart = Candidates::of(six().classes.into_iter().chain([ring]));
    let merged = six().with_merged([(ring, ClassId(4))]);
    let round = lesson(1, "ana", 1, was(4)).round;
    for (of_ana, of_bob) in [(Word::Was(ring), was(4)), (was(4), Word::Was(ring))] {
        let mut book = LessonBook::default();
        for (count, (who, word)) in (1..).zip([("ana", of_ana), ("bob", of_bob), ("cyn", not(3))]) {
            book.hear(&lesson(1, who, count, word));
        }
        let Verdict::Class(found) = book.verdict(round, &merged) else { panic!("they agree") };
        assert!(merged.are_one(found, ClassId(4)));
        let Verdict::Among(found) = book.verdict(round, &apart) else { panic!("two gestures again") };
        assert_eq!((found.contains(ClassId(3)), found.classes.len()), (false, 6), "the latest word alone");
        // Each of them said it, whoever takes back.
        book.hear(&lesson(1, "bob", 9, Word::Retracted));
        let Word::Was(anas) = of_ana else { unreachable!() };
        assert_eq!(book.verdict(round, &apart), Verdict::Class(anas));
    }
}

proptest! {
    #[test]
    fn the_order_and_repetition_of_lessons_make_no_difference(
        lessons in prop::collection::vec((0..4_u32, 0..3_usize, 0..5_u64, 0..3_u32, any::<bool>()), 0..40),
        order in any::<prop::sample::Index>(),
    ) {
        let lessons: Vec<Lesson> = lessons
            .into_iter()
            .map(|(round, who, at, class, is)| {
                lesson(round, ["ada", "bob", "cyn"][who], at, if is { was(class) } else { not(class) })
            })
            .collect();
        let mut forwards = LessonBook::default();
        lessons.iter().for_each(|lesson| { forwards.hear(lesson); });
        let mut turned = LessonBook::default();
        let middle = order.index(lessons.len() + 1);
        let twice = lessons[middle..].iter().chain(&lessons[..middle]).rev().chain(&lessons);
        twice.for_each(|lesson| { turned.hear(lesson); });
        prop_assert_eq!(forwards.digest(7), turned.digest(7));
        prop_assert_eq!(forwards.rounds, turned.rounds);
    }
}

#[test]
fn the_oldest_rounds_are_forgotten_and_not_taken_up_again() {
    let mut book = LessonBook::default();
    for counter in 0..MAX_LESSONS as u32 + 10 {
        assert_eq!(book.hear(&lesson(counter + 5, "ada", 1, was(1))), LessonReceipt::New);
    }
    assert_eq!(book.len(), MAX_LESSONS);
    assert_eq!(book.hear(&lesson(1, "ada", 1, was(1))), LessonReceipt::Full);
    let mut fresh = LessonBook::default();
    book.rounds.keys().for_each(|round| {
        fresh.hear(&lesson(round.counter, "ada", 1, was(1)));
    });
    assert_eq!(book.digest(7), fresh.digest(7), "the digest is of what is kept");
}

#[test]
fn a_round_has_only_so_many_instructors_and_none_heard_before_is_locked_out() {
    let mut book = LessonBook::default();
    assert_eq!(book.hear(&lesson(1, "ada", 1, was(1))), LessonReceipt::New);
    for i in 0..MAX_INSTRUCTORS {
        assert_eq!(book.hear(&lesson(2, &format!("i{i}"), 1, was(1))), LessonReceipt::New);
    }
    assert_eq!(book.hear(&lesson(2, "one-more", 1, was(1))), LessonReceipt::Full);
    assert_eq!(book.hear(&lesson(2, "i3", 2, was(2))), LessonReceipt::New, "who is known may speak again");
    assert_eq!(book.hear(&lesson(2, "ada", 3, was(4))), LessonReceipt::New, "the newest name gives way");
    let round = lesson(2, "ada", 1, was(1)).round;
    assert_eq!(book.of(round).count(), MAX_INSTRUCTORS);
    assert_eq!(book.verdict(round, &six()), Verdict::Class(ClassId(4)));
    for i in 0..2 * MAX_FAMILIAR {
        book.hear(&lesson(3 + i as u32 / 10, &format!("flood{i}"), 1, was(1)));
    }
    assert_eq!(book.familiar.len(), MAX_FAMILIAR);
}

#[test]
fn no_word_is_beyond_correction() {
    let mut book = LessonBook::default();
    let round = lesson(1, "ada", 1, was(1)).round;
    assert_eq!(book.hear(&lesson(1, "ada", u64::MAX, Word::Retracted)), LessonReceipt::FarAhead);
    // As far as may be, and at a time that no clock comes to.
    for _ in 0..100 {
        let count = book.highest_count([round]) + COUNT_LEAP;
        let forged = Lesson { at: u64::MAX, ..lesson(1, "ada", count, Word::Retracted) };
        assert_eq!(book.hear(&forged), LessonReceipt::New);
        let count = book.highest_count([round]) + 1;
        assert_eq!(book.hear(&lesson(1, "ada", count, was(2))), LessonReceipt::New);
        assert_eq!(book.verdict(round, &six()), Verdict::Class(ClassId(2)));
    }
}

/// Of a round that has one name.
fn hear_among(
    book: &mut LessonBook,
    lesson: &Lesson,
    standing: Option<Standing>,
    lived: impl Fn(RoundId) -> bool,
) -> LessonReceipt {
    book.hear_among(book.highest_count([lesson.round]), lesson, standing, lived).0
}

#[test]
fn made_up_rounds_keep_nobody_from_teaching() {
    let mut book = LessonBook::default();
    let lived = |round: RoundId| round.life == 0;
    let made_up = |i: u32| {
        let round = RoundId { counter: 9, opener: RobotId(u32::MAX), life: 1 + i };
        Lesson { round, ..lesson(9, "eve", 1, was(1)) }
    };
    for i in 0..2 * MAX_LESSONS as u32 {
        hear_among(&mut book, &made_up(i), None, lived);
    }
    assert_eq!(book.len(), MAX_LESSONS);
    for counter in 1..9 {
        assert_eq!(
            hear_among(&mut book, &lesson(counter, "ada", 1, was(3)), None, lived),
            LessonReceipt::New
        );
    }
    for i in 0..2 * MAX_LESSONS as u32 {
        hear_among(&mut book, &made_up(u32::MAX / 2 + i), None, lived);
    }
    assert_eq!(book.len(), MAX_LESSONS);
    assert!((1..9).all(|counter| book.contains(lesson(counter, "ada", 1, was(3)).round)));
}

fn hear_by(book: &mut LessonBook, lesson: &Lesson) -> LessonReceipt {
    let standing = match lesson.instructor.to_string().as_str() {
        "ada" | "eli" => Standing::Overrules,
        "guest" => Standing::Vouched,
        _ => Standing::Teaches,
    };
    hear_among(book, lesson, Some(standing), |_| false)
}

#[test]
fn who_may_not_overrule_is_heard_where_nobody_else_has_spoken() {
    let verdict = |words: &[(&str, u64, Word)]| {
        let mut book = LessonBook::default();
        for (who, count, word) in words {
            hear_by(&mut book, &lesson(1, who, *count, *word));
        }
        book.verdict(lesson(1, "ada", 1, was(1)).round, &six())
    };
    let class = |class| Verdict::Class(ClassId(class));
    assert_eq!(verdict(&[("bob", 5, was(1)), ("cyn", 6, was(2))]), class(1), "bob was first");
    assert_eq!(verdict(&[("cyn", 6, was(2)), ("bob", 5, was(1))]), class(1), "whoever is heard first");
    assert_eq!(verdict(&[("bob", 5, was(1)), ("ada", 4, was(2))]), class(2));
    assert_eq!(verdict(&[("ada", 4, was(2)), ("eli", 5, was(3))]), class(3), "of those who may, the latest");
    assert_eq!(verdict(&[("bob", 5, was(1)), ("guest", 0, was(2))]), class(1), "who has a key goes before");
    assert_eq!(verdict(&[("bob", 5, was(1)), ("ada", 4, Word::Retracted)]), class(1));
    let Verdict::Among(left) = verdict(&[("bob", 5, not(1)), ("cyn", 6, not(2))]) else { panic!("not one") };
    assert!(left.contains(ClassId(2)), "cyn adds nothing to what bob said");
    assert_eq!(verdict(&[("ada", u64::MAX, was(2))]), class(2), "what is signed is never too far ahead");
}

proptest! {
    #[test]
    fn by_whichever_right_the_order_of_lessons_makes_no_difference(
        said in prop::collection::vec((0..4_usize, 0..5_u64, 0..3_u32, 0..3_u8), 0..30),
        order in any::<prop::sample::Index>(),
    ) {
        let said: Vec<Lesson> = said
            .into_iter()
            .map(|(who, count, class, kind)| {
                let word = [was(class), not(class), Word::Retracted][usize::from(kind)];
                lesson(1, ["ada", "bob", "cyn", "guest"][who], count, word)
            })
            .collect();
        let (mut forwards, mut turned) = (LessonBook::default(), LessonBook::default());
        said.iter().for_each(|lesson| { hear_by(&mut forwards, lesson); });
        let middle = order.index(said.len() + 1);
        let twice = said[middle..].iter().chain(&said[..middle]).rev().chain(&said);
        twice.for_each(|lesson| { hear_by(&mut turned, lesson); });
        prop_assert_eq!(forwards.digest(7), turned.digest(7));
        let round = lesson(1, "ada", 1, was(1)).round;
        prop_assert_eq!(forwards.verdict(round, &six()), turned.verdict(round, &six()));
    }
}

#[test]
fn rounds_that_robots_vouch_for_push_out_none_that_somebody_with_a_key_spoke_of() {
    let mut book = LessonBook::default();
    let word = |counter, who| lesson(counter, who, 1, was(1));
    assert_eq!(hear_by(&mut book, &word(5, "bob")), LessonReceipt::New);
    for counter in 10..10 + MAX_LESSONS as u32 {
        hear_by(&mut book, &word(counter, "guest"));
    }
    assert_eq!(book.len(), MAX_LESSONS);
    assert!(book.contains(word(5, "bob").round) && !book.contains(word(10, "guest").round));
    assert_eq!(hear_by(&mut book, &word(4, "ada")), LessonReceipt::New, "older, and by somebody with a key");
    assert!(book.contains(word(5, "bob").round) && !book.contains(word(11, "guest").round));
}

proptest! {
    #[test]
    fn of_more_instructors_than_are_kept_all_robots_keep_the_same(
        said in prop::collection::vec((0..40_usize, 0..5_u64, 0..3_u32), 0..80),
        order in any::<prop::sample::Index>(),
    ) {
        let standing = |name: usize| [Standing::Overrules, Standing::Teaches][usize::from(name > 3)];
        let standing = |name| if name > 8 { Standing::Vouched } else { standing(name) };
        let said: Vec<(Lesson, Standing)> = said
            .into_iter()
            .map(|(name, count, class)| (lesson(1, &format!("i{name:02}"), count, was(class)), standing(name)))
            .collect();
        let (mut forwards, mut turned) = (LessonBook::default(), LessonBook::default());
        let hear = |book: &mut LessonBook, (lesson, standing): &(Lesson, Standing)| {
            hear_among(book, lesson, Some(*standing), |_| false);
        };
        said.iter().for_each(|said| hear(&mut forwards, said));
        let middle = order.index(said.len() + 1);
        let twice = said[middle..].iter().chain(&said[..middle]).rev().chain(&said);
        twice.for_each(|said| hear(&mut turned, said));
        prop_assert_eq!(forwards.rounds, turned.rounds);
    }
}
