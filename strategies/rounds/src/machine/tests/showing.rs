//! What the motion detector and a blind camera say.

use super::*;

#[test]
fn a_gesture_shown_opens_one_round_however_many_robots_saw_it() {
    let mut slow = mind(2);
    // Another saw the hand hold still at 900 ms; this one, of a slow camera, at 1,300.
    slow.handle(ms(900), votes(1, 1, vote(1, 0, SURE)));
    slow.handle(ms(1000), Input::Tick);
    let opened = |out: &[Output]| out.iter().any(|output| matches!(output, Output::Opened(_)));
    assert!(!opened(&slow.handle(ms(1300), Input::Shown(ms(500)))), "that gesture has its round");
    for at in (1400..9000).step_by(100) {
        assert!(!opened(&slow.handle(ms(at), Input::Tick)), "{at}");
    }
    slow.handle(ms(9000), Input::Left);
    assert!(opened(&slow.handle(ms(10_000), Input::Shown(ms(9100)))), "this is the next");
}

#[test]
fn a_gesture_shown_while_the_last_is_undecided_has_its_round_afterwards() {
    let mut robot = mind(1);
    robot.handle(ms(0), Input::Open);
    robot.handle(ms(3000), Input::Shown(ms(2000)));
    let opened: Vec<u64> = (3100..7000)
        .step_by(100)
        .filter(|at| robot.handle(ms(*at), Input::Tick).contains(&Output::Opened(round(2, 1))))
        .collect();
    assert_eq!(opened, [5200], "after the deadline, and the time decisions have to meet");
    // One that is gone by then has none.
    let mut robot = mind(1);
    robot.handle(ms(0), Input::Open);
    robot.handle(ms(3000), Input::Shown(ms(2000)));
    robot.handle(ms(4000), Input::Left);
    for at in (4000..9000).step_by(100) {
        assert!(!robot.handle(ms(at), Input::Tick).contains(&Output::Opened(round(2, 1))));
    }
}

#[test]
fn a_round_ends_early_when_the_hand_has_left() {
    let mut mind = mind(1);
    mind.handle(ms(0), Input::Shown(ms(0)));
    mind.handle(ms(1500), Input::Left);
    assert!(holds(&mind.handle(ms(2400), Input::Tick)).is_empty(), "votes may still be on their way");
    assert_eq!(holds(&mind.handle(ms(2500), Input::Tick)), [None], "and not only at the deadline");
}

#[test]
fn nobody_waits_for_a_robot_that_says_it_is_blind() {
    let mut blinded = mind(2);
    let said = blinded.handle(ms(10), votes(1, 1, vote(1, 0, SURE)));
    let [theirs] = broadcast(&said)[..] else { panic!("{said:?}") };
    let mut other = mind(7);
    other.handle(ms(0), Input::Alive(Arc::new(robots([1, 2]))));
    other.handle(ms(10), votes(1, 1, vote(1, 0, SURE)));
    assert_eq!(other.held(), None);
    assert_eq!(holds(&other.handle(ms(20), votes(2, 1, theirs.clone()))), [Some(0)]);
    // It sees again: in the same round it is a voter like any other.
    let mut out = blinded.handle(ms(20), Input::Blind(false));
    out.extend(blinded.handle(ms(400), saw([0.2, 0.7, 0.1])));
    assert!(broadcast(&out).iter().any(|vote| vote.vocabulary == vocabulary().id()), "{out:?}");
}

#[test]
fn a_robot_that_may_still_see_waits_for_itself_as_the_others_do_for_it() {
    let mut slow = mind(7);
    slow.handle(ms(0), Input::Blind(false));
    slow.handle(ms(0), Input::Alive(Arc::new(robots([1]))));
    slow.handle(ms(10), votes(1, 1, vote(1, 0, SURE)));
    slow.handle(ms(300), Input::Tick);
    assert_eq!(slow.held(), None, "its own frame is due");
    assert_eq!(holds(&slow.handle(ms(450), saw([0.9, 0.05, 0.05]))), [Some(0)]);
}
