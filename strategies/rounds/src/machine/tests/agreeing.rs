//! How the decisions of many become one, said by one.

use super::*;

#[test]
fn the_greater_decision_replaces_the_held_one_and_is_held_aloud() {
    let mut mind = mind(7);
    mind.handle(ms(0), votes(1, 1, vote(1, 0, SURE)));
    let out = mind.handle(ms(2), gives(2, decision(1, Some(2), 2, 2)));
    assert_eq!(holds(&out), [Some(2)]);
    assert!(holds(&mind.handle(ms(3), gives(2, decision(1, Some(2), 2, 2)))).is_empty());
}

#[test]
fn the_smallest_live_robot_announces_once_settled_and_only_once() {
    let mut mind = mind(2);
    mind.handle(ms(0), Input::Alive(Arc::new(robots([2, 5, 9]))));
    mind.handle(ms(100), Input::Open);
    mind.handle(ms(100), gives(5, decision(1, Some(0), 3, 5)));
    mind.handle(ms(100), says_it_holds(5, &decision(1, Some(0), 3, 5)));
    let mut all = live(&mut mind, ms(150));
    // The same class by more robots is no reason to wait longer.
    mind.handle(ms(150), gives(5, decision(1, Some(0), 4, 5)));
    all.extend(live(&mut mind, ms(20_000)));
    let announced: Vec<_> =
        all.iter().filter(|(_, o)| matches!(o, Output::Announce(_))).map(|(at, _)| *at).collect();
    assert_eq!(announced, [ms(300)]);
}

#[test]
fn the_next_robots_wait_for_the_spokesrobot_and_take_over_when_it_is_silent() {
    let next = |heard: bool| {
        let mut mind = mind(9);
        mind.handle(ms(0), Input::Alive(Arc::new(robots([2, 5, 9]))));
        mind.handle(ms(0), Input::Open);
        mind.handle(ms(0), gives(5, decision(1, Some(0), 3, 5)));
        mind.handle(ms(0), says_it_holds(5, &decision(1, Some(0), 3, 5)));
        if heard {
            mind.handle(ms(500), announced(5, Decision { is_final: true, ..decision(1, Some(0), 3, 5) }));
        }
        let all = live(&mut mind, ms(20_000));
        all.iter().filter(|(_, o)| matches!(o, Output::Announce(_))).map(|(at, _)| *at).collect::<Vec<_>>()
    };
    assert_eq!(next(true), []);
    assert_eq!(next(false), [ms(200 + 2 * 400)]);
}

#[test]
fn a_decision_under_a_false_label_or_without_its_own_was_not_announced() {
    let announces_at = |mut mind: Rounds, label: Option<&str>| {
        mind.handle(ms(0), Input::Alive(Arc::new(robots([5, 9]))));
        mind.handle(ms(0), Input::Open);
        let held = decision(1, Some(0), 3, 5);
        mind.handle(ms(0), gives(5, held.clone()));
        mind.handle(ms(0), says_it_holds(5, &held));
        let Input::Announced(said) = announced(5, Decision { is_final: true, ..held }) else {
            unreachable!()
        };
        let label = label.map(str::to_owned);
        mind.handle(ms(100), Input::Announced(Announcement { label, ..said }));
        let refused = mind.refusals().count(Refusal::Label);
        let stands = mind.announcement_stands();
        let all = live(&mut mind, ms(20_000));
        let said = all.iter().find_map(|(_, output)| match output {
            Output::Announce(said) => Some(said.label.clone()),
            _ => None,
        });
        // It is taken in all the same: what nobody lies about is held.
        assert_eq!(mind.held().map(|held| held.class), Some(Some(ClassId(0))));
        (refused, stands, said)
    };
    assert_eq!(announces_at(mind(9), Some("one")), (0, true, None));
    let own = Some(Some("one".to_owned()));
    for false_label in ["two", "stop", "", "one (ana)"] {
        assert_eq!(announces_at(mind(9), Some(false_label)), (1, false, own.clone()), "{false_label}");
    }
    // Whoever has no list of gestures is no liar; but who knows the label says it.
    assert_eq!(announces_at(mind(9), None), (0, false, own));
    assert_eq!(announces_at(blind(9), None), (0, true, None), "nor does this one know it");
}

