//! Who counted rounds alone meets others who count from the beginning.

use std::collections::VecDeque;

use super::*;

/// Delivers whatever they say at once, and wakes them whenever they want to, until `end`.
fn run(swarm: &mut [Rounds], mut now: Duration, inputs: Vec<(usize, Input)>, end: Duration) {
    let mut inbox = VecDeque::from(inputs);
    for _ in 0..10_000 {
        while let Some((to, input)) = inbox.pop_front() {
            for output in swarm[to].handle(now, input) {
                for (other, mind) in swarm.iter().enumerate().filter(|(other, _)| *other != to) {
                    inbox.extend(match &output {
                        Output::Broadcast(said) => Some((other, Input::Received(said.clone()))),
                        Output::Announce(said) => Some((other, Input::Announced(said.clone()))),
                        Output::Tell(robot, said) if *robot == mind.me() => {
                            Some((other, Input::Received(said.clone())))
                        }
                        _ => None,
                    });
                }
            }
        }
        let wakes: Vec<_> = swarm.iter().map(Rounds::next_wake).collect();
        let Some(wake) = wakes.iter().flatten().min().filter(|wake| **wake <= end) else { return };
        now = now.max(*wake);
        let due = wakes.iter().enumerate().filter(|(_, wake)| wake.is_some_and(|wake| wake <= now));
        inbox.extend(due.map(|(robot, _)| (robot, Input::Tick)));
    }
    panic!("they never come to rest");
}

/// One that waits for what its camera shows.
fn seeing(me: u32) -> Rounds {
    let mut mind = mind(me);
    mind.handle(ms(0), Input::Blind(false));
    mind
}

/// A gesture is shown to all, and one of them opens a round for it.
fn shown(swarm: &mut [Rounds], opener: usize, at: Duration) {
    run(swarm, at, vec![(opener, Input::Open)], at + ms(50));
    let see = (0..swarm.len()).map(|robot| (robot, saw([0.98, 0.01, 0.01]))).collect();
    run(swarm, at + ms(50), see, at + ms(9000));
}

#[test]
fn who_counted_alone_decides_with_those_who_join_it_from_the_first_round_on() {
    // The links of each. Of three in a line one is no neighbour of who was alone.
    let pair: &[&[u32]] = &[&[1], &[3]];
    let line: &[&[u32]] = &[&[1], &[2, 3], &[1]];
    for links in [pair, line] {
        let mut swarm = vec![seeing(3)];
        for round in 1..=5 {
            shown(&mut swarm, 0, ms(10_000 * round));
        }
        let alone = swarm[0].held().expect("it is most of one").clone();
        assert_eq!((alone.round.counter, alone.certificate.robots), (5, 1));
        swarm.extend([1, 2].into_iter().take(links.len() - 1).map(seeing));
        let all: BTreeSet<RobotId> = swarm.iter().map(Rounds::me).collect();
        let met = links.iter().enumerate().flat_map(|(robot, links)| {
            let alive = Input::Alive(Arc::new(all.clone()));
            [(robot, alive), (robot, Input::Neighbours(robots(links.iter().copied())))]
        });
        run(&mut swarm, ms(70_000), met.collect(), ms(75_000));
        shown(&mut swarm, 1, ms(80_000));
        for mind in &swarm {
            let held = mind.held().expect("all are sure");
            let decided = (held.round.counter, held.class, held.certificate.votes.len());
            assert_eq!(decided, (6, Some(ClassId(0)), links.len()), "robot {}", mind.me());
        }
    }
}

/// Else one robot would use them up, or part whom it lies to from the others.
#[test]
fn what_is_no_decision_here_takes_counts_less_than_a_leap_further_and_one_round() {
    let among_five = |me| {
        let mut mind = mind(me);
        mind.handle(ms(0), Input::Alive(Arc::new(robots([3, 4, 5, 7, 66]))));
        mind
    };
    let opens = |mind: &mut Rounds, at| {
        let out = mind.handle(ms(at), Input::Open);
        let vote = broadcast(&out)[0].clone();
        live(mind, ms(at + 7000));
        vote
    };
    for (liar, counters) in [(66, [1024, 1025]), (99, [1, 2])] {
        let mut mind = among_five(7);
        mind.handle(ms(0), gives(liar, decision(50_000, Some(0), 1, liar)));
        assert_eq!((mind.round(), mind.highest), (None, None), "one is no majority of five");
        for (at, counter) in [(10, counters[0]), (10_000, counters[1])] {
            let vote = opens(&mut mind, at);
            assert_eq!(vote.round.counter, counter, "{liar}");
            if at == 10 {
                let mut another = among_five(4);
                another.handle(ms(at), votes(7, 1, vote));
                assert!(another.is_open(), "who was told nothing follows");
            }
        }
    }
    let mut mind = among_five(7);
    mind.highest = Some((1 << 24) - 10);
    mind.handle(ms(0), gives(66, decision((1 << 24) + 500, Some(0), 1, 66)));
    assert_eq!(opens(&mut mind, 10).round.counter, 1 << 24, "the bound");
}

/// Of two parts of a swarm each would decide, if it took itself for the whole.
#[test]
fn a_swarm_that_is_cut_before_its_first_round_decides_in_no_part_without_most_of_it() {
    // Whether names cost a key, and whether the other robot said anything; whether this one decides when that is gone, and later.
    for (sealed, met, decides) in [(true, false, false), (false, true, false), (false, false, true)] {
        let mut mind = mind(7);
        if sealed {
            mind = mind.signed_by(Arc::new(signing::Scribe(Arc::default())));
        }
        mind.handle(ms(0), Input::Alive(Arc::new(robots([7, 8]))));
        if met {
            let nothing =
                Have { round: None, decision: None, ..having(round(1, 8), decision(1, None, 0, 8).rank()) };
            mind.handle(ms(1), says(8, 1, Message::Have(nothing)));
        }
        mind.handle(ms(10), Input::Alive(Arc::new(robots([7]))));
        for (at, expected) in [(20, decides), (130_000, true)] {
            mind.handle(ms(at), Input::Open);
            mind.handle(ms(at), saw([0.98, 0.01, 0.01]));
            live(&mut mind, ms(at + 7000));
            let decided = mind.held().and_then(|held| held.class).is_some();
            assert_eq!(decided, expected, "{sealed} {met} {at}");
        }
    }
}
