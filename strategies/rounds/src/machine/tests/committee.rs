//! Of a thousand robots some seventy vote.

use super::agreeing::outputs;
use super::*;
use crate::committee::draw;

const SWARM: u32 = 1000;

/// Who of the robots 1 to 1000 votes in the round of that counter, by number, and who does not.
fn drawn(counter: u32) -> (Vec<u32>, Vec<u32>) {
    let members = draw(counter, 72, SWARM, (1..=SWARM).map(RobotId));
    // Robot 1 opens the rounds.
    assert!(!members.contains(&RobotId(1)));
    (2..=SWARM).partition(|robot| members.contains(&RobotId(*robot)))
}

/// A mind of robot `me` among a thousand, with a camera.
fn one_of_many(me: u32, config: RoundsConfig) -> Rounds {
    let mut mind = Rounds::new(RobotId(me), Life { boot: 1, nonce: 7 }, config).unwrap();
    mind.handle(ms(0), Input::Learned(Arc::new(Verbatim(vocabulary()))));
    mind.handle(ms(0), Input::Alive(Arc::new(robots(1..=SWARM))));
    mind
}

#[test]
fn who_is_not_drawn_says_nothing_and_concludes_from_the_votes_of_those_who_are() {
    let (members, others) = drawn(1);
    assert_eq!(members.len(), 72);
    let mut mind = one_of_many(others[0], adding_up());
    let mut said = Vec::new();
    for (n, robot) in members.iter().enumerate() {
        assert_eq!(mind.held(), None, "{n} votes");
        said.extend(mind.handle(ms(1), votes(*robot, 1, vote(1, 2, SURE))));
        said.extend(mind.handle(ms(2), saw([0.9, 0.05, 0.05])));
    }
    assert!(!mind.votes());
    said.extend(outputs(live(&mut mind, ms(10_000))));
    let held = mind.held().unwrap();
    assert_eq!((held.class, held.certificate.votes.len()), (Some(ClassId(2)), 72));
    assert_eq!((held.certificate.robots, held.certificate.quorum), (SWARM, 37));
    assert!(broadcast(&said).is_empty());
    assert!(!said.iter().any(|output| matches!(output, Output::Broadcast(_))), "nor what it holds: {said:?}");
    // And what it holds, any other takes from it.
    let mut another = one_of_many(others[1], adding_up());
    another.handle(ms(3), gives(others[0], held.clone()));
    assert_eq!(another.held().map(|held| held.class), Some(Some(ClassId(2))));
}

#[test]
fn who_is_drawn_votes_and_waits_for_the_others_that_are() {
    let (members, _) = drawn(1);
    let mut mind = one_of_many(members[0], adding_up());
    for robot in &members[1..71] {
        mind.handle(ms(1), votes(*robot, 1, vote(1, 2, SURE)));
    }
    mind.handle(ms(1), saw([0.05, 0.05, 0.9]));
    mind.handle(ms(300), Input::Tick);
    assert_eq!(mind.held(), None, "one has not spoken, and there is time");
    let out = mind.handle(ms(400), votes(members[71], 1, vote(1, 2, SURE)));
    assert_eq!(holds(&out), [Some(2)]);
    assert!(
        out.iter()
            .any(|output| matches!(output, Output::Broadcast(Envelope { message: Message::Holding(_), .. })))
    );
    assert_eq!(mind.held().unwrap().certificate.votes.len(), 72);
}

#[test]
fn who_opens_a_round_says_so_and_leaves_voting_to_those_who_are_drawn() {
    let (_, others) = drawn(1);
    let mut mind = one_of_many(others[0], adding_up());
    let mut said = mind.handle(ms(0), Input::Open);
    for at in [10, 600, 1200] {
        said.extend(mind.handle(ms(at), saw([0.9, 0.05, 0.05])));
        said.extend(outputs(live(&mut mind, ms(at))));
    }
    let said = broadcast(&said);
    assert!(said.iter().all(|vote| vote.evidence.is_empty() && vote.round.opener == RobotId(others[0])));
    assert_eq!(said.len(), 2, "and again after a second, as it may be lost");
}

#[test]
fn votes_of_those_who_were_not_drawn_are_evidence_but_no_quorum() {
    let (members, others) = drawn(1);
    let mut mind = one_of_many(others[0], adding_up());
    for robot in members[..36].iter().chain(&others[1..200]) {
        mind.handle(ms(1), votes(*robot, 1, vote(1, 2, SURE)));
    }
    mind.handle(ms(1100), Input::Tick);
    assert_eq!(mind.held(), None, "half of the committee is no majority of it");
    mind.handle(ms(1200), votes(members[36], 1, vote(1, 2, SURE)));
    assert_eq!(mind.held().unwrap().certificate.votes.len(), 236);
}

fn counted(robot: &u32) -> CountedVote {
    CountedVote {
        robot: RobotId(*robot),
        stamp: Stamp { boot: 1, sequence: 1 },
        class: ClassId(2),
        weight: 1.0,
        vote: vote(1, 2, SURE),
        signature: None,
    }
}

#[test]
fn a_decision_that_others_made_among_themselves_is_refused() {
    let (members, others) = drawn(1);
    let of = |robots: &[u32]| {
        let mut robots = robots.to_vec();
        robots.sort_unstable();
        decided(round(1, 1), Some(2), robots.iter().map(counted).collect(), robots[0])
    };
    let adopts = |decision: Decision| {
        let mut mind = one_of_many(others[0], adding_up());
        mind.handle(ms(1), gives(1, decision));
        mind.held().map(|held| held.class) == Some(Some(ClassId(2)))
    };
    assert!(adopts(of(&members[..37])));
    assert!(!adopts(of(&members[..36])));
    // Those least likely to be drawn, whoever knows how many robots.
    let config = RoundsConfig::default();
    let never: Vec<u32> =
        others.iter().copied().filter(|robot| !config.may_be_drawn(1, RobotId(*robot), SWARM)).collect();
    assert!(never.len() > 800);
    assert!(!adopts(of(&never[1..300])));
}

