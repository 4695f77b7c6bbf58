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
        mind.handle(ms(0), Input::Alive(Arc::new(robots([1, 2]))));
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
fn who_was_silent_counts_until_the_next_round_and_who_was_cut_off_meanwhile_counts_on() {
    let is_final = |mind: &mut Rounds| mind.held_aloud().unwrap().decision.is_final;
    // What shows a lease later, if the others were cut off: their links had gone.
    for (left, expected) in [(vec![1], 5), (vec![1, 2, 3, 4], 3)] {
        let mut mind = mind(7);
        mind.electorate.require_keys();
        mind.handle(ms(0), Input::Alive(Arc::new(robots([1, 2, 3, 4]))));
        mind.handle(ms(0), votes(1, 1, vote(1, 0, SURE)));
        mind.handle(ms(10), votes(2, 1, vote(1, 0, SURE)));
        mind.handle(ms(20), saw([0.98, 0.01, 0.01]));
        live(&mut mind, ms(1300));
        let held = mind.held().unwrap().clone();
        assert_eq!((held.class, held.certificate.robots), (Some(ClassId(0)), 5));
        mind.handle(ms(1300), says_it_holds(1, &held));
        assert!(!is_final(&mut mind), "two of five");
        mind.handle(ms(1600), Input::Alive(Arc::new(robots(left))));
        mind.handle(ms(20_000), votes(1, 2, vote(2, 0, SURE)));
        assert_eq!(mind.electorate.count(), expected);
    }
}

/// All else that they said was lost on its way here.
#[test]
fn whose_votes_come_with_a_decision_are_robots_also_if_they_saw_nothing_or_judge_by_another_list() {
    let other_list = Vote { vocabulary: VocabularyId(99), ..vote(1, 0, SURE) };
    for vote_of_others in [null(1), other_list] {
        let mut mind = mind(7);
        mind.handle(ms(0), Input::Alive(Arc::new(robots((1..=9).filter(|robot| *robot != 7)))));
        mind.handle(ms(0), votes(1, 1, null(1)));
        let stamp = Stamp { boot: 1, sequence: 2 };
        let counted = |robot| CountedVote {
            robot: RobotId(robot),
            stamp,
            class: ClassId(0),
            weight: 1.0,
            vote: vote(1, 0, SURE),
            signature: None,
        };
        let mut decision = decided(round(1, 1), Some(0), (1..=3).map(counted).collect(), 1);
        let others = [4, 5, 6, 8, 9].map(RobotId);
        let other = |robot| HeldVote { robot, stamp, vote: vote_of_others.clone(), signature: None };
        decision.certificate.others = others.map(other).to_vec();
        (decision.certificate.robots, decision.certificate.quorum) = (9, 5);
        mind.handle(ms(1500), gives(1, decision));
        live(&mut mind, ms(9000));
        mind.handle(ms(9000), votes(1, 3, null(2)));
        assert!(mind.silent().is_empty(), "{:?}", mind.silent());
        assert_eq!(mind.electorate.count(), 9);
    }
}

#[test]
fn who_votes_by_another_list_of_gestures_is_no_name_without_a_robot() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Alive(Arc::new(robots([1, 2, 4, 5]))));
    mind.handle(ms(0), votes(1, 1, null(1)));
    for robot in [4, 5] {
        mind.handle(ms(1), votes(robot, 1, Vote { vocabulary: VocabularyId(99), ..vote(1, 0, SURE) }));
    }
    live(&mut mind, ms(9000));
    mind.handle(ms(9000), votes(1, 2, null(2)));
    assert_eq!(mind.silent(), &robots([2]));
}

#[test]
fn fewer_robots_than_the_quorum_decide_nothing() {
    let mut mind = mind_with(7, RoundsConfig { quorum: Quorum::Evidence(2), ..adding_up() });
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
    mind.handle(ms(100), gives(3, decision(1, None, 1, 3)));
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
    let mut other = mind_with(8, adding_up());
    other.handle(ms(0), Input::Open);
    other.handle(ms(5), gives(7, decision(1, Some(2), 1, 7)));
    let out = other.handle(ms(10), votes(1, 1, vote(1, 0, SURE)));
    assert!(holds(&out).is_empty());
    assert_eq!(other.held().unwrap().author, RobotId(7));
}

