//! Everything received repeats harmlessly and commutes.

use proptest::prelude::*;

use super::*;

/// What robot n makes of votes of robots 20 to 20 + n.
fn concluded(counter: u32, n: u32) -> Decision {
    let class = n % 3;
    let counted = |robot| CountedVote {
        robot: RobotId(20 + robot),
        stamp: Stamp { boot: 1, sequence: 10 * counter + n },
        class: ClassId(class),
        weight: 1.0,
        vote: vote(counter, class as usize, SURE),
        signature: None,
    };
    decided(round(counter, 1), Some(class), (0..n).map(counted).collect(), n)
}

/// Things robots may say about rounds 1 to 3: what has one author and stamp is one message.
fn heard() -> impl Strategy<Value = Input> {
    prop_oneof![
        (1..6u32, 1..4u32, 1..4u32).prop_map(|(author, counter, n)| {
            let sequence = 10 * counter + n;
            let said = vote(counter, (sequence + author) as usize % 3, n as f32);
            votes(author, sequence, Vote { round: round(counter, author), ..said })
        }),
        (1..6u32, 1..4u32, 1..5u32).prop_map(|(robot, counter, n)| gives(robot, concluded(counter, n))),
        (1..6u32, 1..4u32, 1..5u32).prop_map(|(robot, counter, n)| {
            says(robot, 70 + n, Message::Holding(concluded(counter, n).holding(false)))
        }),
        (1..6u32, 1..4u32, 1..5u32).prop_map(|(from, counter, n)| {
            let held = HeldVote {
                robot: RobotId(n),
                stamp: Stamp { boot: 1, sequence: 10 * counter + 2 },
                vote: vote(counter, (10 * counter + 2 + n) as usize % 3, 2.0),
                signature: None,
            };
            says(from, 90, Message::Give(Give { decision: None, votes: vec![held], holders: vec![] }))
        }),
    ]
}

/// The ballot and the decision that a mind ends with which only listens: it waits for a robot that says nothing, and no time passes.
fn outcome(heard: &[Input]) -> (Option<RoundId>, BTreeMap<RobotId, Stamp>, Option<Decision>) {
    let quorum = Quorum::Evidence(1);
    let mut mind = mind_with(100, RoundsConfig { quorum, refractory: ms(0), ..adding_up() });
    // Of a robot that nobody saw arrive only the newest vote waits until it was, so that whose it is matters.
    mind.handle(ms(1), Input::Alive(Arc::new(robots((1..6).chain([99])))));
    for input in heard {
        mind.handle(ms(1), input.clone());
    }
    let mut ballot: BTreeMap<_, _> = mind.ballot().map(|b| b.stamps().collect()).unwrap_or_default();
    ballot.remove(&RobotId(100));
    (mind.round(), ballot, mind.held().cloned())
}

proptest! {
    #[test]
    fn any_order_and_any_repetition_give_the_same_ballot_and_decision(
        (heard, shuffled) in prop::collection::vec(heard(), 1..25).prop_flat_map(|heard| {
            let twice: Vec<_> = heard.iter().chain(&heard).cloned().collect();
            (Just(heard), Just(twice).prop_shuffle())
        })
    ) {
        prop_assert_eq!(outcome(&heard), outcome(&shuffled));
    }

    #[test]
    fn nothing_heard_makes_a_mind_spin_or_panic(
        heard in prop::collection::vec((heard(), 0..3000u64), 1..40)
    ) {
        let mut mind = mind(3);
        mind.handle(ms(0), Input::Neighbours(robots([1, 2, 4])));
        let mut now = ms(0);
        for (input, pause) in heard {
            now += ms(pause);
            live(&mut mind, now);
            mind.handle(now, input);
        }
        live(&mut mind, now + ms(20_000));
    }
}
