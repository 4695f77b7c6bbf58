//! When rounds open, merge and are refused.

use super::*;

#[test]
fn opening_says_a_null_vote_to_all_at_once() {
    let mut mind = mind(7);
    let out = mind.handle(ms(10), Input::Open);
    assert_eq!(out[0], Output::Opened(round(1, 7)));
    let said = broadcast(&out);
    assert_eq!((said.len(), said[0].round, said[0].evidence.len()), (1, round(1, 7), 0));
    assert!(mind.is_open());
}

#[test]
fn a_request_to_open_has_no_effect_while_a_round_is_open_or_has_just_begun() {
    let mut mind = mind_with(7, RoundsConfig { settle: ms(0), ..adding_up() });
    mind.handle(ms(0), Input::Open);
    assert!(mind.handle(ms(5), Input::Open).is_empty());
    mind.handle(ms(10), gives(1, decision(1, Some(0), 2, 1)));
    assert!(!mind.is_open(), "decided and closed");
    mind.handle(ms(499), Input::Open);
    assert_eq!(mind.round(), Some(round(1, 7).min(round(1, 1))));
    mind.handle(ms(500), Input::Open);
    assert_eq!(mind.round(), Some(round(2, 7)));
}

#[test]
fn hearing_a_vote_of_a_newer_round_joins_it_and_ends_the_older() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Open);
    let out = mind.handle(ms(100), votes(3, 1, vote(5, 0, LEANING)));
    assert_eq!(out[..2], [Output::Closed(round(1, 7)), Output::Opened(round(5, 1))]);
    assert_eq!(broadcast(&out)[0].round.counter, 5, "all hear that this robot takes part");
    mind.handle(ms(200), votes(3, 2, vote(4, 0, LEANING)));
    assert_eq!(mind.round(), Some(round(5, 1)), "an older round changes nothing");
}

#[test]
fn equal_counters_merge_on_the_smaller_opener_and_keep_what_was_seen() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Open);
    mind.handle(ms(300), saw([0.5, 0.3, 0.2]));
    let out = mind.handle(ms(310), votes(1, 1, vote(1, 1, LEANING)));
    assert_eq!(mind.round(), Some(round(1, 1)));
    assert!(!out.contains(&Output::Closed(round(1, 7))));
    assert_eq!(mind.ballot().unwrap().contributors(mind.own_scale().unwrap()), 2);
    mind.handle(ms(320), votes(2, 1, Vote { round: round(1, 9), ..vote(1, 1, LEANING) }));
    assert_eq!(mind.round(), Some(round(1, 1)), "a greater opener changes nothing");
}

#[test]
fn a_vote_under_another_name_of_a_round_begins_no_other_however_late() {
    let mut mind = mind(7);
    let deadline = adding_up().deadline;
    let of_nine = |sequence| votes(9, sequence, Vote { round: round(1, 9), ..null(1) });
    mind.handle(ms(0), Input::Open);
    mind.handle(ms(10), of_nine(1));
    live(&mut mind, deadline + ms(500));
    assert!(!mind.is_open(), "undecided, and over");
    for (late, sequence) in [(501, 1), (900, 2), (8000, 3)] {
        mind.handle(deadline + ms(late), of_nine(sequence));
        assert_eq!((mind.round(), mind.is_open()), (Some(round(1, 7)), false), "{late} ms after");
    }
    // One that nobody knows from then is another showing.
    mind.handle(deadline + ms(9000), votes(8, 1, Vote { round: round(1, 8), ..null(1) }));
    assert_eq!((mind.round(), mind.is_open()), (Some(round(1, 8)), true));
}