#[test]
fn who_has_guests_speaks_for_them_too() {
    let mut host = mind(8);
    host.handle(ms(0), Input::Guests(robots([2, 3])));
    host.handle(ms(0), Input::Alive(Arc::new(robots([1, 5]))));
    host.handle(ms(0), Input::Open);
    host.handle(ms(0), gives(5, decision(1, Some(1), 3, 5)));
    let times = (1..40).map(|k| ms(k * 50));
    let announced = |mind: &mut Rounds, mut times: Box<dyn Iterator<Item = Duration>>| {
        times.find(|at| announces(&mind.handle(*at, Input::Tick)) > 0)
    };
    // Robot 1 comes first, guests wait for nobody but it.
    assert_eq!(announced(&mut host, Box::new(times.clone())), Some(ms(600)));
    let mut host = mind(8);
    host.handle(ms(0), Input::Alive(Arc::new(robots([2, 5]))));
    host.handle(ms(0), Input::Guests(robots([2])));
    host.handle(ms(0), Input::Open);
    host.handle(ms(0), gives(5, decision(1, Some(1), 3, 5)));
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
    mind.handle(ms(0), Input::Open);
    mind.handle(ms(0), gives(5, decision(1, Some(0), 3, 5)));
    assert_eq!(announces(&mind.handle(ms(200), Input::Tick)), 1);
    mind.handle(ms(300), gives(5, decision(1, Some(0), 4, 5)));
    assert_eq!(announces(&mind.handle(ms(900), Input::Tick)), 0);
    mind.handle(ms(1000), gives(5, decision(1, Some(1), 5, 5)));
    mind.handle(ms(1000), says_it_holds(5, &decision(1, Some(1), 5, 5)));
    assert_eq!(announces(&mind.handle(ms(1200), Input::Tick)), 1);
}

#[test]
fn a_decision_that_this_robot_would_not_make_itself_is_not_adopted() {
    let config = RoundsConfig { quorum: Quorum::Evidence(3), ..adding_up() };
    let sound = by(&config, decision(1, Some(1), 3, 5));
    let changed = |change: &dyn Fn(&mut Decision)| {
        let mut decision = sound.clone();
        change(&mut decision);
        decision
    };
    for (lie, refusal) in [
        (changed(&|d| d.certificate.vocabulary = VocabularyId(77)), Refusal::Vocabulary),
        (changed(&|d| d.certificate.probabilities.push(0.0)), Refusal::Impossible),
        (changed(&|d| d.certificate.rule = FusionRule::Majority), Refusal::Unfounded),
        (by(&config, decision(1, Some(1), 2, 5)), Refusal::Unfounded),
        // Of other robots, by their own terms.
        (decision(1, Some(1), 3, 5), Refusal::Unfounded),
        (by(&RoundsConfig { alpha: Some(0.1), ..config.clone() }, sound.clone()), Refusal::Unfounded),
        (changed(&|d| d.class = Some(ClassId(0))), Refusal::Unfounded),
        (changed(&|d| d.confidence = 0.999), Refusal::Unfounded),
        (changed(&|d| d.certificate.probabilities = vec![0.0, 1.0, 0.0]), Refusal::Unfounded),
        (changed(&|d| d.certificate.votes[1].vote.round.counter = 2), Refusal::Unfounded),
        // Words that were never said, in the name of a robot that is known, and of this one.
        (changed(&|d| d.certificate.votes[1].vote.evidence = vec![-2.0, 3.9, -1.9]), Refusal::Unfounded),
        (changed(&|d| d.certificate.votes[0].robot = RobotId(7)), Refusal::Unfounded),
        // Undecided votes decide nothing.
        (
            {
                let votes = changed(&|d| {
                    d.certificate
                        .votes
                        .iter_mut()
                        .for_each(|counted| counted.vote.evidence = vec![0.0, 0.1, -0.1]);
                });
                by(&config, decided(round(1, 1), Some(1), votes.certificate.votes, 5))
            },
            Refusal::Unfounded,
        ),
    ] {
        let mut mind = mind_with(7, config.clone());
        mind.handle(ms(0), Input::Alive(Arc::new(robots([99]))));
        mind.handle(ms(0), votes(11, 2, vote(1, 1, SURE)));
        mind.handle(ms(0), gives(5, lie.clone()));
        assert_eq!((mind.held(), mind.refusals().count(refusal)), (None, 1), "{lie:?}");
        mind.handle(ms(1), gives(5, sound.clone()));
        assert_eq!(mind.held(), Some(&sound));
    }
}