#[test]
fn a_liars_vote_is_clipped_and_f_liars_cannot_make_a_decision() {
    let config = RoundsConfig { liars: 1, ..adding_up() };
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
fn with_liars_a_decision_heard_needs_more_than_two_votes_for_each_and_their_margin() {
    let config = RoundsConfig { liars: 1, ..adding_up() };
    let mut mind = mind_with(7, config.clone());
    mind.handle(ms(0), gives(66, by(&config, decision(1, Some(2), 2, 66))));
    assert_eq!((mind.held(), mind.refusals().count(Refusal::Unfounded)), (None, 1));
    mind.handle(ms(2), gives(1, by(&config, decision(1, Some(2), 5, 1))));
    assert_eq!(mind.held().unwrap().class, Some(ClassId(2)));
}

#[test]
fn a_part_without_a_majority_decides_nothing_and_says_how_many_it_lacks() {
    let mut mind = mind(1);
    mind.handle(ms(0), Input::Alive(Arc::new(robots(2..=9))));
    for robot in 2..=9 {
        mind.handle(ms(1), votes(robot, 1, vote(1, 0, SURE)));
    }
    assert_eq!(mind.held().map(|held| held.certificate.robots), Some(9));
    live(&mut mind, ms(10_000));
    // Five of them are cut off.
    mind.handle(ms(10_000), Input::Alive(Arc::new(robots(2..=4))));
    for robot in 2..=4 {
        mind.handle(ms(10_001), votes(robot, 2, vote(2, 0, SURE)));
    }
    live(&mut mind, ms(20_000));
    let held = mind.held().unwrap();
    assert_eq!((held.round.counter, held.class), (2, None));
    let certificate = &held.certificate;
    assert_eq!((certificate.robots, certificate.quorum, certificate.reached()), (9, 5, 4));
    // When they have been gone for long, those left are the swarm.
    for robot in 2..=4 {
        mind.handle(ms(140_000), votes(robot, 3, vote(3, 0, SURE)));
    }
    assert_eq!(mind.held().unwrap().class, Some(ClassId(0)));
}

#[test]
fn robots_that_see_nothing_count_for_the_majority() {
    let mut mind = mind(1);
    mind.handle(ms(0), Input::Alive(Arc::new(robots(2..=9))));
    mind.handle(ms(1), votes(2, 1, vote(1, 0, SURE)));
    for robot in 3..=4 {
        mind.handle(ms(2), votes(robot, 1, null(1)));
    }
    mind.handle(ms(1100), Input::Tick);
    assert_eq!(mind.held(), None, "four of nine");
    mind.handle(ms(1200), votes(5, 1, null(1)));
    let held = mind.held().unwrap();
    assert_eq!(
        (held.class, held.certificate.votes.len(), held.certificate.reached()),
        (Some(ClassId(0)), 1, 5)
    );
}

#[test]
fn names_without_robots_delay_one_round_and_no_other() {
    let mut mind = mind(1);
    mind.handle(ms(0), Input::Alive(Arc::new(robots([2].into_iter().chain(100..140)))));
    mind.handle(ms(1), votes(2, 1, vote(1, 0, SURE)));
    live(&mut mind, ms(9000));
    assert_eq!(mind.held().unwrap().class, None);
    mind.handle(ms(9000), votes(2, 2, vote(2, 0, SURE)));
    assert_eq!(mind.held().unwrap().class, Some(ClassId(0)), "at once");
}

#[test]
fn who_adopted_a_decision_goes_on_to_conclude_from_more_evidence() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Open);
    mind.handle(ms(5), gives(5, decision(1, Some(2), 1, 5)));
    assert_eq!(mind.held().unwrap().author, RobotId(5));
    for robot in 1..=3 {
        mind.handle(ms(10), votes(robot, 1, vote(1, 0, SURE)));
    }
    let held = mind.held().unwrap();
    assert_eq!((held.author, held.class, held.certificate.votes.len()), (RobotId(7), Some(ClassId(0)), 3));
}

#[test]
fn a_robot_without_a_classifier_fuses_what_the_others_saw() {
    let mut mind = blind(7);
    mind.handle(ms(0), votes(1, 1, vote(1, 1, SURE)));
    assert_eq!(mind.held().unwrap().class, Some(ClassId(1)));
    assert_eq!(mind.held().unwrap().certificate.vocabulary, vocabulary().id());
}