#[test]
fn a_decision_that_counts_votes_of_a_round_is_of_it_however_late_its_other_name_comes() {
    let mut mind = mind(7);
    let counted = [(1, 1), (2, 1), (9, 9)].map(|(robot, opener)| CountedVote {
        robot: RobotId(robot),
        stamp: Stamp { boot: 1, sequence: 1 },
        class: ClassId(0),
        weight: 1.0,
        vote: Vote { round: round(1, opener), ..vote(1, 0, SURE) },
        signature: None,
    });
    mind.handle(ms(0), votes(9, 1, counted[2].vote.clone()));
    // Robot 1 opened it too, heard robot 9 in time, and was heard here after that.
    let late = adding_up().deadline + ms(2000);
    live(&mut mind, late);
    assert_eq!((mind.round(), mind.is_open()), (Some(round(1, 9)), false));
    mind.handle(late, gives(1, decided(round(1, 1), Some(0), counted[..2].to_vec(), 1)));
    assert_eq!(mind.round(), Some(round(1, 9)), "as far as can be told, that was another showing");
    mind.handle(late + ms(1), gives(1, decided(round(1, 1), Some(0), counted.to_vec(), 1)));
    assert_eq!(mind.round(), Some(round(1, 1)));
    assert_eq!(mind.held().and_then(|held| held.class), Some(ClassId(0)));
    // One name of it is as good as another.
    mind.handle(late + ms(2), votes(9, 2, Vote { round: round(1, 9), ..null(1) }));
    assert_eq!(mind.round(), Some(round(1, 1)));
}

#[test]
fn counters_run_ahead_no_faster_than_gestures_can_be_shown() {
    let mut mind = mind(7).counting_from(Some(1000));
    let ahead = 1000 + (1 << 24);
    mind.handle(ms(0), votes(3, 1, null(ahead + 1)));
    assert_eq!((mind.round(), mind.refusals().count(Refusal::FarAhead)), (None, 1));
    mind.handle(ms(1), votes(3, 2, null(ahead)));
    assert_eq!(mind.round().unwrap().counter, ahead);
    // Whatever is said, and however often.
    for leap in 1..5000 {
        mind.handle(ms(1000 + leap), votes(3, 3, null(u32::try_from(u64::from(ahead) + leap).unwrap())));
    }
    assert!(mind.highest.unwrap() <= ahead + 2 * 6);
    mind.handle(ms(7000), Input::Open);
    assert!(mind.is_open() && mind.refusals().count(Refusal::CountersUsedUp) == 0);
}

#[test]
fn whoever_started_later_goes_beyond_its_bound_with_most_others() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Alive(Arc::new(robots([3, 4]))));
    let ahead = 1 << 24;
    mind.handle(ms(0), votes(3, 1, null(ahead)));
    mind.handle(ms(0), votes(4, 1, null(ahead)));
    assert_eq!(mind.round().unwrap().counter, ahead);
    live(&mut mind, ms(5900));
    let (beyond, before) = (ahead + 2 * 6 + 50, mind.refusals().count(Refusal::FarAhead));
    for (at, robot, taken) in [(6000, 3, ahead), (6001, 3, ahead), (6002, 66, ahead), (6003, 4, beyond)] {
        mind.handle(ms(at), votes(robot, u32::try_from(at).unwrap(), null(beyond)));
        assert_eq!(mind.round().unwrap().counter, taken, "{at}");
    }
    assert_eq!(mind.refusals().count(Refusal::FarAhead), before + 3);
}

#[test]
fn one_robot_takes_nobody_far_ahead_and_two_do() {
    for liars in [0, 1] {
        let mut mind = mind_with(7, RoundsConfig { liars, ..adding_up() });
        mind.handle(ms(0), Input::Alive(Arc::new(robots([3, 4, 5, 66]))));
        for sequence in 1..20 {
            mind.handle(ms(u64::from(sequence)), votes(66, sequence, null(5000 + sequence)));
        }
        for robot in 1000..1100 {
            mind.handle(ms(30), votes(robot, 1, null(5000)));
        }
        assert_eq!((mind.round(), mind.far_ahead.len()), (None, 1), "whoever it makes up");
        assert_eq!(mind.refusals().count(Refusal::FarAhead), 119);
        mind.handle(ms(40), votes(3, 1, null(900)));
        assert_eq!(mind.round().unwrap().counter, 900, "a little way is no leap");
        mind.handle(ms(1000), gives(66, decision(50_000, None, 0, 66)));
        assert_eq!(mind.round().unwrap().counter, 900, "that nothing was decided is nobody's word");
        // Who lost what it knew, among others that did not.
        mind.handle(ms(3000), votes(4, 1, null(50_000)));
        assert_eq!(mind.round().unwrap().counter, 50_000);
    }
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Alive(Arc::new(robots([3]))));
    mind.handle(ms(0), votes(3, 1, null(50_000)));
    assert_eq!(mind.round().unwrap().counter, 50_000, "there is nobody else to go by");
}