#[test]
fn where_most_of_the_swarm_cannot_be_seen_nobody_votes() {
    let (members, _) = drawn(1);
    let mut mind = one_of_many(members[0], adding_up());
    mind.handle(ms(1000), Input::Alive(Arc::new(robots((1..=499).chain([members[0]])))));
    let out = mind.handle(ms(2000), votes(2, 1, null(1)));
    assert!(!mind.votes() && broadcast(&out).is_empty(), "{out:?}");
    let out = mind.handle(ms(3000), Input::Alive(Arc::new(robots((1..=600).chain([members[0]])))));
    assert!(mind.votes());
    assert_eq!(broadcast(&out).len(), 1);
    // After two minutes those who are left are the swarm.
    mind.handle(ms(4000), Input::Alive(Arc::new(robots((1..=400).chain([members[0]])))));
    assert!(!mind.votes());
    live(&mut mind, ms(9000));
    mind.handle(ms(130_000), votes(2, 2, null(2)));
    let mind_count = mind.electorate.count();
    assert!((400..=401).contains(&mind_count), "{mind_count}");
    let members = draw(2, 72, mind_count, (1..=400).chain([members[0]]).map(RobotId));
    assert_eq!(mind.votes(), members.contains(&mind.me()));
}

/// They were not to say anything, as long as they saw so few.
#[test]
fn who_was_of_the_smaller_part_is_not_silent_when_the_cut_has_healed() {
    let (members, _) = drawn(1);
    let mut mind = one_of_many(members[0], adding_up());
    let part: Vec<u32> = (1..=400).chain([members[0]]).collect();
    mind.handle(ms(1000), Input::Alive(Arc::new(robots(part.clone()))));
    mind.handle(ms(2000), votes(2, 1, null(1)));
    assert!(members.iter().filter(|robot| part.contains(robot)).count() > 20 && !mind.votes());
    live(&mut mind, ms(9000));
    mind.handle(ms(9000), Input::Alive(Arc::new(robots(1..=SWARM))));
    mind.handle(ms(9100), votes(2, 2, null(2)));
    assert!(mind.silent().is_empty(), "{:?}", mind.silent());
    assert_eq!(mind.electorate.count(), SWARM);
}

#[test]
fn names_without_robots_are_drawn_once() {
    let (members, others) = drawn(1);
    // A hundred of the thousand are names.
    let is_name = |robot: u32| robot > 900;
    let mut mind = one_of_many(others[0], adding_up());
    for robot in members.iter().filter(|robot| !is_name(**robot)) {
        mind.handle(ms(1), votes(*robot, 1, vote(1, 2, SURE)));
    }
    live(&mut mind, ms(9000));
    let named = members.iter().filter(|robot| is_name(**robot)).count() as u32;
    assert!(named > 0);
    assert_eq!(mind.electorate.count(), SWARM, "that round is made final by as many as there were");
    let speaks = members.iter().find(|robot| !is_name(**robot)).unwrap();
    mind.handle(ms(9000), votes(*speaks, 2, null(2)));
    assert_eq!(mind.electorate.count(), SWARM - named);
    // They are robots after all.
    for robot in members.iter().filter(|robot| is_name(**robot)) {
        mind.handle(ms(9000), votes(*robot, 1, vote(2, 2, SURE)));
    }
    assert_eq!(mind.electorate.count(), SWARM);
}

#[test]
fn whose_vote_was_lost_is_drawn_again_once_a_decision_brings_it() {
    let (members, others) = drawn(1);
    let mut mind = one_of_many(others[0], adding_up());
    for robot in &members[1..] {
        mind.handle(ms(1), votes(*robot, 1, vote(1, 2, SURE)));
    }
    live(&mut mind, ms(9000));
    mind.handle(
        ms(9000),
        gives(1, decided(round(1, 1), Some(2), members.iter().map(counted).collect(), members[0])),
    );
    assert_eq!(mind.held().map(|held| held.certificate.votes.len()), Some(72));
    mind.handle(ms(9100), votes(members[1], 2, null(2)));
    assert!(mind.silent().is_empty());
    assert_eq!(mind.electorate.count(), SWARM);
}

#[test]
fn a_decision_is_final_once_most_of_the_committee_are_known_to_hold_it() {
    let (members, others) = drawn(1);
    let mut mind = one_of_many(others[0], adding_up());
    for robot in &members {
        mind.handle(ms(1), votes(*robot, 1, vote(1, 2, SURE)));
    }
    let held = mind.held().unwrap().clone();
    let is_final = |mind: &mut Rounds| mind.held_aloud().unwrap().decision.is_final;
    for robot in others[1..].iter().chain(&members[..36]) {
        mind.handle(ms(2), says_it_holds(*robot, &held));
    }
    assert!(!is_final(&mut mind), "others may say what they like, and half is not most");
    mind.handle(ms(3), says_it_holds(members[36], &held));
    assert!(is_final(&mut mind));
}

#[test]
fn a_hundred_robots_all_vote() {
    let mut mind = mind(5);
    mind.handle(ms(0), Input::Alive(Arc::new(robots(1..=108))));
    for counter in 1..=20 {
        let at = ms(u64::from(counter) * 10_000);
        let out = mind.handle(at, votes(2, counter, null(counter)));
        assert_eq!(broadcast(&out).len(), 1, "round {counter}");
        live(&mut mind, at + ms(9000));
    }
}
