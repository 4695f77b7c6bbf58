//! What neighbours tell and give each other.

use super::*;

fn have(counter: u32, known: &[(u32, u32)]) -> Have {
    let stamp = |sequence| Stamp { boot: 1, sequence };
    Have {
        round: Some(round(counter, 1)),
        decision: None,
        holders: 0,
        votes: known.iter().map(|&(robot, sequence)| (RobotId(robot), stamp(sequence))).collect(),
        knowledge: None,
        answer: false,
    }
}

#[test]
fn a_new_neighbour_is_greeted_at_once_and_the_neighbours_in_turn_from_then_on() {
    let mut mind = mind(7);
    let out = mind.handle(ms(0), Input::Neighbours(robots([3, 4, 7])));
    assert_eq!(told(&out).iter().map(|(robot, _)| *robot).collect::<Vec<_>>(), [3, 4]);
    let all = live(&mut mind, ms(13_000));
    let turns: Vec<_> = all
        .iter()
        .filter_map(|(at, o)| match o {
            Output::Tell(robot, _) => Some((at.as_millis(), robot.0)),
            _ => None,
        })
        .collect();
    assert_eq!(turns[..3], [(500, 3), (1000, 4), (1500, 3)], "busy after the change");
    assert_eq!(turns[turns.len() - 2..], [(9000, 3), (13_000, 4)], "then idle");
}

#[test]
fn a_neighbour_is_given_the_votes_it_lacks_and_asked_for_those_lacking_here() {
    let mut mind = mind_with(7, RoundsConfig { quorum: Quorum::Evidence(9), ..adding_up() });
    mind.handle(ms(0), votes(1, 5, vote(1, 0, LEANING)));
    mind.handle(ms(0), votes(2, 5, vote(1, 0, LEANING)));
    let out = mind.handle(ms(10), says(3, 1, Message::Have(have(1, &[(1, 4), (2, 6), (7, 1)]))));
    let [(3, Message::Give(give)), (3, Message::Have(asked))] = &told(&out)[..] else { panic!("{out:?}") };
    assert_eq!(give.votes.iter().map(|held| held.robot.0).collect::<Vec<_>>(), [1]);
    assert!(asked.answer);
    let answer = Have { answer: true, ..have(1, &[(1, 4), (2, 6), (7, 1)]) };
    let out = mind.handle(ms(20), says(3, 2, Message::Have(answer)));
    assert!(matches!(told(&out)[..], [(3, Message::Give(_))]), "an answer is answered with a gift only");
    let out = mind.handle(ms(30), says(3, 3, Message::Have(have(1, &[(1, 5), (2, 5), (7, 1)]))));
    assert!(out.is_empty(), "equals have nothing to say");
}

#[test]
fn what_was_given_and_is_news_goes_on_to_the_other_neighbours_and_nothing_else_does() {
    let mut mind = mind_with(7, RoundsConfig { quorum: Quorum::Evidence(9), ..adding_up() });
    mind.handle(ms(0), Input::Neighbours(robots([3, 4])));
    mind.handle(ms(0), votes(1, 5, vote(1, 0, LEANING)));
    let held = |robot, sequence| HeldVote {
        robot: RobotId(robot),
        stamp: Stamp { boot: 1, sequence },
        vote: vote(1, 0, LEANING),
        signature: None,
    };
    let give = Message::Give(Give { decision: None, votes: vec![held(1, 5), held(2, 2)], holders: vec![] });
    let out = mind.handle(ms(10), says(3, 1, give.clone()));
    let [(4, Message::Give(passed))] = &told(&out)[..] else { panic!("{out:?}") };
    assert_eq!(passed.votes, [held(2, 2)]);
    assert!(mind.handle(ms(20), says(4, 1, give)).is_empty(), "a rumour dies where it is known");
}

#[test]
fn one_who_missed_the_round_is_given_the_decision_and_does_not_announce_it_again() {
    let mut knows = mind(7);
    knows.handle(ms(0), gives(5, decision(3, Some(1), 3, 5)));
    let out = knows.handle(ms(10), says(1, 1, Message::Have(Have { round: None, ..have(1, &[]) })));
    let [(1, Message::Give(give))] = &told(&out)[..] else { panic!("{out:?}") };
    assert_eq!(give.decision.as_ref().unwrap().class, Some(ClassId(1)));
    let mut late = mind(1);
    let out = late.handle(ms(20), says(7, 1, Message::Give(give.clone())));
    assert_eq!(holds(&out), [Some(1)]);
    assert!(!late.is_open());
    assert!(live(&mut late, ms(9000)).iter().all(|(_, o)| !matches!(o, Output::Announce(_))));
}

#[test]
fn an_idle_mind_says_one_small_message_per_idle_period() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Neighbours(robots([3])));
    mind.handle(ms(0), gives(5, decision(3, Some(1), 3, 5)));
    live(&mut mind, ms(10_000));
    let idle = live(&mut mind, ms(70_000));
    assert_eq!(idle.len(), 15);
    for (_, output) in idle {
        let Output::Tell(_, envelope) = output else { panic!("{output:?}") };
        assert!(envelope.encode().len() <= 40, "{} bytes", envelope.encode().len());
    }
}

#[test]
fn a_mind_with_nothing_to_do_wants_no_wake() {
    assert_eq!(mind(7).next_wake(), None);
}

#[test]
fn the_others_are_told_of_a_greater_decision_for_the_same_gesture_and_ask_for_it() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Neighbours(robots([3, 4])));
    mind.handle(
        ms(0),
        says(
            3,
            1,
            Message::Give(Give {
                decision: Some(decision(1, Some(1), 3, 5)),
                votes: vec![],
                holders: vec![],
            }),
        ),
    );
    let greater = decision(1, Some(1), 4, 5);
    let give = |sequence| {
        says(
            3,
            sequence,
            Message::Give(Give { decision: Some(greater.clone()), votes: vec![], holders: vec![] }),
        )
    };
    let out = mind.handle(ms(100), give(2));
    assert_eq!(holds(&out), [Some(1)]);
    let [(4, Message::Have(have))] = &told(&out)[..] else { panic!("{out:?}") };
    assert_eq!((have.decision, have.answer), (Some(greater.rank()), false));
    assert!(told(&mind.handle(ms(110), give(3))).is_empty(), "a rumour dies where it is known");
}

#[test]
fn who_has_just_been_met_is_answered_so_that_each_knows_that_it_is_heard() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Neighbours(robots([3])));
    let nothing = || Message::Have(Have { round: None, ..have(1, &[]) });
    let out = mind.handle(ms(9000), says(3, 1, nothing()));
    let answered =
        told(&out).iter().any(|(_, message)| matches!(message, Message::Have(have) if have.answer));
    assert!(answered, "{out:?}");
    let out = mind.handle(ms(10_001), says(3, 2, nothing()));
    assert!(!told(&out).iter().any(|(_, message)| matches!(message, Message::Have(have) if have.answer)));
}
