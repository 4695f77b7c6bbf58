//! What becomes of names, in whatever order they are heard.

use proptest::prelude::*;

use super::*;

fn who(name: &str) -> InstructorId {
    name.parse().unwrap()
}

fn naming(by: &str, label: &str, count: u64, fate: Fate) -> Naming {
    Naming { by: who(by), label: label.to_owned(), count, at: 7, said_by: who(by), fate, said: None }
}

fn book(said: &[Naming]) -> NameBook {
    let mut book = NameBook::default();
    said.iter().for_each(|naming| {
        book.hear(naming);
    });
    book
}

#[test]
fn a_word_on_a_gesture_replaces_the_earlier_and_nothing_is_lost() {
    let [circle, ring] = ["circle", "ring"].map(|label| ClassId::named(&who("ana"), label));
    let mut book = book(&[naming("ana", "circle", 1, Fate::InUse), naming("ana", "ring", 1, Fate::InUse)]);
    assert_eq!(book.in_use(64), [circle, ring].into());
    book.hear(&naming("ana", "ring", 2, Fate::Same(circle)));
    assert_eq!((book.stands_for(ring), book.in_use(64)), (Some(circle), [circle].into()));
    assert_eq!(book.titles(&[])[&ring], "circle");
    book.hear(&naming("ana", "circle", 2, Fate::Retired));
    assert_eq!((book.stands_for(ring), book.stands_for(circle)), (None, None));
    book.hear(&naming("ana", "circle", 3, Fate::InUse));
    book.hear(&naming("ana", "ring", 3, Fate::InUse));
    assert_eq!(book.in_use(64), [circle, ring].into());
    assert_eq!(book.hear(&naming("ana", "ring", 2, Fate::Retired)), NamingReceipt::Known);
}

/// What is named in a sealed swarm counts by the time: seconds since 1970, in parts of 2⁻³².
const SIGNED: u64 = 1_796_000_000 << 32;

#[test]
fn where_a_sealed_swarm_was_opened_a_newcomer_learns_its_names_whatever_was_said_to_it_before() {
    let mut swarms = NameBook::default();
    swarms.hear_by(&naming("ana", "circle", SIGNED, Fate::InUse), Some(Standing::Teaches));
    let circle = ClassId::named(&who("ana"), "circle");
    for said_before in [None, Some(naming("ana", "circle", 1, Fate::Retired))] {
        let mut newcomer = book(said_before.as_slice());
        let next = naming("ana", "circle", SIGNED + 1, Fate::Retired);
        for word in [swarms.get(circle).unwrap().clone(), next] {
            assert_eq!(newcomer.hear(&word), NamingReceipt::New);
            assert_eq!(newcomer.get(circle), Some(&word));
        }
    }
}

#[test]
fn no_word_on_a_name_is_beyond_correction_nor_keeps_it_from_whoever_comes_later() {
    for known in [1, SIGNED, HIGHEST_COUNT] {
        let said = naming("ana", "circle", known, Fate::InUse);
        let mut swarms = book(std::slice::from_ref(&said));
        let forged = |count| naming("ana", "circle", count, Fate::Retired);
        assert_eq!(swarms.hear(&forged(u64::MAX)), NamingReceipt::FarAhead);
        // As far as may be, over and over.
        for _ in 0..100 {
            let before = swarms.get(said.gesture()).unwrap().count;
            let furthest = (before + COUNT_LEAP).max(HIGHEST_COUNT);
            assert_eq!(swarms.hear(&forged(furthest + 1)), NamingReceipt::FarAhead);
            assert_eq!(swarms.hear(&forged(furthest)), NamingReceipt::New);
            let corrected = naming("ana", "circle", furthest + 1, Fate::InUse);
            assert_eq!(swarms.hear(&corrected), NamingReceipt::New);
            assert_eq!(NameBook::default().hear(&corrected), NamingReceipt::New, "also whoever comes later");
        }
    }
}

#[test]
fn what_is_the_same_in_a_circle_is_the_smallest() {
    let ids: Vec<ClassId> = ["a", "b", "c"].map(|label| ClassId::named(&who("ana"), label)).into();
    let same = |label, other| naming("ana", label, 1, Fate::Same(ids[other]));
    let book = book(&[same("a", 1), same("b", 2), same("c", 0)]);
    for id in &ids {
        assert_eq!(book.stands_for(*id), ids.iter().min().copied());
    }
    assert_eq!(NameBook::default().stands_for(ids[0]), None, "nobody named it");
    assert_eq!(NameBook::default().stands_for(ClassId(3)), Some(ClassId(3)));
}

#[test]
fn two_who_choose_one_label_name_two_gestures() {
    let [anas, bobs] = ["ana", "bob"].map(|by| ClassId::named(&who(by), "circle"));
    let mut book = book(&[naming("ana", "circle", 1, Fate::InUse)]);
    assert_eq!(book.find("circle", &who("cyn")), Some(anas));
    book.hear(&naming("bob", "circle", 1, Fate::InUse));
    assert_eq!(book.find("circle", &who("ana")), Some(anas));
    assert_eq!(book.find("circle", &who("bob")), Some(bobs));
    assert_eq!(book.find("circle", &who("cyn")), None, "which one?");
    assert_eq!(book.find("circle (bob)", &who("cyn")), Some(bobs));
    assert_eq!(book.titles(&[])[&bobs], "circle (bob)");
}

