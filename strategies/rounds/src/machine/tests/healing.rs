//! What becomes of rounds of one count when a cut heals: of one showing, or of two.

use super::*;

/// A vote that the cut held back opens the round again, at who does not know it by that name: both gestures would be final.
#[test]
fn who_held_a_gesture_in_a_round_counts_for_no_other_in_one_of_its_count() {
    for (class, changed) in [(0, false), (1, true)] {
        let mut mind = mind(7);
        mind.handle(ms(0), votes(3, 1, vote(1, 0, SURE)));
        let late = adding_up().deadline + ms(1000);
        live(&mut mind, late);
        assert_eq!(mind.held().and_then(|held| held.class), Some(ClassId(0)));
        let said = mind.handle(late, votes(9, 1, Vote { round: round(1, 9), ..vote(1, class, SURE) }));
        let holdings = said.iter().filter_map(|output| match output {
            Output::Broadcast(Envelope { message: Message::Holding(holding), .. }) => Some(holding),
            _ => None,
        });
        let words: Vec<_> = holdings.map(|holding| (holding.round, holding.class, holding.changed)).collect();
        assert_eq!(words, [(round(1, 9), Some(ClassId(class as u32)), changed)]);
        // In the next one it counts for any.
        mind.handle(late + ms(9000), gives(3, decision(2, Some(2), 3, 3)));
        assert_eq!(mind.held().and_then(|held| held.class), Some(ClassId(2)));
        assert!(!mind.round.as_ref().unwrap().agreement.has_changed(RobotId(7)));
    }
}

/// Who heard of the other name when its round was over, or never, takes it for that of another one, and what is older for nothing.
#[test]
fn a_neighbour_that_holds_another_gesture_is_given_a_decision_under_the_name_that_it_knows() {
    let (another, same) = (decision(1, Some(2), 1, 20), decision(1, Some(0), 1, 20));
    // By no name that is known here it is another round, an older one. Who holds the same gesture comes to call it as all do.
    for (calls, holds, given) in [(5, &another, 5), (1, &another, 1), (0, &another, 1), (5, &same, 1)] {
        let rank = gestalt_protocol::Rank { confidence: 0.1, ..holds.rank() };
        let have = Have { answer: true, ..having(round(1, calls), rank) };
        let mut mind = mind(7);
        mind.handle(ms(0), votes(3, 1, vote(1, 0, SURE)));
        mind.handle(ms(10), votes(5, 1, Vote { round: round(1, 5), ..vote(1, 0, SURE) }));
        let late = adding_up().deadline + ms(1000);
        live(&mut mind, late);
        let held = mind.held().expect("two are sure").clone();
        mind.handle(late, says_it_holds(20, holds));
        let out = mind.handle(late, says(20, 41, Message::Have(have)));
        let [(_, Message::Give(give))] = &told(&out)[..] else { panic!("{out:?}") };
        assert_eq!(
            give.decision,
            Some(Decision { round: round(1, given), ..held.clone() }),
            "it says {calls}"
        );
    }
}

/// One of them takes two rounds for one, which are two for the others: it holds the greatest decision, and they another.
#[test]
fn what_most_hold_long_after_a_round_stands() {
    let (greater, lesser) = (decision(1, Some(0), 4, 9), decision(1, Some(1), 3, 8));
    let late = adding_up().deadline * 2 + ms(100);
    // Who says what it holds beside this robot of three, when, and whether one of them has left for another round since; and what this robot holds then.
    for (of_the_lesser, early, left, held) in
        [(2, false, false, 1), (1, false, false, 0), (2, true, false, 0), (2, false, true, 0)]
    {
        let mut mind = mind(7);
        mind.handle(ms(0), Input::Alive(Arc::new(robots([7, 8, 9]))));
        mind.handle(ms(0), gives(9, greater.clone()));
        let at = if early { ms(4000) } else { late };
        live(&mut mind, at);
        for robot in [8, 9].into_iter().take(of_the_lesser) {
            mind.handle(at, says_it_holds(robot, &lesser));
        }
        if left {
            let elsewhere = Message::Holding(drawn_late(round(1, 9), Some(0), 3).holding(true));
            mind.handle(at, says(9, 41, elsewhere));
        }
        mind.handle(at, gives(8, lesser.clone()));
        let holds = mind.held().and_then(|held| held.class);
        assert_eq!(holds, Some(ClassId(held)), "{of_the_lesser} {early} {left}");
        let changed = mind.round.as_ref().unwrap().agreement.has_changed(RobotId(7));
        assert_eq!(changed, held == 1, "it counts for what it held first");
        if held == 1 {
            mind.handle(at, gives(9, greater.clone()));
            assert_eq!(mind.held(), Some(&lesser), "whoever still gives the other");
        }
    }
}

/// It says what it has, which is greater: it is given what most hold, and not asked for its own.
#[test]
fn who_holds_another_gesture_than_most_long_after_a_round_is_given_theirs() {
    let (greater, lesser) = (decision(1, Some(0), 4, 9), decision(1, Some(1), 3, 8));
    for (at, given) in [(adding_up().deadline, false), (adding_up().deadline * 2 + ms(100), true)] {
        let mut mind = mind(7);
        mind.handle(ms(0), Input::Alive(Arc::new(robots([7, 8, 9]))));
        mind.handle(ms(0), gives(8, lesser.clone()));
        mind.handle(ms(0), says_it_holds(8, &lesser));
        mind.handle(ms(0), says_it_holds(9, &greater));
        live(&mut mind, at);
        let have = having(greater.round, greater.rank());
        let out = mind.handle(at, says(9, 50, Message::Have(have)));
        let theirs = told(&out).iter().any(|(_, message)| match message {
            Message::Give(give) => give.decision.as_ref() == Some(&lesser),
            _ => false,
        });
        assert_eq!(theirs, given);
    }
}