#[test]
fn when_the_counters_are_used_up_no_round_opens_and_it_is_counted() {
    let mut mind = mind(7).counting_from(Some(u32::MAX));
    mind.handle(ms(900), Input::Open);
    assert_eq!(mind.refusals().count(Refusal::CountersUsedUp), 1);
}

#[test]
fn a_round_in_which_others_take_part_has_its_time_whatever_is_said_of_newer_ones() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Alive(Arc::new(robots([3, 66, 99]))));
    mind.handle(ms(0), votes(3, 1, vote(1, 0, LEANING)));
    for k in 0..4 {
        mind.handle(ms(100 * u64::from(k) + 100), votes(66, k, null(2 + k)));
    }
    assert_eq!((mind.round().unwrap().counter, mind.refusals().count(Refusal::TooSoon)), (1, 4));
    mind.handle(ms(500), votes(3, 2, null(2)));
    assert_eq!(mind.round().unwrap().counter, 2);
}

#[test]
fn who_begins_one_round_after_the_other_ends_one_within_a_deadline() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Alive(Arc::new(robots([3, 4, 66]))));
    mind.handle(ms(0), votes(3, 1, vote(1, 0, LEANING)));
    let heard = |mind: &mut Rounds, at, author, sequence, vote| {
        mind.handle(ms(at), votes(author, sequence, vote));
        mind.round().unwrap().counter
    };
    assert_eq!(heard(&mut mind, 500, 66, 1, null(2)), 2, "whoever is behind is taken along");
    assert_eq!(heard(&mut mind, 510, 3, 2, vote(2, 0, LEANING)), 2);
    assert_eq!(heard(&mut mind, 1100, 66, 2, null(3)), 2, "but not on and on");
    assert_eq!(mind.refusals().count(Refusal::TooSoon), 1);
    assert_eq!(heard(&mut mind, 1200, 4, 1, null(4)), 4, "another one was not heard yet");
    assert_eq!(heard(&mut mind, 1300, 3, 3, vote(4, 0, LEANING)), 4);
    assert_eq!(heard(&mut mind, 5600, 66, 3, null(5)), 5, "after a deadline it may be behind again");
}

#[test]
fn who_is_left_behind_in_a_round_goes_where_most_have_gone() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Alive(Arc::new(robots([3, 4, 5, 66]))));
    mind.handle(ms(0), votes(3, 1, null(1)));
    let heard = |mind: &mut Rounds, at, author, counter| {
        mind.handle(ms(at), votes(author, counter, null(counter)));
        mind.round().unwrap().counter
    };
    for (at, author, counter) in [(500, 3, 2), (1000, 4, 3), (1500, 66, 4), (2000, 5, 5)] {
        assert_eq!(heard(&mut mind, at, author, counter), counter, "each takes it along once in a while");
    }
    for (at, counter) in [(2500, 6), (2600, 7), (2700, 8)] {
        assert_eq!(heard(&mut mind, at, 66, counter), 5, "one is not the swarm, whatever it says");
    }
    assert_eq!(heard(&mut mind, 2800, 3, 8), 5, "nor are two");
    assert_eq!(heard(&mut mind, 2900, 4, 8), 8, "three of five are");
    let voters: Vec<u32> = mind.round.as_ref().unwrap().ballot.stamps().map(|(robot, _)| robot.0).collect();
    assert_eq!(voters, [3, 4, 7, 66], "all are heard");
}

#[test]
fn made_up_robots_make_no_majority_and_the_last_of_them_is_heard_when_the_round_is_over() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Alive(Arc::new(robots([3, 4]))));
    mind.handle(ms(0), votes(3, 1, null(1)));
    assert_eq!((mind.round().unwrap().counter, mind.is_open()), (1, true));
    // They share what they may do, and have done it.
    mind.handle(ms(600), votes(900, 1, null(2)));
    for robot in 901..2000 {
        mind.handle(ms(1200), votes(robot, 1, null(3)));
    }
    assert_eq!((mind.round().unwrap().counter, mind.waiting.len()), (2, 1));
    live(&mut mind, ms(6000));
    assert_eq!(mind.round().unwrap().counter, 3);
}