#[test]
fn liars_tip_no_balance_that_honest_votes_leave() {
    let config = RoundsConfig { liars: 1, ..adding_up() };
    let mut mind = mind_with(7, config);
    mind.handle(ms(0), votes(66, 1, vote(1, 2, 6.0)));
    // The two others together favour class 2 by a hair: with the liar, by more than one robot could make up for.
    let nearly = |class, strength| Vote { evidence: evidence(class, strength), ..vote(1, 0, 0.0) };
    mind.handle(ms(1), votes(1, 1, nearly(0, 4.0)));
    mind.handle(ms(2), votes(2, 1, nearly(2, 4.1)));
    live(&mut mind, ms(4000));
    assert_eq!(mind.held(), None);
    mind.handle(ms(4100), votes(2, 2, nearly(0, 4.0)));
    assert_eq!(
        mind.held().map(|held| held.class),
        None,
        "without one of them the other stands against the liar"
    );
    for robot in 3..=5 {
        mind.handle(ms(4200), votes(robot, 1, nearly(0, 4.0)));
    }
    assert_eq!(mind.held().unwrap().class, Some(ClassId(0)));
}

#[test]
fn where_liars_are_expected_a_decision_that_leaves_out_what_is_known_is_not_believed() {
    let config = RoundsConfig { liars: 1, ..adding_up() };
    let mut mind = mind_with(7, config.clone());
    for robot in 1..=9 {
        mind.handle(ms(0), votes(robot, 1, vote(1, 0, SURE)));
    }
    let mut early = mind_with(7, config.clone());
    let forged = || gives(66, by(&config, decision(1, Some(2), 8, 66)));
    mind.handle(ms(1), forged());
    assert_ne!(mind.held().and_then(|held| held.class), Some(ClassId(2)));
    // Before all have spoken, too.
    early.handle(ms(0), Input::Alive(Arc::new(robots([1, 2]))));
    early.handle(ms(0), votes(1, 1, null(1)));
    early.handle(ms(1), forged());
    assert_eq!(
        (early.held(), early.ballot().map(|ballot| ballot.len())),
        (None, Some(10)),
        "its votes are heard"
    );
    live(&mut early, ms(1500));
    assert_eq!(early.held().map(|held| (held.class, held.author)), Some((Some(ClassId(2)), RobotId(7))));
}

/// The honest who voted first lean where the liar wants them, by chance; the one that the liar left out tells them otherwise.
#[test]
fn where_liars_are_expected_no_decision_is_believed_whose_gesture_leads_by_them_alone() {
    let config = RoundsConfig { liars: 1, quorum: Quorum::Evidence(3), ..adding_up() };
    let mut mind = mind_with(7, config.clone());
    mind.handle(ms(0), Input::Alive(Arc::new(robots([1, 3, 4, 66]))));
    let first = [(1, vote(1, 2, 3.0)), (3, vote(1, 2, LEANING)), (66, vote(1, 2, SURE))];
    let counted = |(robot, vote): &(u32, Vote)| CountedVote {
        robot: RobotId(*robot),
        stamp: Stamp { boot: 1, sequence: 1 },
        class: ClassId(2),
        weight: 1.0,
        vote: vote.clone(),
        signature: None,
    };
    let chosen = decided(round(1, 1), Some(2), first.iter().map(counted).collect(), 66);
    for (robot, vote) in first.into_iter().chain([(4, vote(1, 0, 5.5))]) {
        mind.handle(ms(0), votes(robot, 1, vote));
    }
    // Nobody is waited for any more.
    live(&mut mind, ms(1500));
    let scale = crate::ballot::Scale { vocabulary: vocabulary().id(), classes: 3 };
    let of_all = mind.ballot().unwrap().fuse(&config.rule, config.clip, scale).unwrap();
    assert_eq!((of_all.top, mind.held()), (ClassId(2), None), "it leads, and does not convince");
    mind.handle(ms(1500), gives(66, by(&config, chosen.clone())));
    assert_eq!(mind.held(), None);
    // Nor is it told to those who act on it.
    mind.handle(ms(1500), announced(66, by(&config, Decision { is_final: true, ..chosen })));
    assert_eq!((mind.held(), mind.announcement_stands()), (None, false));
    assert!(mind.refusals().iter().all(|(_, count)| count == 0), "it follows from its votes");
}

fn evidence(class: usize, strength: f32) -> Vec<f32> {
    (0..3).map(|k| if k == class { strength } else { -strength / 2.0 }).collect()
}
