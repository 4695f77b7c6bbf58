//! Who says what was shown where somebody else has.

use super::believing::was;
use super::*;
use crate::believe::Standing;

const TEACHERS: &[(&str, Standing)] =
    &[("bob", Standing::Teaches), ("cyn", Standing::Teaches), ("guest", Standing::Vouched)];

#[test]
fn who_was_first_to_say_what_was_shown_is_overruled_by_nobody_who_may_not() {
    let mut swarm = Swarm::sealed(51);
    swarm.believe(TEACHERS);
    let round = swarm.show(1);
    let say = |swarm: &mut Swarm, who: &str, count, instruction| {
        (0..3).for_each(|i| swarm.hear(i, who, count, &instruction));
        swarm.pass(Duration::from_secs(10));
        (swarm.outcome(count), swarm.lessons(), swarm.of_class(3)[0] + swarm.of_class(4)[0])
    };
    assert_eq!(say(&mut swarm, "guest", 700, was(round, 3)), (Outcome::Learned, vec![1; 3], 9));
    assert_eq!(say(&mut swarm, "bob", 710, was(round, 4)).0, Outcome::Learned, "a key goes before none");
    assert_eq!(swarm.of_class(4), [9; 3]);
    // However little it says that it had said before.
    for (who, count) in [("cyn", 600), ("cyn", 720), ("guest", 721)] {
        assert_eq!(say(&mut swarm, who, count, was(round, 3)).0, Outcome::NotAllowed, "{who}");
        assert_eq!(swarm.of_class(4), [9; 3]);
    }
    let new = Instruction::New { label: "circle".to_owned(), round: Some(round) };
    assert_eq!(say(&mut swarm, "cyn", 722, new).0, Outcome::NotAllowed);
    assert!(swarm.minds[0].learned().unwrap().named.is_empty(), "it changed nothing");
    assert_eq!(say(&mut swarm, "bob", 730, was(round, 2)).0, Outcome::Learned, "its own word it may mend");
    assert_eq!(say(&mut swarm, "bob", 740, Instruction::Retract { round }).0, Outcome::Learned);
    assert_eq!(say(&mut swarm, "cyn", 750, was(round, 3)).0, Outcome::Learned);
    swarm.check();
}

#[test]
fn a_word_that_taught_nothing_or_may_be_said_no_more_keeps_nobody_from_teaching() {
    let mut swarm = Swarm::sealed(52);
    swarm.believe(TEACHERS);
    let round = swarm.show(1);
    swarm.hear(0, "bob", 700, &was(round, 77));
    swarm.hear(0, "bob", 701, &was(RoundId { counter: 900, ..round }, 3));
    swarm.pass(Duration::from_secs(10));
    assert_eq!([swarm.outcome(700), swarm.outcome(701)], [Outcome::UnknownGesture, Outcome::UnknownRound]);
    swarm.hear(0, "cyn", 710, &was(round, 3));
    swarm.pass(Duration::from_secs(10));
    assert_eq!((swarm.outcome(710), swarm.of_class(3)), (Outcome::Learned, vec![9; 3]));
    // It lost its role, or its key.
    swarm.believe(&[("bob", Standing::Teaches)]);
    swarm.hear(0, "bob", 720, &was(round, 4));
    swarm.pass(Duration::from_secs(10));
    assert_eq!((swarm.outcome(720), swarm.of_class(4)), (Outcome::Learned, vec![9; 3]));
}