#[test]
fn a_round_whose_votes_suffice_is_decided_before_a_newer_one_ends_it() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Alive(Arc::new(robots([3, 4, 66]))));
    mind.handle(ms(0), votes(3, 1, vote(1, 0, SURE)));
    mind.handle(ms(0), votes(4, 1, vote(1, 0, SURE)));
    assert_eq!(mind.held(), None, "one of them may yet say something");
    assert_eq!(holds(&mind.handle(ms(400), votes(66, 1, null(2)))), [], "it has its time");
    let out = mind.handle(ms(600), votes(66, 2, null(3)));
    assert_eq!((holds(&out), mind.round().unwrap().counter), (vec![Some(0)], 1));
    live(&mut mind, ms(799));
    assert_eq!(mind.round().unwrap().counter, 1, "decisions are left a while to meet");
    let out: Vec<Output> = live(&mut mind, ms(810)).into_iter().map(|(_, output)| output).collect();
    assert_eq!(mind.round().unwrap().counter, 3, "then it takes part in the newer one");
    assert_eq!(broadcast(&out).len(), 1);
}

#[test]
fn a_round_decided_elsewhere_is_adopted_without_opening() {
    let mut mind = mind(7);
    let out = mind.handle(ms(0), gives(3, decision(9, Some(2), 4, 1)));
    assert_eq!(holds(&out), [Some(2)]);
    assert_eq!(mind.held(), Some(&decision(9, Some(2), 4, 1)));
    assert!(!mind.is_open());
    let have = having(round(12, 1), decision(12, Some(1), 2, 1).rank());
    let out = mind.handle(ms(1), says(3, 1, Message::Have(have)));
    assert!(matches!(told(&out)[..], [(3, Message::Have(Have { answer: true, .. }))]), "it asks for it");
    mind.handle(ms(2000), Input::Open);
    assert_eq!(mind.round().unwrap().counter, 10, "what a neighbour says it has is a hint");
}

#[test]
fn equal_counters_of_rounds_opened_at_other_times_are_two_rounds() {
    let mut mind = mind_with(7, RoundsConfig { settle: ms(0), ..adding_up() });
    mind.handle(ms(0), Input::Open);
    mind.handle(ms(10), gives(9, decision(1, Some(0), 2, 9)));
    assert_eq!(mind.round(), Some(round(1, 1)), "heard while it is shown: another name of it");
    // Somebody who was cut off, or lost what it knew, shows another gesture under the same count.
    mind.handle(ms(9000), votes(3, 1, Vote { round: round(1, 0), ..vote(1, 1, LEANING) }));
    assert_eq!(
        (mind.round(), mind.is_open()),
        (Some(round(1, 1)), false),
        "the lesser name is the older for all"
    );
    mind.handle(ms(9100), votes(9, 1, Vote { round: round(1, 9), ..vote(1, 1, LEANING) }));
    assert_eq!((mind.round(), mind.is_open()), (Some(round(1, 9)), true), "the greater one is joined");
    assert!(mind.held().is_none(), "what was decided of the other is not decided of this");
}