pub(super) fn outputs(all: Vec<(Duration, Output)>) -> Vec<Output> {
    all.into_iter().map(|(_, output)| output).collect()
}

#[test]
fn what_a_robot_says_it_holds_is_asked_for_and_not_believed() {
    let mut mind = mind(7);
    let heard = decision(3, Some(1), 4, 5);
    let out = mind.handle(ms(0), says_it_holds(5, &heard));
    assert!(out.is_empty() && mind.held().is_none() && mind.round().is_none());
    assert_eq!(mind.next_wake(), Some(ms(100)), "most conclude it themselves until then");
    let out = mind.handle(ms(100), Input::Tick);
    assert!(matches!(told(&out)[..], [(5, Message::Have(Have { answer: false, .. }))]), "{out:?}");
    let mut holder = blind(5);
    holder.handle(ms(0), gives(9, heard.clone()));
    let Some((5, Message::Have(have))) = told(&out).first().copied() else { unreachable!() };
    let out = holder.handle(ms(101), says(7, 1, Message::Have(have.clone())));
    let [(7, Message::Give(give))] = &told(&out)[..] else { panic!("{out:?}") };
    mind.handle(ms(102), says(5, 2, Message::Give(give.clone())));
    assert_eq!(mind.held(), Some(&heard));
    let out = mind.handle(ms(103), says_it_holds(6, &heard));
    assert!(out.is_empty() && told(&outputs(live(&mut mind, ms(3000)))).is_empty(), "it is held");
}

#[test]
fn a_gesture_is_final_once_a_majority_is_known_to_hold_it() {
    let announced = |holders: &[u32]| {
        let mut mind = mind(1);
        mind.handle(ms(0), Input::Alive(Arc::new(robots(2..=5))));
        mind.handle(ms(0), Input::Open);
        mind.handle(ms(0), gives(9, decision(1, Some(1), 5, 9)));
        for holder in holders {
            mind.handle(ms(10), says_it_holds(*holder, &decision(1, Some(1), 5, 9)));
        }
        let all = live(&mut mind, ms(20_000));
        let said = all.iter().filter_map(|(at, output)| match output {
            Output::Announce(said) => Some((at.as_millis(), said.decision.is_final)),
            _ => None,
        });
        said.collect::<Vec<_>>()
    };
    // Five robots: this one, and two more.
    assert_eq!(announced(&[2, 9]), [(200, true)]);
    assert_eq!(announced(&[]), [(5200, false)], "nobody is known to hold it");
    assert_eq!(announced(&[2, 2]), [(5200, false)], "that one was counted");
}

#[test]
fn who_drew_a_decision_or_has_it_counts_for_none_that_did_not_say_that_it_holds_it() {
    let mut mind = mind(1);
    mind.handle(ms(0), Input::Alive(Arc::new(robots(2..=5))));
    mind.handle(ms(0), Input::Open);
    for author in 2..=5 {
        mind.handle(ms(0), gives(author, decision(1, Some(1), 5, author)));
        let have = having(mind.round().unwrap(), mind.held().unwrap().rank());
        mind.handle(ms(1), says(author, 51, Message::Have(have)));
    }
    assert!(!mind.held_aloud().unwrap().decision.is_final);
}

