//! What one member that lies about rounds, in words that it signs, cannot do to them.

use super::*;

/// That nothing was decided in a round that nobody but that robot was ever in, after longer than anything lasts.
fn undecided(id: RoundId, by: u32) -> Decision {
    let nothing = decision(id.counter, None, 0, by);
    let stamp = Stamp { boot: 1, sequence: 9 };
    let vote = Vote { round: id, ..null(id.counter) };
    let own = HeldVote { robot: RobotId(by), stamp, vote, signature: None };
    let certificate =
        gestalt_protocol::Certificate { others: vec![own], elapsed_ms: u32::MAX, ..nothing.certificate };
    Decision { round: id, certificate, ..nothing }
}

/// With a chosen few of its votes something else could be decided then, of a round that all others know nothing of.
#[test]
fn that_nothing_was_decided_elsewhere_ends_no_round_in_which_others_take_part() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Alive(Arc::new(robots([3, 4, 5, 66]))));
    for (robot, class) in [(3, 0), (4, 1), (5, 2)] {
        mind.handle(ms(0), votes(robot, 1, vote(1, class, LEANING)));
    }
    for at in [10, 400, 600, 3000, 4900] {
        for id in [round(1, u32::MAX), round(2, 66), round(3, u32::MAX)] {
            for says in [announced(66, undecided(id, 66)), gives(66, undecided(id, 66))] {
                mind.handle(ms(at), says);
                assert_eq!((mind.round(), mind.is_open()), (Some(round(1, 1)), true), "{id} at {at}");
                assert_eq!((mind.held(), mind.ballot().unwrap().len()), (None, 4), "{id} at {at}");
            }
        }
    }
    assert!(mind.refusals().count(Refusal::TooSoon) > 0);
    assert_eq!(mind.highest, Some(1), "nor is it heard of");
    // It is no longer than any other.
    live(&mut mind, ms(5300));
    mind.handle(ms(5300), gives(66, undecided(round(2, 66), 66)));
    assert_eq!(mind.round(), Some(round(2, 66)));
}

/// Its gesture is still shown, and all others would say that its count belongs to an earlier round.
#[test]
fn who_opened_a_round_opens_another_on_the_word_of_one_that_its_count_was_used_once_within_a_deadline() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Alive(Arc::new(robots([3, 4, 66]))));
    mind.handle(ms(0), Input::Open);
    let heard = |mind: &mut Rounds, at, input| {
        mind.handle(ms(at), input);
        mind.round().unwrap()
    };
    assert_eq!(heard(&mut mind, 10, votes(3, 1, Vote { round: round(1, 7), ..null(1) })), round(1, 7));
    let used = |counter| gives(66, undecided(round(counter, u32::MAX), 66));
    assert_eq!(heard(&mut mind, 100, used(1)), round(1, 7), "it has its time");
    assert_eq!(heard(&mut mind, 600, used(1)), round(2, 7));
    assert_eq!(heard(&mut mind, 610, votes(3, 2, Vote { round: round(2, 7), ..null(2) })), round(2, 7));
    for at in [1200, 2000, 4000] {
        assert_eq!(heard(&mut mind, at, used(2)), round(2, 7), "{at}");
        assert!(mind.is_open());
    }
}

/// Whoever could have one of its names forgotten could have what was said under that heard as another round.
#[test]
fn a_round_keeps_its_name_however_many_others_one_robot_brings() {
    let deadline = adding_up().deadline;
    let voted = |opener| Vote { round: round(1, opener), ..null(1) };
    for decides in [false, true] {
        let mut mind = mind(7);
        mind.handle(ms(0), Input::Alive(Arc::new(robots([3, 4, 66]))));
        mind.handle(ms(0), votes(3, 1, voted(500)));
        for (k, opener) in (501..517).chain([400, 399, 398]).enumerate() {
            let drawn = undecided(round(1, opener), 66);
            let certificate = gestalt_protocol::Certificate { elapsed_ms: 0, ..drawn.certificate };
            let says = match decides {
                true => gives(66, Decision { certificate, ..drawn }),
                false => votes(66, k as u32, voted(opener)),
            };
            mind.handle(ms(10 + 100 * k as u64), says);
        }
        assert_eq!(mind.round(), Some(round(1, 500)), "beyond what one may bring there is none");
        assert!(mind.ballot().unwrap().stamp(RobotId(66)).is_some(), "but its vote counts");
        mind.handle(ms(3000), votes(4, 1, voted(350)));
        assert_eq!(mind.round(), Some(round(1, 350)), "others bring theirs");
        live(&mut mind, deadline + ms(500));
        assert!(!mind.is_open());
        mind.handle(deadline + ms(3000), votes(3, 1, voted(500)));
        assert_eq!((mind.round(), mind.is_open()), (Some(round(1, 350)), false));
    }
}