/// Whoever may vote opens another one under its count, and then calls that by its name.
#[test]
fn the_name_of_a_round_that_is_over_is_that_of_no_other() {
    let mut mind = mind_with(7, RoundsConfig { settle: ms(0), ..adding_up() });
    mind.handle(ms(0), Input::Open);
    mind.handle(ms(5), votes(5, 1, Vote { round: round(1, 5), ..vote(1, 0, LEANING) }));
    mind.handle(ms(10), gives(9, decision(1, Some(0), 2, 9)));
    assert_eq!((mind.round(), mind.is_open()), (Some(round(1, 1)), false));
    mind.handle(ms(9000), votes(3, 1, Vote { round: round(1, 99), ..null(1) }));
    assert_eq!((mind.round(), mind.is_open()), (Some(round(1, 99)), true));
    for (sequence, over) in [(2, 1), (3, 5), (4, 7)] {
        mind.handle(ms(9100), votes(3, sequence, Vote { round: round(1, over), ..vote(1, 1, SURE) }));
        assert_eq!((mind.round(), mind.held()), (Some(round(1, 99)), None), "that was {over}");
    }
    mind.handle(ms(9200), gives(9, decision(1, Some(0), 2, 9)));
    assert_eq!(
        (mind.round(), mind.held()),
        (Some(round(1, 99)), None),
        "nor is its decision that of this one"
    );
    // Not with a vote of this one beside it, nor under the name of this one.
    let over = decision(1, Some(0), 2, 9);
    let mut certificate = over.certificate.clone();
    let of_this = Vote { round: round(1, 99), ..null(1) };
    let stamp = Stamp { boot: 1, sequence: 9 };
    certificate.others.push(HeldVote { robot: RobotId(3), stamp, vote: of_this, signature: None });
    let undecided = Decision { certificate: certificate.clone(), ..decision(1, None, 0, 9) };
    let undecided = Decision {
        certificate: gestalt_protocol::Certificate { votes: vec![], ..undecided.certificate },
        ..undecided
    };
    let with_it = Decision { certificate, ..over.clone() };
    for also in [with_it, undecided, Decision { round: round(1, 99), ..over }] {
        mind.handle(ms(9250), gives(9, also));
        assert_eq!((mind.round(), mind.held()), (Some(round(1, 99)), None));
    }
    // Votes of one that is over are none of this one, whoever gives them with a decision for nothing.
    let voted = decision(1, Some(0), 4, 9).certificate;
    let nothing = Decision { round: round(1, 99), certificate: voted, ..decision(1, None, 0, 9) };
    mind.handle(ms(9270), gives(9, nothing));
    assert!((10..14).all(|robot| !mind.ballot().unwrap().has_spoken(RobotId(robot))));
    // Of one that nobody here was in it is another name.
    mind.handle(ms(9300), votes(3, 5, Vote { round: round(1, 50), ..vote(1, 1, LEANING) }));
    assert_eq!(mind.round(), Some(round(1, 50)));
}

/// Nor that of one that an instructor spoke of meanwhile, which was shown before.
#[test]
fn nor_is_that_of_one_that_was_spoken_of() {
    let mut mind = mind_with(7, RoundsConfig { settle: ms(0), ..adding_up() });
    mind.handle(ms(100), votes(3, 1, Vote { round: round(1, 99), ..null(1) }));
    let of_this = Vote { round: round(1, 99), ..null(1) };
    let merges = |name: RoundId| {
        let undecided = decision(1, None, 0, 9);
        let stamp = Stamp { boot: 1, sequence: 9 };
        let held = HeldVote { robot: RobotId(3), stamp, vote: of_this.clone(), signature: None };
        let certificate = gestalt_protocol::Certificate { others: vec![held], ..undecided.certificate };
        Decision { round: name, certificate, ..undecided }
    };
    let mut follower = Taught([round(1, 50)].into());
    mind.handle_with(ms(7000), gives(9, merges(round(1, 50))), &mut follower);
    assert_eq!(mind.round(), Some(round(1, 99)));
    mind.handle_with(ms(7100), gives(9, merges(round(1, 60))), &mut follower);
    assert_eq!(mind.round(), Some(round(1, 60)), "as names of one showing do");
}

/// After a restart of all, in which some lost what they knew, counts come again.
#[test]
fn a_round_that_an_instructor_spoke_of_is_over() {
    let mut follower = Taught([round(8, 1)].into());
    let joined = |out: &[Output]| out.iter().any(|out| matches!(out, Output::Opened(_)));
    let mut mind = mind(7);
    let out = mind.handle_with(ms(0), votes(3, 1, null(8)), &mut follower);
    assert_eq!((mind.round(), mind.is_open(), joined(&out)), (Some(round(8, 1)), false, false));
    let mut mind = mind_with(7, adding_up());
    let anew = Vote { round: round(8, 4), ..null(8) };
    let out = mind.handle_with(ms(0), votes(4, 1, anew), &mut follower);
    assert!(mind.is_open() && joined(&out));
    mind.handle_with(ms(10), votes(3, 1, null(8)), &mut follower);
    assert_eq!(mind.round(), Some(round(8, 4)), "what is shown now has a name of its own");
    // What is said of the one that is shown changes nothing of how it goes on.
    follower.0.insert(round(8, 2));
    mind.handle_with(ms(20), votes(2, 1, Vote { round: round(8, 2), ..null(8) }), &mut follower);
    assert_eq!((mind.round(), mind.is_open()), (Some(round(8, 2)), true));
}