#[test]
fn a_robot_says_which_gesture_it_holds_once_and_whether_it_was_another_before() {
    let mut mind = mind(7);
    mind.handle(ms(0), votes(1, 1, vote(1, 0, LEANING)));
    let mut words = Vec::new();
    for (at, class, robots) in [(1, 0, 2), (2, 0, 3), (3, 1, 4), (4, 1, 5), (5, 0, 6)] {
        for output in mind.handle(ms(at), gives(5, decision(1, Some(class), robots, 5))) {
            if let Output::Broadcast(Envelope { message: Message::Holding(holding), stamp, .. }) = output {
                words.push((at, holding.class.unwrap().0, holding.changed, stamp.sequence));
            }
        }
    }
    let said: Vec<_> = words.iter().map(|(at, class, changed, _)| (*at, *class, *changed)).collect();
    assert_eq!(said, [(1, 0, false), (3, 1, true), (5, 0, false)]);
    assert!(words.is_sorted_by_key(|word| word.3), "each under a stamp of its own");
}

#[test]
fn what_robots_said_that_they_hold_reaches_who_could_not_hear_it() {
    let held = decision(1, Some(1), 5, 9);
    let mut knows = mind(7);
    knows.handle(ms(0), Input::Alive(Arc::new(robots([2, 3, 4, 8]))));
    knows.handle(ms(0), gives(9, held.clone()));
    for robot in [2, 3] {
        knows.handle(ms(1), says_it_holds(robot, &held));
    }
    let mut lacks = mind(8);
    lacks.handle(ms(0), Input::Alive(Arc::new(robots([2, 3, 4, 7]))));
    lacks.handle(ms(0), Input::Neighbours(robots([4, 7])));
    lacks.handle(ms(0), gives(9, held));
    let is_final = |mind: &mut Rounds| mind.held_aloud().unwrap().decision.is_final;
    assert_eq!((is_final(&mut knows), is_final(&mut lacks)), (true, false));
    let asks = |mind: &mut Rounds, at| {
        let mut out = outputs(live(mind, ms(at)));
        out.retain(|output| matches!(output, Output::Tell(RobotId(7), _)));
        out.pop().map(|output| match output {
            Output::Tell(_, envelope) => Input::Received(envelope),
            _ => unreachable!(),
        })
    };
    let asked = asks(&mut lacks, 4000).expect("neighbours are asked in turn");
    let out = knows.handle(ms(4000), asked.clone());
    let given = told(&out).into_iter().find_map(|(to, message)| match message {
        Message::Give(give) if to == 8 => Some(give.clone()),
        _ => None,
    });
    let give = given.unwrap_or_else(|| panic!("{out:?}"));
    assert_eq!(give.holders.iter().map(|holder| holder.robot.0).collect::<Vec<_>>(), [2, 3, 7]);
    let passed = lacks.handle(ms(4001), says(7, 60, Message::Give(give.clone())));
    assert!(is_final(&mut lacks));
    assert!(matches!(told(&passed)[..], [(4, Message::Give(_))]), "the other neighbour may lack it too");
    assert!(lacks.handle(ms(4002), says(7, 61, Message::Give(give.clone()))).is_empty());
    // What this one says of itself is all that the other still lacks.
    let own = lacks.round.as_ref().unwrap().agreement.holder(RobotId(8)).cloned().unwrap();
    let given = Give { decision: None, votes: vec![], holders: vec![own] };
    knows.handle(ms(4004), says(8, 90, Message::Give(given)));
    let digest = |mind: &Rounds| mind.round.as_ref().unwrap().agreement.digest();
    assert_eq!(digest(&knows), digest(&lacks), "then both are at rest");
}

