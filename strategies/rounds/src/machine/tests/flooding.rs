//! Who floods a robot costs it little, and costs nobody else anything.

use super::*;

/// A thousand inputs within a second.
fn flood(mind: &mut Rounds, from: Duration, input: impl Fn(u32) -> Input) -> Vec<Output> {
    (0..1000).flat_map(|n| mind.handle(from + ms(n.into()), input(n))).collect()
}

fn have(from: u32, sequence: u32) -> Input {
    let have =
        Have { round: None, decision: None, holders: 0, votes: Vec::new(), knowledge: None, answer: false };
    says(from, sequence, Message::Have(have))
}

fn gives(out: &[Output], to: u32) -> usize {
    let given = |(robot, message): &(u32, &Message)| *robot == to && matches!(message, Message::Give(_));
    told(out).iter().filter(|told| given(told)).count()
}

/// One that has something to give, and two neighbours.
fn busy() -> Rounds {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Neighbours(robots([2, 3])));
    mind.handle(ms(0), votes(1, 1, vote(1, 0, LEANING)));
    mind.handle(ms(0), votes(4, 1, vote(1, 1, LEANING)));
    mind
}

#[test]
fn a_neighbour_that_goes_on_asking_is_answered_at_a_bounded_rate_and_the_other_as_ever() {
    let mut mind = busy();
    let out = flood(&mut mind, ms(1), |n| have(2, 10 + n));
    assert!((8..=24).contains(&gives(&out, 2)), "{}", gives(&out, 2));
    assert!(mind.refusals().count(Refusal::HaveTooOften) >= 970);
    assert_eq!(gives(&mind.handle(ms(1001), have(3, 1)), 3), 1);
    assert_eq!(gives(&mind.handle(ms(2000), have(2, 5000)), 2), 1, "when it has calmed down");
}

#[test]
fn names_that_are_made_up_are_answered_no_more_often_than_one() {
    let mut mind = busy();
    let out = flood(&mut mind, ms(1), |n| have(1000 + n, 1));
    let answered: usize = (1000..2000).map(|robot| gives(&out, robot)).sum();
    assert!((8..=24).contains(&answered), "{answered}");
    assert_eq!(gives(&mind.handle(ms(1001), have(3, 1)), 3), 1);
}

#[test]
fn of_a_neighbour_that_gives_decisions_without_end_few_are_looked_into() {
    let mut mind = busy();
    // Each is another one, and none follows from its votes.
    let forged = |n: u32| Decision { confidence: f64::from(n) / 1e4, ..decision(1, Some(2), 3, 2) };
    let given = |n: u32| {
        says(
            2,
            50 + n,
            Message::Give(Give { decision: Some(forged(n)), votes: Vec::new(), holders: Vec::new() }),
        )
    };
    flood(&mut mind, ms(1), given);
    assert!(mind.refusals().count(Refusal::Unfounded) <= 21);
    assert!(mind.refusals().count(Refusal::DecisionTooOften) >= 970);
    assert_eq!(mind.held(), None);
    mind.handle(ms(1001), super::gives(3, decision(1, Some(2), 3, 3)));
    assert_eq!(mind.held().unwrap().class, Some(ClassId(2)), "the other neighbour is heard");
}

#[test]
fn who_floods_with_announcements_keeps_nobody_from_deciding() {
    let mut mind = busy();
    let forged = |n: u32| Decision { author: RobotId(n), ..decision(1, Some(2), 1 + n % 3, n) };
    flood(&mut mind, ms(1), |n| announced(50 + n, Decision { confidence: 0.5, ..forged(n) }));
    assert!(mind.refusals().count(Refusal::Unfounded) <= 21);
    for robot in [1, 4, 5] {
        mind.handle(ms(1002), votes(robot, 2, vote(1, 0, SURE)));
    }
    let all: Vec<Output> = live(&mut mind, ms(9000)).into_iter().map(|(_, output)| output).collect();
    assert_eq!((mind.held().unwrap().class, announces(&all)), (Some(ClassId(0)), 1));
}