/// By a vote under that name robots have no gesture, where others decided one in another round of its count.
#[test]
fn who_came_to_a_round_when_it_was_over_holds_what_was_decided_in_another() {
    let mut mind = mind(7);
    let decided = decision(1, Some(0), 3, 9);
    mind.handle(ms(0), gives(9, decided.clone()));
    let mut follower = Taught([round(1, 9)].into());
    mind.handle_with(ms(9000), votes(3, 1, Vote { round: round(1, 9), ..null(1) }), &mut follower);
    assert_eq!((mind.round(), mind.is_open(), mind.held()), (Some(round(1, 9)), false, None));
    mind.handle_with(ms(9001), gives(9, decided.clone()), &mut follower);
    assert_eq!(mind.held(), Some(&decided));
}

#[test]
fn a_round_under_a_count_that_was_used_elsewhere_is_opened_anew() {
    // It was cut off while others had a first round, which they could not decide.
    let mut late = mind(7);
    let mut other = mind(9);
    let lasted = |decision: Decision| {
        let (robots, quorum, elapsed_ms) = (3, 2, 5000);
        let certificate =
            gestalt_protocol::Certificate { robots, quorum, elapsed_ms, ..decision.certificate };
        Decision { certificate, ..decision }
    };
    let counted = decision(1, Some(0), 1, 9).certificate.votes;
    let undecided = lasted(decided(round(1, 9), None, counted, 9));
    other.handle(ms(0), gives(8, undecided.clone()));
    let opened = late.handle(ms(60_000), Input::Open);
    let said = opened.iter().find_map(|output| match output {
        Output::Broadcast(envelope) => Some(Input::Received(envelope.clone())),
        _ => None,
    });
    let answer = other.handle(ms(60_001), said.expect("a null vote"));
    let [(7, Message::Have(have))] = &told(&answer)[..] else { panic!("{answer:?}") };
    let asked = late.handle(ms(60_002), says(9, 1, Message::Have(have.clone())));
    let have = told(&asked).into_iter().find(|(to, message)| *to == 9 && matches!(message, Message::Have(_)));
    let Some((9, Message::Have(have))) = have else { panic!("{asked:?}") };
    let given = other.handle(ms(60_003), says(7, 9, Message::Have(have.clone())));
    let [(7, Message::Give(give))] = &told(&given)[..] else { panic!("{given:?}") };
    let out = late.handle(ms(60_004), says(9, 2, Message::Give(give.clone())));
    assert_eq!((late.round(), late.is_open()), (Some(round(2, 7)), true), "{out:?}");
    // A decision that came as fast as this round is old may be of it.
    let mut merges = mind(7);
    merges.handle(ms(60_000), Input::Open);
    merges.handle(ms(60_100), gives(9, decision(1, Some(2), 3, 9)));
    assert_eq!((merges.round(), merges.held().unwrap().class), (Some(round(1, 1)), Some(ClassId(2))));
}

#[test]
fn a_round_in_which_nothing_was_decided_gives_way_to_one_under_its_count_in_which_something_was() {
    // Robot 7 was cut off, and went through the showing alone; the others had another one later.
    for (elsewhere, by) in [(1, "the smaller"), (9, "the greater")] {
        let mut mind = mind(7);
        mind.handle(ms(0), Input::Open);
        live(&mut mind, ms(9000));
        assert_eq!((mind.round(), mind.held().unwrap().class), (Some(round(1, 7)), None));
        let theirs = drawn_late(round(1, elsewhere), Some(0), 3);
        let have = having(theirs.round, theirs.rank());
        let out = mind.handle(ms(9001), says(9, 1, Message::Have(have)));
        let asked = told(&out);
        assert!(matches!(&asked[..], [(9, Message::Have(_))]), "{by} name: it asks for it: {asked:?}");
        mind.handle(ms(9002), gives(9, theirs.clone()));
        assert_eq!(mind.held(), Some(&theirs), "{by} name");
        assert!(!mind.is_open());
        // And what was decided gives way to nothing.
        mind.handle(ms(9003), gives(8, drawn_late(round(1, 12), None, 2)));
        assert_eq!(mind.held(), Some(&theirs), "{by} name");
    }
}
