//! A member of a sealed swarm that lies under its own key.

use std::time::{Duration, Instant};

use gestalt_link::Event;
use gestalt_protocol::{
    ClassId, Decision, Envelope, Give, HeldVote, Keys, Message, RobotId, RoundId, Stamp, Topic, Vote,
};
use gestalt_strategies::Classify;
use gestalt_tests::{Fixed, Watched, agreed, key, sealed, start, tag, unique, with_eve};
use gestalt_trust::statement;
use zenoh::qos::CongestionControl;

use crate::stranger::{enter, star};
use crate::trouble::counted;

const PATIENCE: Duration = Duration::from_secs(30);

pub async fn who_says_two_things_is_known_to_all_and_counts_no_more() {
    let swarm = unique("liar");
    let members = with_eve(&swarm, 5);
    let swarm_id = members.clone().sign(&key(1000)).unwrap().swarm_id();
    let (mut robots, locators) = star(3, |id, connect| sealed(id, &members, connect)).await;
    let keys = Keys::new(&swarm).unwrap();
    let liar = enter(&members, &locators).await;
    let put = async |topic: Topic, bytes: Vec<u8>| {
        let put = liar.put(keys.key(&topic), bytes).congestion_control(CongestionControl::Block);
        put.await.unwrap();
    };
    let vocabulary = Fixed::default().vocabulary().id();
    let vote = |by: u32, round: RoundId, sequence: u32, for_class: usize| {
        let mut evidence = vec![-1.0; 6];
        evidence[for_class] = 5.0;
        let message =
            Message::Vote(Vote { round, vocabulary, evidence, looks: 4.0, unknown: None, named: vec![] });
        let stamp = Stamp { boot: 1, sequence };
        let said = Envelope { author: RobotId(3), stamp, message, signature: None };
        Envelope { signature: Some(statement::sign(&key(by), &swarm_id, &said.statement())), ..said }
    };
    robots[0].robot.open_round();
    let first = agreed(&mut robots, 1, PATIENCE).await.round;

    // In its name, but by another key: that proves nothing.
    put(Topic::Vote(RobotId(3)), vote(77, first, 1, 2).encode()).await;
    put(Topic::Vote(RobotId(3)), vote(77, first, 1, 5).encode()).await;
    put(Topic::Evidence, vec![1, 2, 3]).await;
    counted(&robots[0], "refused_vote_forged", 2).await;
    counted(&robots[2], "refused_evidence", 1).await;
    assert!(!robots[0].robot.status().counters.contains_key("convicted_3"));

    // One thing to all, and another to one of them.
    put(Topic::Vote(RobotId(3)), vote(3, first, 2, 2).encode()).await;
    let Envelope { author: robot, stamp, message: Message::Vote(other), signature } = vote(3, first, 2, 5)
    else {
        unreachable!()
    };
    let give = Message::Give(Give {
        decision: None,
        votes: vec![HeldVote { robot, stamp, vote: other, signature }],
        holders: vec![],
    });
    let stamp = Stamp { boot: 1, sequence: 3 };
    let given = Envelope { author: RobotId(3), stamp, message: give, signature: None }.encode();
    let to_one = liar.put(keys.key(&Topic::Repair(RobotId(1))), given.clone());
    to_one.attachment(tag(3, 1, &members, &given)).await.unwrap();
    for robot in &robots {
        counted(robot, "convicted_3", 1).await;
    }
    // Who was not there hears of it.
    robots.push(start(sealed(4, &members, &locators), None).await);
    counted(&robots[3], "convicted_3", 1).await;
    assert!(robots[0].sees_alive(3, PATIENCE).await);

    robots[0].robot.open_round();
    let opened = |event| match event {
        Event::Opened(round) if round.counter == 2 => Some(round),
        _ => None,
    };
    let round = robots[0].wait(PATIENCE, opened).await.expect("it opens");
    let mut sequences = 4..;
    for sequence in sequences.by_ref().take(16) {
        put(Topic::Vote(RobotId(3)), vote(3, round, sequence, 2).encode()).await;
    }
    let second = agreed(&mut robots, 2, PATIENCE).await;
    assert!(second.certificate.votes.iter().all(|counted| counted.robot != RobotId(3)), "{second:?}");
    // Who missed some, as its link began anew, hears the next.
    let refused = |robot: &Watched| {
        robot.robot.status().counters.get("refused_vote_convicted").is_some_and(|count| *count >= 16)
    };
    let deadline = Instant::now() + PATIENCE;
    while !robots.iter().all(refused) {
        let counters = || robots.iter().map(|robot| robot.robot.status().counters).collect::<Vec<_>>();
        assert!(Instant::now() < deadline, "16 of refused_vote_convicted each: {:#?}", counters());
        let sequence = sequences.next().expect("no end");
        put(Topic::Vote(RobotId(3)), vote(3, round, sequence, 2).encode()).await;
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    liar.close().await.unwrap();
    for robot in robots {
        robot.stop().await;
    }
}

pub async fn who_gives_what_does_not_follow_is_known_to_all_and_counts_no_more() {
    let swarm = unique("liar");
    let members = with_eve(&swarm, 5);
    let swarm_id = members.clone().sign(&key(1000)).unwrap().swarm_id();
    let (mut robots, locators) = star(3, |id, connect| sealed(id, &members, connect)).await;
    let keys = Keys::new(&swarm).unwrap();
    let liar = enter(&members, &locators).await;
    let put = async |topic: Topic, said: Envelope| {
        let bytes = said.encode();
        let tag = matches!(topic, Topic::Repair(_)).then(|| tag(3, 1, &members, &bytes));
        let put = liar.put(keys.key(&topic), bytes).congestion_control(CongestionControl::Block);
        put.attachment(tag).await.unwrap();
    };
    let signed = |by: u32, sequence: u32, message: Message| {
        let stamp = Stamp { boot: 1, sequence };
        let said = Envelope { author: RobotId(3), stamp, message, signature: None };
        Envelope { signature: Some(statement::sign(&key(by), &swarm_id, &said.statement())), ..said }
    };
    let give = |decision: &Decision| {
        Message::Give(Give { decision: Some(decision.clone()), votes: vec![], holders: vec![] })
    };
    let to_one = Topic::Repair(RobotId(1));

    robots[0].robot.open_round();
    let decided = agreed(&mut robots, 1, PATIENCE).await;
    // What another robot decided, passed on as it is; altered, by another key; and with no signature.
    put(to_one.clone(), signed(3, 1, give(&decided))).await;
    let mut altered = decided.clone();
    altered.class = altered.class.map(|class| ClassId((class.0 + 1) % 6));
    put(to_one.clone(), signed(77, 2, give(&altered))).await;
    put(to_one.clone(), Envelope { signature: None, ..signed(3, 3, give(&altered)) }).await;
    counted(&robots[1], "refused_repair_forged", 1).await;
    counted(&robots[1], "refused_repair_unsigned", 1).await;
    for robot in &robots {
        let counters = robot.robot.status().counters;
        assert!(!counters.keys().any(|name| name.starts_with("convicted_")), "{counters:?}");
    }

    // In the midst of a round, which opens no sooner, it votes, and gives what it altered to one of them, under its own name.
    tokio::time::sleep(Duration::from_secs(1)).await;
    robots[0].robot.open_round();
    let opened = |event| match event {
        Event::Opened(round) if round.counter == 2 => Some(round),
        _ => None,
    };
    let round = robots[0].wait(PATIENCE, opened).await.expect("it opens");
    let vocabulary = Fixed::default().vocabulary().id();
    let (evidence, named) = (vec![-1.0, -1.0, 5.0, -1.0, -1.0, -1.0], vec![]);
    let vote = Vote { round, vocabulary, evidence, looks: 4.0, unknown: None, named };
    put(Topic::Vote(RobotId(3)), signed(3, 4, Message::Vote(vote.clone()))).await;
    put(to_one, signed(3, 5, give(&altered))).await;
    for robot in &robots {
        counted(robot, "convicted_3", 1).await;
    }
    let second = agreed(&mut robots, 2, PATIENCE).await;
    assert_eq!(second.class, decided.class);

    // Who was not there hears of it, and nothing it says counts anywhere.
    robots.push(start(sealed(4, &members, &locators), None).await);
    counted(&robots[3], "convicted_3", 1).await;
    for robot in &robots {
        let counters = robot.robot.status().counters;
        let convicted: Vec<_> = counters.keys().filter(|name| name.starts_with("convicted_")).collect();
        assert_eq!(convicted, ["convicted_3"], "and nobody whose decision it altered");
    }
    assert!(robots[0].sees_alive(3, PATIENCE).await);
    robots[0].robot.open_round();
    put(Topic::Vote(RobotId(3)), signed(3, 6, Message::Vote(vote))).await;
    let third = agreed(&mut robots, 3, PATIENCE).await;
    assert!(third.certificate.votes.iter().all(|counted| counted.robot != RobotId(3)), "{third:?}");
    liar.close().await.unwrap();
    for robot in robots {
        robot.stop().await;
    }
}