/// It may have held another gesture with others before, and cannot know.
#[test]
fn who_started_again_in_the_midst_of_a_round_is_told_and_counts_for_none() {
    let word = |robot, boot, sequence, message| {
        let (author, stamp) = (RobotId(robot), Stamp { boot, sequence });
        Input::Received(Envelope { author, stamp, message, signature: None })
    };
    let said = |boot| word(3, boot, 5, Message::Vote(vote(1, 0, LEANING)));
    let there = &mut mind(7);
    there.handle(ms(0), Input::Alive(Arc::new(robots([3, 7]))));
    there.handle(ms(0), said(1));
    let told = there.handle(ms(10), said(2)).into_iter().find_map(|output| match output {
        Output::Tell(RobotId(3), Envelope { message: Message::Give(give), .. }) => Some(give),
        _ => None,
    });
    let told = told.expect("it is told what it said before");
    assert_eq!(told.votes.iter().map(|held| (held.robot.0, held.stamp.boot)).collect::<Vec<_>>(), [(3, 1)]);
    // Robot 3 in its second life.
    let here = &mut Rounds::new(RobotId(3), Life { boot: 2, nonce: 8 }, adding_up()).unwrap();
    here.handle(ms(0), Input::Alive(Arc::new(robots([3, 7]))));
    here.handle(ms(0), word(7, 1, 1, Message::Vote(null(1))));
    let holds = |mind: &mut Rounds, input| -> Option<bool> {
        let outputs = mind.handle(ms(20), input);
        outputs.into_iter().find_map(|output| match output {
            Output::Broadcast(Envelope { message: Message::Holding(holding), .. }) => Some(holding.changed),
            _ => None,
        })
    };
    assert_eq!(holds(here, gives(7, decision(1, Some(0), 3, 9))), Some(false));
    assert_eq!(holds(here, word(7, 1, 60, Message::Give(told))), Some(true), "it counts no more");
}

/// The part that was cut off has another name for the round; whoever has heard of both holds what one of them decided.
#[test]
fn two_decisions_that_count_a_robot_that_does_not_lie_are_of_one_round_however_late_they_meet() {
    let counted = |(robot, sequence, opener): (u32, u32, u32), class: u32| CountedVote {
        robot: RobotId(robot),
        stamp: Stamp { boot: 1, sequence },
        class: ClassId(class),
        weight: 1.0,
        vote: Vote { round: round(1, opener), ..vote(1, class as usize, SURE) },
        signature: None,
    };
    // When robot 3 voted here, under the name 3, and there, under which name: and by which names the round goes then, and what is held.
    for (here, (boot, there, name), called, held) in [
        (1, (1, 9, 2), 2, 0), // It has heard of a smaller one since,
        (9, (1, 1, 7), 3, 0), // or had before,
        (1, (2, 9, 2), 3, 1), // or has started since;
        (1, (1, 9, 7), 7, 0), // or has gone on to another round,
        (9, (1, 1, 2), 3, 1), // or had come from one.
    ] {
        let mut mind = mind(7);
        mind.handle(ms(0), Input::Alive(Arc::new(robots([3, 4, 7]))));
        mind.handle(ms(0), votes(3, here, Vote { round: round(1, 3), ..null(1) }));
        mind.handle(ms(10), votes(5, 1, Vote { round: round(1, 5), ..vote(1, 1, SURE) }));
        let late = adding_up().deadline + ms(2000);
        live(&mut mind, late);
        assert_eq!(mind.held().and_then(|held| held.class), Some(ClassId(1)), "with what it heard");
        assert_eq!(mind.round(), Some(round(1, 3)));
        let theirs = [(1, 1, name), (2, 1, name), (3, there, name)].map(|of| counted(of, 0));
        let theirs = theirs.map(|vote| CountedVote { stamp: Stamp { boot, ..vote.stamp }, ..vote });
        mind.handle(late, gives(1, decided(round(1, name), Some(0), theirs.to_vec(), 1)));
        let holds = mind.held().and_then(|held| held.class);
        assert_eq!((mind.round(), holds), (Some(round(1, called)), Some(ClassId(held))), "{there} as {name}");
    }
}

/// A relay may bring it last.
#[test]
fn a_vote_from_before_its_robot_came_to_this_round_opens_no_other() {
    let mut mind = mind(7);
    mind.handle(ms(0), votes(3, 1, vote(1, 0, SURE)));
    let decision = decision(1, Some(0), 3, 3);
    mind.handle(ms(10), gives(3, decision.clone()));
    live(&mut mind, adding_up().deadline + ms(500));
    let (here, at) = (round(1, 1), adding_up().deadline + ms(600));
    let elsewhere = |sequence| votes(9, sequence, Vote { round: round(1, 9), ..null(1) });
    mind.handle(at, says_it_holds(9, &decision));
    mind.handle(at, elsewhere(39));
    assert_eq!((mind.round(), mind.is_open()), (Some(here), false));
    mind.handle(at, elsewhere(41));
    assert_eq!((mind.round(), mind.is_open()), (Some(round(1, 9)), true), "it is in another since");
}