/// What is decided under a name that came too late is held under one that all know.
#[test]
fn a_decision_under_a_name_beyond_those_is_held_under_that_of_the_round() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Alive(Arc::new(robots([3, 66]))));
    mind.handle(ms(0), votes(3, 1, vote(1, 0, LEANING)));
    for sequence in 1..20 {
        mind.handle(ms(10), votes(66, sequence, Vote { round: round(1, 500 + sequence), ..null(1) }));
    }
    let drawn = Decision { round: round(1, 600), ..decision(1, Some(0), 3, 9) };
    mind.handle(ms(20), gives(66, drawn.clone()));
    assert_eq!(mind.held(), Some(&Decision { round: round(1, 1), ..drawn }));
}

/// Whoever has a key to teach could speak of rounds to come, whose names are no secret.
#[test]
fn a_round_opens_whatever_was_said_of_rounds_to_come() {
    let mut follower = Taught((2..66).map(|counter| round(counter, 7)).collect());
    let mut mind = mind(7);
    for (n, counter) in [1, 66, 67].into_iter().enumerate() {
        let at = ms(9000 * n as u64);
        live(&mut mind, at);
        mind.handle_with(at, Input::Open, &mut follower);
        assert_eq!((mind.round(), mind.is_open()), (Some(round(counter, 7)), true));
    }
}

/// One robot gives that the round of that count came to nothing.
fn came_to_nothing(counter: u32, by: u32) -> Input {
    gives(by, undecided(round(counter, by), by))
}

fn among_others(config: RoundsConfig) -> Rounds {
    let mut mind = mind_with(7, config);
    mind.handle(ms(0), Input::Alive(Arc::new(robots([3, 4, 66]))));
    mind
}

#[test]
fn who_asks_for_a_round_has_it_whatever_came_to_nothing_elsewhere() {
    let mut mind = among_others(adding_up());
    mind.handle(ms(1000), came_to_nothing(1, 66));
    assert_eq!((mind.round(), mind.is_open()), (Some(round(1, 66)), false));
    mind.handle(ms(1001), Input::Open);
    assert_eq!((mind.round(), mind.is_open()), (Some(round(2, 7)), true));
}

#[test]
fn a_gesture_has_its_round_whatever_came_to_nothing_while_the_hand_moved() {
    let mut mind = among_others(adding_up());
    mind.handle(ms(1300), came_to_nothing(1, 66));
    mind.handle(ms(1400), Input::Shown(ms(1000)));
    assert_eq!((mind.round(), mind.is_open()), (Some(round(2, 7)), true));
    // What was decided elsewhere was this gesture.
    let mut mind = among_others(adding_up());
    mind.handle(ms(1300), gives(3, decision(1, Some(0), 3, 3)));
    mind.handle(ms(1400), Input::Shown(ms(1000)));
    live(&mut mind, ms(3000));
    assert_eq!((mind.round(), mind.is_open()), (Some(round(1, 1)), false));
}

#[test]
fn a_request_is_taken_for_a_copy_of_the_one_before_whatever_came_to_nothing_in_between() {
    let mut mind = among_others(RoundsConfig { settle: ms(0), ..adding_up() });
    mind.handle(ms(1000), Input::Open);
    mind.handle(ms(1010), gives(3, decision(1, Some(0), 3, 3)));
    mind.handle(ms(1020), came_to_nothing(2, 66));
    mind.handle(ms(1499), Input::Open);
    assert_eq!((mind.round(), mind.is_open()), (Some(round(2, 66)), false));
    mind.handle(ms(1500), Input::Open);
    assert_eq!((mind.round(), mind.is_open()), (Some(round(3, 7)), true));
}

#[test]
fn what_is_held_gives_way_to_nothing_once_a_deadline() {
    let mut mind = among_others(adding_up());
    mind.handle(ms(1000), gives(3, decision(1, Some(0), 3, 3)));
    for counter in 2..12 {
        mind.handle(ms(1000 + 300 * u64::from(counter)), came_to_nothing(counter, 66));
    }
    let counted = mind.refusals().count(Refusal::TooSoon) + mind.refusals().count(Refusal::DecisionTooOften);
    assert_eq!((mind.round(), counted), (Some(round(2, 66)), 9));
    // Another robot is heard.
    mind.handle(ms(4800), came_to_nothing(12, 4));
    assert_eq!(mind.round(), Some(round(12, 4)));
}

#[test]
fn a_round_that_has_just_been_opened_does_not_end_for_one_that_came_to_nothing() {
    let mut mind = among_others(adding_up());
    mind.handle(ms(1000), Input::Open);
    mind.handle(ms(1001), came_to_nothing(2, 66));
    assert_eq!((mind.round(), mind.is_open()), (Some(round(1, 7)), true));
    assert_eq!(mind.refusals().count(Refusal::TooSoon), 1);
}
