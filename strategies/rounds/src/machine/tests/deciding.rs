//! When the votes suffice, and when they do not.

use super::*;

#[test]
fn one_sure_robot_decides_alone_and_says_what_the_decision_rests_on() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Open);
    mind.handle(ms(10), saw([0.01, 0.98, 0.01]));
    let all = live(&mut mind, ms(2000));
    let Some((at, Output::Hold(held))) = all.iter().find(|(_, o)| matches!(o, Output::Hold(_))) else {
        panic!("{all:?}")
    };
    assert_eq!((*at, held.class, held.author), (ms(250), Some(ClassId(1)), RobotId(7)));
    assert_eq!(held.certificate.elapsed_ms, 250);
    let counted = &held.certificate.votes;
    assert_eq!((counted.len(), counted[0].robot, counted[0].class), (1, RobotId(7), ClassId(1)));
    assert_eq!(held.confidence, held.certificate.probabilities[1]);
    assert!(all.contains(&(ms(450), Output::Closed(round(1, 7)))), "closed once settled");
}

#[test]
fn a_round_waits_until_every_live_robot_has_seen_something_but_not_beyond_patience() {
    let open = || {
        let mut mind = mind(7);
        mind.handle(ms(0), Input::Alive(robots([1, 2])));
        mind.handle(ms(0), votes(1, 1, vote(1, 0, SURE)));
        mind
    };
    let mut all_see = open();
    all_see.handle(ms(20), votes(2, 1, null(1)));
    assert_eq!(all_see.held(), None, "robot 2 may be about to see");
    let decided = all_see.handle(ms(30), votes(2, 2, vote(1, 0, SURE)));
    assert!(decided.iter().any(|o| matches!(o, Output::Hold(_))));
    let late = live(&mut open(), ms(3000));
    assert!(late.iter().any(|(at, o)| *at == ms(1000) && matches!(o, Output::Hold(_))));
}

#[test]
fn fewer_robots_than_the_quorum_decide_nothing() {
    let mut mind = mind_with(7, RoundsConfig { quorum: 2, ..RoundsConfig::default() });
    mind.handle(ms(0), votes(1, 1, vote(1, 0, SURE)));
    mind.handle(ms(1), votes(2, 1, null(1)));
    assert_eq!(mind.held(), None);
    mind.handle(ms(2), votes(3, 1, vote(1, 0, SURE)));
    assert_eq!(mind.held().unwrap().class, Some(ClassId(0)));
}

#[test]
fn at_the_deadline_the_outcome_is_no_decision_said_as_such() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Open);
    mind.handle(ms(1), votes(1, 1, vote(1, 0, 0.1)));
    mind.handle(ms(2), votes(2, 1, vote(1, 1, 0.1)));
    let all = live(&mut mind, ms(6000));
    let held: Vec<_> = all.iter().filter(|(_, o)| matches!(o, Output::Hold(_))).collect();
    assert_eq!(held.len(), 1);
    assert_eq!(held[0].0, ms(5000));
    assert_eq!(mind.held().unwrap().class, None);
    assert_eq!(mind.held().unwrap().certificate.votes.len(), 2);
    assert!(!mind.is_open());
}

#[test]
fn the_no_decision_of_an_impatient_robot_ends_nothing_for_the_others() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Open);
    mind.handle(ms(100), Input::Heard(RobotId(3), decision(1, None, 1, 3)));
    assert_eq!(mind.held(), None);
    mind.handle(ms(200), votes(1, 1, vote(1, 0, SURE)));
    assert_eq!(mind.held().unwrap().class, Some(ClassId(0)));
}

#[test]
fn a_robot_draws_one_conclusion_per_round_and_none_after_adopting_one() {
    let mut mind = mind(7);
    mind.handle(ms(0), votes(1, 1, vote(1, 0, SURE)));
    assert_eq!(mind.held().unwrap().author, RobotId(7));
    mind.handle(ms(10), votes(2, 1, vote(1, 1, SURE)));
    let out = mind.handle(ms(20), votes(3, 1, vote(1, 1, SURE)));
    assert!(holds(&out).is_empty());
    let mut other = mind_with(8, RoundsConfig::default());
    other.handle(ms(0), Input::Open);
    other.handle(ms(5), Input::Heard(RobotId(7), decision(1, Some(2), 1, 7)));
    let out = other.handle(ms(10), votes(1, 1, vote(1, 0, SURE)));
    assert!(holds(&out).is_empty());
    assert_eq!(other.held().unwrap().author, RobotId(7));
}

#[test]
fn a_liars_vote_is_clipped_and_f_liars_cannot_make_a_decision() {
    let config = RoundsConfig { liars: 1, ..RoundsConfig::default() };
    let mut mind = mind_with(7, config);
    mind.handle(ms(0), votes(66, 1, vote(1, 2, 1e30)));
    mind.handle(ms(1), votes(1, 1, vote(1, 0, LEANING)));
    assert_eq!(mind.held(), None, "one robot made this lead alone");
    for robot in 2..=6 {
        mind.handle(ms(10), votes(robot, 1, vote(1, 0, SURE)));
    }
    assert_eq!(mind.held().unwrap().class, Some(ClassId(0)));
}

#[test]
fn with_liars_a_heard_decision_needs_f_plus_1_holders() {
    let mut mind = mind_with(7, RoundsConfig { liars: 1, ..RoundsConfig::default() });
    mind.handle(ms(0), Input::Heard(RobotId(66), decision(1, Some(2), 9, 66)));
    mind.handle(ms(1), Input::Heard(RobotId(66), decision(1, Some(2), 9, 66)));
    mind.handle(ms(1), Input::Announced(decision(1, Some(2), 9, 66)));
    assert_eq!(mind.held(), None);
    assert!(mind.is_open(), "it takes part, to find out for itself");
    mind.handle(ms(2), Input::Heard(RobotId(1), decision(1, Some(2), 5, 1)));
    assert_eq!(mind.held().unwrap().class, Some(ClassId(2)));
}

#[test]
fn a_robot_without_a_classifier_fuses_what_the_others_saw() {
    let mut mind = blind(7);
    mind.handle(ms(0), votes(1, 1, vote(1, 1, SURE)));
    assert_eq!(mind.held().unwrap().class, Some(ClassId(1)));
    assert_eq!(mind.held().unwrap().certificate.vocabulary, vocabulary().id());
}
