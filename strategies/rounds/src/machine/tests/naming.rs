//! Gestures that were named since the list was made, which not all robots know.

use super::*;
use crate::called::Called;
use crate::proof::follows;

fn circle() -> ClassId {
    ClassId::named(&"ana".parse().unwrap(), "circle")
}

/// A vote of a robot that knows the gesture, and is for it.
fn for_circle(counter: u32) -> Vote {
    let evidence = vec![-SURE, -SURE, -SURE, 3.0 * SURE];
    Vote { evidence, unknown: Some(-SURE), named: vec![circle()], ..vote(counter, 0, 0.0) }
}

/// A vote of one that does not, and sees nothing that it knows.
fn for_unknown(counter: u32) -> Vote {
    Vote { unknown: Some(SURE), evidence: vec![0.5, -0.25, -0.25], ..vote(counter, 0, 0.0) }
}

#[test]
fn a_gesture_that_some_know_is_decided_by_all_and_its_proof_stands() {
    let mut mind = mind(7);
    mind.call([(circle(), Called { title: "circle".to_owned(), ..Called::default() })].into());
    mind.handle(ms(0), Input::Alive(Arc::new(robots(1..4))));
    for (robot, said) in [(1, for_circle(1)), (2, for_circle(1)), (3, for_unknown(1))] {
        mind.handle(ms(u64::from(robot)), votes(robot, 1, said));
    }
    live(&mut mind, ms(6000));
    let held = mind.held().expect("three of four see").clone();
    assert_eq!((held.class, mind.label_of(&held)), (Some(circle()), Some("circle")), "{held:?}");
    let certificate = &held.certificate;
    assert_eq!((&certificate.named[..], certificate.probabilities.len()), (&[circle()][..], 4));
    assert_eq!(certificate.votes[2].class, ClassId(0), "of those it knows");
    let config = mind.config().clone();
    assert!(follows(&held, &config.rule, &config, 4));
    let mut nameless = held.clone();
    nameless.certificate.named.clear();
    assert!(!follows(&nameless, &config.rule, &config, 4));
    let mut others = held;
    others.certificate.named = vec![ClassId::named(&"bob".parse().unwrap(), "circle")];
    assert!(!follows(&others, &config.rule, &config, 4));
}

#[test]
fn robots_that_know_it_and_robots_that_do_not_decide_gestures_of_the_list_together() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Alive(Arc::new(robots(1..4))));
    let knows = Vote {
        evidence: vec![SURE, -1.0, -1.0, -2.0],
        unknown: Some(-SURE),
        named: vec![circle()],
        ..vote(1, 0, 0.0)
    };
    let knows_not = Vote { unknown: Some(-SURE), ..vote(1, 0, SURE) };
    for (robot, said) in [(1, knows), (2, knows_not.clone()), (3, knows_not)] {
        mind.handle(ms(u64::from(robot)), votes(robot, 1, said));
    }
    live(&mut mind, ms(6000));
    let held = mind.held().unwrap();
    assert_eq!((held.class, held.certificate.votes.len()), (Some(ClassId(0)), 3), "{held:?}");
}

#[test]
fn a_vote_names_what_its_robot_knows_in_order() {
    let mut named = ["circle", "fist", "wave"].map(|label| ClassId::named(&"ana".parse().unwrap(), label));
    named.sort();
    let mut known = vocabulary();
    [2, 0, 1].into_iter().for_each(|place: usize| assert!(known.meet(named[place])));
    let mut mind = blind(7);
    mind.handle(ms(0), Input::Learned(Arc::new(Verbatim(known))));
    mind.handle(ms(0), Input::Open);
    // In the order in which they were met.
    let features = vec![0.1, 0.1, 0.1, 0.4, 0.2, 0.1];
    mind.handle(ms(10), Input::Observed(Observation { features, quality: 1.0 }));
    let out = live(&mut mind, ms(300));
    let mut said = out.iter().filter_map(|(_, output)| match output {
        Output::Broadcast(Envelope { message: Message::Vote(vote), .. }) => Some(vote),
        _ => None,
    });
    let vote = said.next_back().expect("it votes");
    assert_eq!((vote.listed(), &vote.named[..]), (3, &named[..]));
    let by_number: Vec<f32> = named.iter().map(|class| vote.evidence_for(*class).unwrap()).collect();
    assert!(by_number[2] > by_number[0] && by_number[0] > by_number[1], "{vote:?}");
    assert_eq!(by_number[1], vote.evidence[0], "as likely as those of the list");
}

/// Two robots may know of more or of fewer that bear one label; nobody calls a gesture as it likes.
#[test]
fn a_named_gesture_is_announced_as_one_of_its_names() {
    let called = Called { title: "stop".to_owned(), also: ["stop", "stop (ana)"].map(str::to_owned).into() };
    let mut mind = mind(7);
    mind.call([(circle(), called)].into());
    let decision = Decision { class: Some(circle()), ..decision(1, None, 0, 9) };
    for (label, is_it) in
        [("stop", true), ("stop (ana)", true), ("stop (x)", false), ("go", false), ("", false)]
    {
        assert_eq!(mind.may_be_called(&decision, Some(label)), is_it, "{label}");
    }
}
