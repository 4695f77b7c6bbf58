//! What a robot that has lived before, and knows it, counts for.

use gestalt_protocol::Holder;

use super::*;

/// It may have been for another gesture of the round, and have forgotten it; nobody that it hears knows.
#[test]
fn who_lived_before_counts_for_no_gesture_of_a_round_that_may_have_begun_before_it_did() {
    let deadline = adding_up().deadline;
    let is_final = |afresh: bool, start: Duration, opens: bool, merges: bool| {
        let mind = mind(7);
        let mut mind = if afresh { mind.started_again() } else { mind };
        mind.handle(ms(0), Input::Alive(Arc::new(robots([3, 7]))));
        if opens {
            mind.handle(start, Input::Open);
        }
        let id = mind.round().filter(|_| !merges).unwrap_or(round(1, 3));
        mind.handle(start, votes(3, 1, Vote { round: id, ..vote(1, 0, SURE) }));
        live(&mut mind, start + ms(1500));
        let held = mind.held().expect("it suffices").clone();
        assert_eq!(held.class, Some(ClassId(0)));
        mind.handle(start + ms(1500), says_it_holds(3, &held));
        mind.held_aloud().expect("it holds it").decision.is_final
    };
    for (afresh, start, opens, merges, expected) in [
        (true, ms(10), false, false, false),
        (false, ms(10), false, false, true),
        (true, ms(10), true, false, true),
        (true, ms(10), true, true, false),
        (true, deadline + ms(10), false, false, true),
        (true, deadline + ms(10), true, true, true),
    ] {
        let case = format!("{afresh} {start:?} {opens} {merges}");
        assert_eq!(is_final(afresh, start, opens, merges), expected, "{case}");
    }
    // It was over when it heard of it, or it opened another meanwhile.
    for opens in [false, true] {
        let mut mind = mind(7).started_again();
        mind.handle(ms(0), Input::Alive(Arc::new(robots([3, 7]))));
        if opens {
            mind.handle(ms(0), Input::Open);
        }
        let late = deadline + ms(100);
        let theirs = decision(9, Some(0), 3, 3);
        mind.handle(late, gives(3, theirs.clone()));
        mind.handle(late, says_it_holds(3, &theirs));
        assert!(!mind.held_aloud().expect("it holds it").decision.is_final, "{opens}");
    }
}

#[test]
fn who_started_again_in_the_midst_of_a_round_takes_what_was_decided_in_it_under_another_name() {
    for afresh in [true, false] {
        let mind = mind(7);
        let mut mind = if afresh { mind.started_again() } else { mind };
        mind.handle(ms(0), votes(9, 1, Vote { round: round(1, 9), ..vote(1, 1, SURE) }));
        mind.handle(ms(10), gives(9, Decision { round: round(1, 9), ..decision(1, Some(1), 1, 9) }));
        // It was opened three seconds before this robot heard of it.
        let theirs = decision(1, Some(0), 3, 3);
        let certificate = gestalt_protocol::Certificate { elapsed_ms: 3000, ..theirs.certificate };
        mind.handle(ms(20), gives(3, Decision { certificate, ..theirs }));
        let held = mind.held().and_then(|held| held.class);
        assert_eq!(held, Some(ClassId(if afresh { 0 } else { 1 })), "{afresh}");
    }
}

/// Others keep what it said last, and count it for that until it says otherwise.
#[test]
fn who_learns_that_it_was_in_a_round_before_says_so_of_what_it_holds_already() {
    for given in ["held", "voted", "counted"] {
        let mut mind = mind(7);
        mind.handle(ms(0), votes(3, 1, vote(1, 0, SURE)));
        live(&mut mind, ms(3000));
        let held = mind.held().expect("it suffices").clone();
        let (robot, stamp) = (RobotId(7), Stamp { boot: 0, sequence: 9 });
        let give = match given {
            "held" => {
                let before = Holder { robot, stamp, holding: held.holding(false), signature: None };
                Give { decision: None, votes: vec![], holders: vec![before] }
            }
            "voted" => {
                let before = HeldVote { robot, stamp, vote: vote(1, 1, SURE), signature: None };
                Give { decision: None, votes: vec![before], holders: vec![] }
            }
            // Of a neighbour that holds a decision no votes come beside it.
            _ => {
                let mut theirs = decision(1, Some(1), 3, 3);
                theirs.certificate.votes[0] =
                    CountedVote { robot, stamp, ..theirs.certificate.votes[0].clone() };
                Give { decision: Some(theirs), votes: vec![], holders: vec![] }
            }
        };
        let out = mind.handle(ms(3000), says(3, 9, Message::Give(give)));
        let says = |holding: &gestalt_protocol::Holding| {
            out.iter().any(|output| match output {
                Output::Broadcast(Envelope { message: Message::Holding(said), .. }) => said == holding,
                _ => false,
            })
        };
        assert!(says(&held.holding(true)), "{given}: {out:?}");
    }
}