#[test]
fn what_is_called_as_another_can_be_is_told_from_it() {
    let (anas, bobs) = (ClassId::named(&who("ana"), "circle"), ClassId::named(&who("bob"), "circle (ana)"));
    let said = [naming("ana", "circle", 1, Fate::InUse), naming("bob", "circle (ana)", 1, Fate::InUse)];
    let mut book = book(&said);
    for by in ["ana", "bob", "cyn"] {
        assert_eq!(book.find("circle (ana)", &who(by)), Some(anas), "as {by} says it");
        assert_eq!(book.find("circle (ana) (bob)", &who(by)), Some(bobs));
    }
    assert_eq!(book.titles(&[]), [(anas, "circle".into()), (bobs, "circle (ana) (bob)".into())].into());
    book.hear(&naming("cyn", "circle", 1, Fate::InUse));
    let titles = book.titles(&[]);
    assert_eq!((&*titles[&anas], &*titles[&bobs]), ("circle (ana)", "circle (ana) (bob)"));
}

#[test]
fn what_was_shown_is_in_use_and_what_is_restored_is_not() {
    let [anas, bobs] = ["ana", "bob"].map(|by| ClassId::named(&who(by), "circle"));
    let mut book = book(&[naming("ana", "circle", 1, Fate::Retired)]);
    assert_eq!(book.find_shown("circle", &who("ana")), Some(anas), "there is no other");
    book.hear(&naming("bob", "circle", 1, Fate::InUse));
    assert_eq!(book.find_shown("circle", &who("ana")), Some(bobs));
    assert_eq!(book.find("circle", &who("ana")), Some(anas));
    book.hear(&naming("ana", "circle", 2, Fate::InUse));
    assert_eq!(book.find_shown("circle", &who("ana")), Some(anas));
    // Merged into another: the label is that of bob's from then on.
    book.hear(&naming("ana", "circle", 3, Fate::Same(ClassId(3))));
    assert_eq!(
        (book.titles(&[])[&bobs].as_str(), book.find_shown("circle", &who("ana"))),
        ("circle", Some(bobs))
    );
    assert_eq!(book.find_shown("circle (ana)", &who("ana")), Some(anas));
    book.hear(&naming("bob", "circle", 2, Fate::Retired));
    assert_eq!(book.find_shown("circle", &who("ana")), Some(anas), "there is no other");
}

/// What a gesture is by now, as the words on it read.
fn step_by_step(book: &NameBook, gesture: ClassId) -> Option<ClassId> {
    let mut passed = vec![gesture];
    loop {
        let at = *passed.last()?;
        match book.get(at).map(|naming| naming.fate) {
            None => return (!at.is_named()).then_some(at),
            Some(Fate::InUse) => return Some(at),
            Some(Fate::Retired) => return None,
            Some(Fate::Same(other)) => match passed.iter().position(|known| *known == other) {
                Some(begin) => return passed[begin..].iter().min().copied(),
                None => passed.push(other),
            },
        }
    }
}

proptest! {
    #[test]
    fn in_any_order_and_however_often_robots_come_to_the_same(
        said in prop::collection::vec((0..3_usize, 0..5_usize, 0..4_u64, 0..8_usize), 0..60),
        order in any::<prop::sample::Index>(),
    ) {
        let who = ["ana", "bob", "cyn"];
        let labels = ["a", "b", "c", "d", "e"];
        let id = |n: usize| ClassId::named(&who[n % 3].parse().unwrap(), labels[n % 5]);
        let said: Vec<Naming> = said.into_iter().map(|(by, label, count, fate)| {
            let fate = match fate {
                0..3 => Fate::InUse,
                3 => Fate::Retired,
                4 => Fate::Same(ClassId(2)),
                n => Fate::Same(id(n)),
            };
            naming(who[by], labels[label], count, fate)
        }).collect();
        let forwards = book(&said);
        let middle = order.index(said.len() + 1);
        let turned: Vec<Naming> =
            said[middle..].iter().chain(&said[..middle]).rev().chain(&said).cloned().collect();
        let turned = book(&turned);
        prop_assert_eq!(forwards.digest(7), turned.digest(7));
        let all = forwards.all_stand_for();
        for naming in forwards.iter() {
            let stands = forwards.stands_for(naming.gesture());
            prop_assert_eq!(stands, step_by_step(&forwards, naming.gesture()));
            prop_assert_eq!(all.get(&naming.gesture()), Some(&stands));
            prop_assert!(stands.is_none_or(|stands| forwards.stands_for(stands) == Some(stands)));
        }
        prop_assert_eq!(forwards, turned);
    }
}

#[test]
fn of_ever_so_many_all_robots_keep_the_same() {
    let all: Vec<Naming> =
        (0..3 * MAX_NAMED).map(|n| naming("ana", &n.to_string(), 1, Fate::InUse)).collect();
    let forwards = book(&all);
    let backwards = book(&all.iter().rev().cloned().collect::<Vec<_>>());
    assert_eq!(forwards.iter().count(), MAX_NAMED);
    assert_eq!(forwards, backwards);
    assert_eq!(forwards.in_use(58).len(), 58);
}

