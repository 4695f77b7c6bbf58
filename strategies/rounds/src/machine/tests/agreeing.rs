//! How the decisions of many become one, said by one.

use super::*;

#[test]
fn the_greater_decision_replaces_the_held_one_and_is_held_aloud() {
    let mut mind = mind(7);
    mind.handle(ms(0), votes(1, 1, vote(1, 0, SURE)));
    let out = mind.handle(ms(2), Input::Heard(RobotId(2), decision(1, Some(2), 2, 2)));
    assert_eq!(holds(&out), [Some(2)]);
    assert!(holds(&mind.handle(ms(3), Input::Heard(RobotId(2), decision(1, Some(2), 2, 2)))).is_empty());
}

#[test]
fn the_smallest_live_robot_announces_once_settled_and_only_once() {
    let mut mind = mind(2);
    mind.handle(ms(0), Input::Alive(robots([2, 5, 9])));
    mind.handle(ms(100), Input::Heard(RobotId(5), decision(1, Some(0), 3, 5)));
    let mut all = live(&mut mind, ms(150));
    // The same class by more robots is no reason to wait longer.
    mind.handle(ms(150), Input::Heard(RobotId(5), decision(1, Some(0), 4, 5)));
    all.extend(live(&mut mind, ms(20_000)));
    let announced: Vec<_> =
        all.iter().filter(|(_, o)| matches!(o, Output::Announce(_))).map(|(at, _)| *at).collect();
    assert_eq!(announced, [ms(300)]);
}

#[test]
fn the_next_robots_wait_for_the_spokesrobot_and_take_over_when_it_is_silent() {
    let next = |heard: bool| {
        let mut mind = mind(9);
        mind.handle(ms(0), Input::Alive(robots([2, 5, 9])));
        mind.handle(ms(0), Input::Heard(RobotId(5), decision(1, Some(0), 3, 5)));
        if heard {
            mind.handle(ms(500), Input::Announced(decision(1, Some(0), 3, 5)));
        }
        let all = live(&mut mind, ms(20_000));
        all.iter().filter(|(_, o)| matches!(o, Output::Announce(_))).map(|(at, _)| *at).collect::<Vec<_>>()
    };
    assert_eq!(next(true), []);
    assert_eq!(next(false), [ms(200 + 2 * 400)]);
}

#[test]
fn who_has_guests_speaks_for_them_too() {
    let mut host = mind(8);
    host.handle(ms(0), Input::Guests(robots([2, 3])));
    host.handle(ms(0), Input::Alive(robots([1, 5])));
    host.handle(ms(0), Input::Heard(RobotId(5), decision(1, Some(1), 2, 5)));
    let times = (1..40).map(|k| ms(k * 50));
    let announced = |mind: &mut Rounds, mut times: Box<dyn Iterator<Item = Duration>>| {
        times.find(|at| announces(&mind.handle(*at, Input::Tick)) > 0)
    };
    // Robot 1 comes first, guests wait for nobody but it.
    assert_eq!(announced(&mut host, Box::new(times.clone())), Some(ms(600)));
    let mut host = mind(8);
    host.handle(ms(0), Input::Alive(robots([2, 5])));
    host.handle(ms(0), Input::Guests(robots([2])));
    host.handle(ms(0), Input::Heard(RobotId(5), decision(1, Some(1), 2, 5)));
    assert_eq!(announced(&mut host, Box::new(times)), Some(ms(200)));
}

#[test]
fn a_round_waits_for_guests_as_for_all_the_living() {
    let mut host = blind(8);
    host.handle(ms(0), Input::Guests(robots([2, 3])));
    let out = host.handle(ms(10), votes(2, 1, vote(1, 0, SURE)));
    assert_eq!(holds(&out), []);
    let out = host.handle(ms(20), votes(3, 1, vote(1, 0, SURE)));
    assert_eq!(holds(&out), [Some(0)]);
    let mut host = blind(8);
    host.handle(ms(0), Input::Guests(robots([2, 3])));
    host.handle(ms(10), votes(2, 1, vote(1, 0, SURE)));
    assert_eq!(holds(&host.handle(ms(20), Input::Guests(robots([2])))), [Some(0)], "one has left");
}

#[test]
fn a_changed_class_is_announced_again_and_the_same_class_is_not() {
    let mut mind = mind(2);
    mind.handle(ms(0), Input::Heard(RobotId(5), decision(1, Some(0), 3, 5)));
    assert_eq!(announces(&mind.handle(ms(200), Input::Tick)), 1);
    mind.handle(ms(300), Input::Heard(RobotId(5), decision(1, Some(0), 4, 5)));
    assert_eq!(announces(&mind.handle(ms(900), Input::Tick)), 0);
    mind.handle(ms(1000), Input::Heard(RobotId(5), decision(1, Some(1), 5, 5)));
    assert_eq!(announces(&mind.handle(ms(1200), Input::Tick)), 1);
}

#[test]
fn a_decision_that_this_robot_would_not_make_itself_is_not_adopted() {
    let sound = decision(1, Some(1), 3, 5);
    let changed = |change: &dyn Fn(&mut Decision)| {
        let mut decision = sound.clone();
        change(&mut decision);
        decision
    };
    let config = RoundsConfig { quorum: 3, ..RoundsConfig::default() };
    for (lie, refusal) in [
        (changed(&|d| d.certificate.vocabulary = VocabularyId(77)), Refusal::Vocabulary),
        (changed(&|d| d.certificate.probabilities.push(0.0)), Refusal::Vocabulary),
        (changed(&|d| d.certificate.rule = FusionRule::Majority), Refusal::Unfounded),
        (changed(&|d| d.certificate.votes.truncate(2)), Refusal::Unfounded),
        (changed(&|d| d.class = Some(ClassId(0))), Refusal::Unfounded),
        (changed(&|d| d.confidence = 0.999), Refusal::Unfounded),
        (
            changed(&|d| {
                d.confidence = 0.6;
                d.certificate.probabilities = vec![0.2, 0.6, 0.2];
            }),
            Refusal::Unfounded,
        ),
    ] {
        let mut mind = mind_with(7, config.clone());
        mind.handle(ms(0), Input::Heard(RobotId(5), lie.clone()));
        assert_eq!((mind.held(), mind.refusals().count(refusal)), (None, 1), "{lie:?}");
        mind.handle(ms(1), Input::Heard(RobotId(5), sound.clone()));
        assert_eq!(mind.held(), Some(&sound));
    }
}
