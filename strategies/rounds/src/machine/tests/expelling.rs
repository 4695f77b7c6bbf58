//! Robots that belong to the swarm no more.

use super::*;

fn counted(decision: &Decision) -> Vec<u32> {
    decision.certificate.votes.iter().map(|counted| counted.robot.0).collect()
}

#[test]
fn who_is_expelled_is_taken_out_of_what_is_still_to_be_decided() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Alive(Arc::new(robots([1, 2, 3]))));
    mind.handle(ms(1), votes(3, 1, vote(1, 1, SURE)));
    mind.handle(ms(2), votes(1, 1, vote(1, 0, LEANING)));
    assert_eq!(mind.held(), None, "robot 2 may be about to see");
    mind.handle(ms(3), Input::Expelled(robots([3])));
    mind.handle(ms(4), votes(2, 1, vote(1, 0, SURE)));
    let held = mind.held().expect("nobody else is waited for");
    assert_eq!((held.class, counted(held)), (Some(ClassId(0)), vec![1, 2]));
}

#[test]
fn a_decision_that_counted_one_who_is_expelled_is_drawn_anew() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Alive(Arc::new(robots([1, 3]))));
    mind.handle(ms(1), votes(1, 1, vote(1, 0, LEANING)));
    mind.handle(ms(2), votes(3, 1, vote(1, 1, SURE)));
    assert_eq!(mind.held().map(counted), Some(vec![1, 3]));
    mind.handle(ms(3), Input::Expelled(robots([3])));
    assert!(mind.held().is_none_or(|held| !counted(held).contains(&3)), "{:?}", mind.held());
    live(&mut mind, ms(6000));
    let held = mind.held().expect("the round ends");
    assert!(!counted(held).contains(&3) && held.class != Some(ClassId(1)), "{held:?}");
}

#[test]
fn a_decision_of_a_round_that_is_over_stands() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Alive(Arc::new(robots([3]))));
    mind.handle(ms(1), votes(3, 1, vote(1, 1, SURE)));
    live(&mut mind, ms(3000));
    let before = mind.held().cloned();
    assert!(before.is_some());
    mind.handle(ms(3001), Input::Expelled(robots([3])));
    assert_eq!(mind.held().cloned(), before);
}

#[test]
fn nobody_waits_for_who_is_expelled() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Alive(Arc::new(robots([1, 3]))));
    mind.handle(ms(1), votes(1, 1, vote(1, 0, SURE)));
    assert_eq!(mind.held(), None, "robot 3 may be about to see");
    mind.handle(ms(2), Input::Expelled(robots([3])));
    assert_eq!(mind.held().and_then(|held| held.class), Some(ClassId(0)));
}

#[test]
fn what_one_who_is_expelled_said_of_the_next_round_is_not_heard_when_its_time_comes() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Alive(Arc::new(robots([1, 2, 3]))));
    // A neighbour stays one until its link has ended.
    mind.handle(ms(0), Input::Neighbours(robots([3])));
    mind.handle(ms(1), votes(1, 1, vote(1, 0, SURE)));
    mind.handle(ms(2), votes(2, 1, vote(1, 0, SURE)));
    mind.handle(ms(3), votes(3, 1, Vote { round: round(2, 3), ..vote(2, 1, SURE) }));
    assert_eq!((mind.round(), mind.waiting.len()), (Some(round(1, 1)), 1));
    mind.handle(ms(4), Input::Expelled(robots([3])));
    live(&mut mind, ms(3000));
    assert_eq!(mind.round(), Some(round(1, 1)));
}

/// Where only some of the swarm vote, who is there no more counts for a while yet.
#[test]
fn who_is_expelled_from_a_large_swarm_counts_no_more_whichever_is_heard_first() {
    for expelled_first in [true, false] {
        let mut mind = mind(7);
        mind.handle(ms(0), Input::Alive(Arc::new(robots(1..=1000))));
        mind.handle(ms(1), votes(3, 1, null(1)));
        let mut inputs =
            [Input::Expelled(robots(501..=1000)), Input::Alive(Arc::new(robots(1..=500)))].to_vec();
        if !expelled_first {
            inputs.reverse();
        }
        inputs.into_iter().for_each(|input| _ = mind.handle(ms(2), input));
        assert_eq!(mind.electorate.count(), 500, "{expelled_first}");
        let committee = mind.committee.as_ref().expect("some of them vote");
        assert!(committee.members.iter().all(|robot| robot.0 <= 500), "{expelled_first}");
    }
}