#[test]
fn whoever_may_only_vouch_makes_nobody_elses_gesture_give_way() {
    let circle = naming("ana", "circle", 1, Fate::InUse);
    let vouched = (0_u32..).map(|n| naming("guest", &n.to_string(), 1, Fate::InUse));
    let vouched: Vec<Naming> =
        vouched.filter(|naming| naming.gesture() < circle.gesture()).take(2 * MAX_NAMED).collect();
    let (mut before, mut after) = (NameBook::default(), NameBook::default());
    before.hear_by(&circle, Some(Standing::Teaches));
    vouched.iter().for_each(|naming| {
        before.hear_by(naming, Some(Standing::Vouched));
    });
    assert!(after.has_room(58, &circle, Some(Standing::Vouched)));
    vouched.iter().rev().for_each(|naming| {
        after.hear_by(naming, Some(Standing::Vouched));
    });
    assert!(!after.has_room(58, &circle, Some(Standing::Vouched)));
    assert!(after.has_room(58, &circle, Some(Standing::Teaches)));
    after.hear_by(&circle, Some(Standing::Teaches));
    assert_eq!(before, after);
    assert_eq!(before.iter().count(), MAX_NAMED);
    assert!(before.in_use(58).contains(&circle.gesture()) && before.in_use(58).len() == 58);
}

/// Whoever may teach can look for labels of small numbers, and make room for more among those in use by retiring them.
#[test]
fn whoever_names_ever_so_many_makes_nobody_elses_give_way() {
    let circle = naming("ana", "circle", 1, Fate::InUse);
    let smaller = (0_u32..).map(|n| naming("eve", &n.to_string(), 2, Fate::Retired));
    let smaller: Vec<Naming> =
        smaller.filter(|naming| naming.gesture() < circle.gesture()).take(MAX_NAMED).collect();
    let mut before = book(std::slice::from_ref(&circle));
    let mut after = book(&smaller);
    assert_eq!(after.iter().count(), MAX_NAMED);
    smaller.iter().for_each(|naming| {
        before.hear(naming);
    });
    assert!(after.has_room(58, &circle, None));
    assert_eq!(after.hear(&circle), NamingReceipt::New);
    assert_eq!(before, after);
    let stays = after.get(circle.gesture());
    assert_eq!((stays, after.iter().count()), (Some(&circle), MAX_NAMED));
    let last = smaller.iter().max_by_key(|naming| naming.gesture()).unwrap();
    assert_eq!(after.hear(last), NamingReceipt::Full, "what gave way does not come again and again");
    // Of those in use that are more than can be told apart, it is one that is.
    let restored = smaller.iter().map(|naming| Naming { count: 3, fate: Fate::InUse, ..naming.clone() });
    restored.for_each(|naming| {
        after.hear(&naming);
    });
    assert!(after.in_use(58).contains(&circle.gesture()));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// Some named many and some few, and of some gestures somebody with a key spoke as well.
    #[test]
    fn of_more_than_are_kept_robots_keep_the_same_in_any_order(
        said in Just(crowd()).prop_shuffle(), again in Just(crowd()).prop_shuffle()
    ) {
        let heard = |said: &[(Naming, Standing)]| {
            let mut book = NameBook::default();
            said.iter().for_each(|(naming, standing)| {
                book.hear_by(naming, Some(*standing));
            });
            book
        };
        let (one, other) = (heard(&said), heard(&again));
        prop_assert_eq!(one.iter().count(), MAX_NAMED);
        let mut kept: BTreeMap<InstructorId, usize> = BTreeMap::new();
        one.iter().for_each(|naming| *kept.entry(naming.by.clone()).or_default() += 1);
        let mut kept: Vec<usize> = kept.into_values().collect();
        kept.sort_unstable();
        // All of those who named few, and what somebody with a key spoke of.
        prop_assert_eq!(kept, [3, 30, 34, 40, 74, 75]);
        prop_assert_eq!(one, other);
    }
}

fn crowd() -> Vec<(Naming, Standing)> {
    let mut who_named = ["ana", "bob", "cyn", "eve"];
    // Whoever named most has the smallest numbers.
    who_named.sort_unstable_by_key(|by| ClassId::named(&who(by), "0"));
    let named = who_named.into_iter().zip([300, 130, 40, 3]).chain([("guest", 100), ("other", 90)]);
    let mut crowd = Vec::new();
    for (by, n) in named {
        let standing = if n == 100 || n == 90 { Standing::Vouched } else { Standing::Teaches };
        for label in 0..n {
            crowd.push((naming(by, &label.to_string(), 1, Fate::InUse), standing));
            if standing == Standing::Vouched && label % 3 == 0 {
                let said_by = who("bob");
                let fate = Fate::Retired;
                let retired = Naming { said_by, ..naming(by, &label.to_string(), 2, fate) };
                crowd.push((retired, Standing::Teaches));
            }
        }
    }
    crowd
}
