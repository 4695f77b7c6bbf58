//! A sealed swarm, and one who is no member of it.

use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::AtomicU8;
use std::time::Duration;

use gestalt_link::{Bearer, Client, LinkConfig, RobotConfig};
use gestalt_protocol::{
    Announcement, Ask, Batches, ClassId, Envelope, Gesture, Give, Have, HeldBatch, HeldVote, Holder,
    Instruction, Keys, Lesson, Lessons, Message, Outcome, Question, RobotId, RoundId, Stamp, Topic, Vote,
    Word,
};
use gestalt_strategies::Classify;
use gestalt_tests::{
    Fixed, Watched, agreed, by_tls, credentials, key, learning, sealed, short_rounds, start, start_learning,
    tag, unique, with_eve,
};
use gestalt_trials::Need;
use gestalt_trust::{Membership, statement};
use serde_json::Value;
use zenoh::qos::CongestionControl;

use crate::trouble::{announcing, counted, invented};

const PATIENCE: Duration = Duration::from_secs(30);

/// So many robots that are shown one gesture, each but the first linked to the first, once all know of all; and where the first is reached.
pub async fn star(n: u32, config: impl Fn(u32, &[String]) -> RobotConfig) -> (Vec<Watched>, Vec<String>) {
    let mut robots = vec![start(config(0, &[]), Some(ClassId(4))).await];
    let locators = robots[0].robot.locators().to_vec();
    for id in 1..n {
        robots.push(start(config(id, &locators), Some(ClassId(4))).await);
    }
    for robot in &robots {
        assert!(robot.sees_alive(n as usize - 1, PATIENCE).await);
    }
    (robots, locators)
}

/// A Zenoh client that is let in, as eve, and then says what it likes.
pub async fn enter(members: &Membership, locators: &[String]) -> zenoh::Session {
    let mut zenoh = zenoh::Config::default();
    zenoh.insert_json5("mode", "\"client\"").unwrap();
    zenoh.insert_json5("connect/endpoints", &serde_json::json!(by_tls(locators)).to_string()).unwrap();
    zenoh.insert_json5("scouting/multicast/enabled", "false").unwrap();
    let tls = credentials(members, Bearer::Client("eve".parse().unwrap()), key(666)).tls();
    zenoh.insert_json5("transport/link/tls", &tls.to_string()).unwrap();
    zenoh::open(zenoh).await.unwrap()
}

pub async fn one_who_is_no_member_changes_nothing_and_every_lie_is_named() {
    let swarm = unique("stranger");
    let members = with_eve(&swarm, 3);
    let mut robots = vec![start(sealed(0, &members, &[]), Some(ClassId(4))).await];
    let locators = robots[0].robot.locators().to_vec();
    robots.push(start(sealed(1, &members, &locators), Some(ClassId(4))).await);
    robots.push(start(sealed(2, &members, &locators), None).await);
    for robot in &robots {
        assert!(robot.sees_alive(2, PATIENCE).await && robot.robot.status().sealed);
    }
    robots[1].robot.open_round();
    let first = agreed(&mut robots, 1, PATIENCE).await;
    let signed = first.certificate.votes.iter().all(|counted| counted.signature.is_some());
    assert!(signed && first.certificate.reached() == 3, "{first:?}");

    let liar = enter(&members, &locators).await;
    let keys = Keys::new(&swarm).unwrap();
    let vocabulary = Fixed::default().vocabulary().id();
    let put = async |topic: Topic, bytes: Vec<u8>| {
        // All of it arrives.
        let put = liar.put(keys.key(&topic), bytes).congestion_control(CongestionControl::Block);
        put.await.unwrap();
    };
    let vote = |counter: u32, robot: u32| {
        let round = RoundId { counter, opener: RobotId(0), life: 9 };
        let vote = Vote {
            round,
            vocabulary,
            evidence: vec![-1.0, 5.0, -1.0, -1.0, -1.0, -1.0],
            looks: 16.0,
            unknown: None,
            named: vec![],
        };
        let (author, stamp) = (RobotId(robot), Stamp { boot: u32::MAX, sequence: counter });
        Envelope { author, stamp, message: Message::Vote(vote), signature: None }
    };
    // Votes of all robots, in a round of the stranger's own: unsigned, and signed by a key that is nobody's.
    let stranger = key(77);
    let swarm_id = members.clone().sign(&key(1000)).unwrap().swarm_id();
    for robot in 0..3 {
        let unsigned = vote(2, robot);
        let signature = Some(statement::sign(&stranger, &swarm_id, &unsigned.statement()));
        put(Topic::Vote(RobotId(robot)), unsigned.encode()).await;
        put(Topic::Vote(RobotId(robot)), Envelope { signature, ..unsigned }.encode()).await;
    }
    // A robot that does not exist, with that key.
    let ghost = vote(2, 50);
    let signature = Some(statement::sign(&stranger, &swarm_id, &ghost.statement()));
    put(Topic::Vote(RobotId(50)), Envelope { signature, ..ghost }.encode()).await;
    // A decision by two hundred invented votes: announced, and given as a neighbour gives.
    let round = RoundId { counter: 2, opener: RobotId(0), life: 9 };
    let decision = invented(round, RobotId(1), 1, 200);
    let announced = announcing(RobotId(1), decision.clone());
    let statement = Envelope::from(announced.clone()).statement();
    let signature = Some(statement::sign(&stranger, &swarm_id, &statement));
    for announced in [announced.clone(), Announcement { signature, ..announced }] {
        put(Topic::Decision, serde_json::to_vec(&announced).unwrap()).await;
    }
    // A question in the name of a robot: unsigned, and by a key that is nobody's.
    let ask = Ask::Between { classes: [ClassId(4), ClassId(2)] };
    let (robot, stamp) = (RobotId(1), Stamp { boot: u32::MAX, sequence: 2 });
    let question = Question {
        round,
        ask,
        labels: vec![],
        entropy: 0.5,
        disagreement: 0.5,
        robot,
        stamp,
        signature: None,
    };
    let statement = Envelope::from(question.clone()).statement();
    let signature = Some(statement::sign(&stranger, &swarm_id, &statement));
    for question in [question.clone(), Question { signature, ..question }] {
        put(Topic::Question, serde_json::to_vec(&question).unwrap()).await;
    }
    let held = |robot| {
        let Envelope { author, stamp, message: Message::Vote(vote), signature } = vote(2, robot) else {
            unreachable!()
        };
        HeldVote { robot: author, stamp, vote, signature }
    };
    let said = |sequence, message| {
        Envelope { author: RobotId(1), stamp: Stamp { boot: u32::MAX, sequence }, message, signature: None }
            .encode()
    };
    let holding = decision.holding(false);
    let holder = Holder {
        robot: RobotId(2),
        stamp: Stamp { boot: u32::MAX, sequence: 1 },
        holding: holding.clone(),
        signature: None,
    };
    let votes = (0..3).map(held).collect();
    let give = Give { decision: Some(decision.clone()), votes, holders: vec![holder] };
    put(Topic::Repair(RobotId(0)), said(1, Message::Give(give))).await;
    // Counters that would be used up: as votes, and as what a neighbour says it has.
    for step in 0..4400 {
        let counter = 1_000_000_u32.saturating_mul(step + 1);
        put(Topic::Vote(RobotId(1)), vote(counter, 1).encode()).await;
        let round = Some(RoundId { counter, opener: RobotId(0), life: 9 });
        let have = Have { round, decision: None, holders: 0, votes: vec![], knowledge: None, answer: true };
        put(Topic::Repair(RobotId(0)), said(2 + step, Message::Have(have))).await;
    }
    // That a robot holds it is not its own word.
    put(Topic::RobotDecision(RobotId(1)), said(9000, Message::Holding(holding))).await;
    for (counter, least) in [
        ("refused_vote_unsigned", 4403),
        ("refused_vote_forged", 2),
        ("refused_vote_stranger", 1),
        ("refused_decision_unsigned", 1),
        ("refused_decision_forged", 1),
        ("refused_question_unsigned", 1),
        ("refused_question_forged", 1),
        ("refused_robot_decision_unsigned", 1),
        ("refused_repair_unsigned", 1),
    ] {
        counted(&robots[0], counter, least).await;
    }
    robots[1].robot.open_round();
    let second = agreed(&mut robots, 2, PATIENCE).await;
    assert_eq!((second.round.counter, second.round.life), (2, first.round.life), "{second:?}");
    assert_eq!((second.class, second.certificate.robots), (Some(ClassId(4)), 3), "{second:?}");
    liar.close().await.unwrap();
    for robot in robots {
        robot.stop().await;
    }
}

pub async fn what_its_robots_learn_is_said_by_its_members_and_passed_on_as_they_said_it() {
    let swarm = unique("sealed-school");
    let members = with_eve(&swarm, 4);
    let shown = Arc::new(AtomicU8::new(3));
    let pupil = |id, connect: &[String]| {
        let learning = Some(learning(2, 1.0, None));
        start_learning(
            RobotConfig { mind: short_rounds(), learning, ..sealed(id, &members, connect) },
            shown.clone(),
        )
    };
    let mut robots = vec![pupil(0, &[]).await];
    let locators = robots[0].robot.locators().to_vec();
    robots.push(pupil(1, &locators).await);
    robots.push(pupil(2, &locators).await);
    for robot in &robots {
        assert!(robot.sees_alive(2, PATIENCE).await);
    }
    let keys = Keys::new(&swarm).unwrap();
    let liar = enter(&members, &locators).await;
    let heard = liar.declare_subscriber(keys.key(&Topic::Sample(RobotId(1)))).await.unwrap();
    let here = robots[0].robot.for_clients().unwrap().to_owned();
    let link = LinkConfig { connect: vec![here], ..LinkConfig::default() };
    let client = Client::open(&swarm, &link).await.unwrap();
    let ada = "ada".parse().unwrap();
    client.instruct(&ada, &Instruction::Open).await.unwrap();
    let round = agreed(&mut robots, 1, PATIENCE).await.round;
    let was = Instruction::Was { round, class: Gesture::Class(ClassId(3)) };
    assert_eq!(
        client.teach(&ada, &was, PATIENCE).await.unwrap().expect("an answer").outcome,
        Outcome::Learned
    );
    // Two samples of each.
    let knows = async |robot: &Watched, samples: [usize; 2]| {
        let deadline = tokio::time::Instant::now() + PATIENCE;
        loop {
            let learned = robot.robot.status().learning.expect("it learns");
            let held = [&learned.shared, &learned.external].map(|of| (of.iter().sum(), of[3]));
            if held == samples.map(|all: usize| (all, all)) {
                return learned.common;
            }
            assert!(tokio::time::Instant::now() < deadline, "{samples:?}, and they are threes: {learned:?}");
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    };
    let common = knows(&robots[0], [2, 4]).await;
    let true_batch =
        tokio::time::timeout(PATIENCE, heard.recv_async()).await.expect("robot 1 shares").unwrap();
    let true_batch = Envelope::decode(&true_batch.payload().to_bytes()).unwrap();
    let Message::Samples(samples) = true_batch.message.clone() else { panic!("{true_batch:?}") };

    let put = async |topic: Topic, envelope: Envelope| {
        let bytes = envelope.encode();
        // Of what it says to one robot alone it makes up nothing but what it passes on: it has the key of robot 3.
        let tag = matches!(topic, Topic::Repair(_)).then(|| tag(3, 0, &members, &bytes));
        let put = liar.put(keys.key(&topic), bytes).congestion_control(CongestionControl::Block);
        put.attachment(tag).await.unwrap();
    };
    let of_another_class = |by: u32| {
        let mut samples = samples.clone();
        samples.samples.iter_mut().for_each(|sample| {
            sample.class = ClassId(5);
            sample.id.number += by;
        });
        samples
    };
    let said = |author, sequence, message| {
        let stamp = Stamp { boot: u32::MAX, sequence };
        Envelope { author: RobotId(author), stamp, message, signature: None }
    };
    let give = |sequence, samples, signature| {
        let held = HeldBatch { robot: RobotId(1), stamp: true_batch.stamp, samples, signature };
        said(3, sequence, Message::Batches(Batches { batches: vec![held] }))
    };
    // The next ones in its name, its own under another label, and what nobody said.
    put(Topic::Sample(RobotId(1)), said(1, 1, Message::Samples(of_another_class(100)))).await;
    put(Topic::Repair(RobotId(0)), give(1, of_another_class(200), None)).await;
    put(Topic::Repair(RobotId(0)), give(2, of_another_class(0), true_batch.signature)).await;
    let word = |count, word| Lesson { round, instructor: ada.clone(), count, at: u64::MAX, word, said: None };
    let lessons = vec![word(2, Word::Was(ClassId(5))), word(3, Word::Retracted)];
    put(Topic::Repair(RobotId(0)), said(3, 3, Message::Lessons(Lessons { lessons }))).await;
    // What is true is true whoever says it, and nothing new.
    let again = give(4, samples.clone(), true_batch.signature);
    put(Topic::Repair(RobotId(0)), again.clone()).await;
    put(Topic::Repair(RobotId(0)), again).await;
    // And in the name of a robot whose key it has not.
    let as_another = said(1, 5, Message::Give(Give { decision: None, votes: vec![], holders: vec![] }));
    put(Topic::Repair(RobotId(0)), as_another).await;
    for (counter, least) in [
        ("refused_sample_unsigned", 1),
        ("refused_repair_unsigned", 2),
        ("refused_repair_forged", 2),
        ("refused_repair_repeated", 1),
    ] {
        counted(&robots[0], counter, least).await;
    }
    assert_eq!(knows(&robots[0], [2, 4]).await, common);

    // Robot 1 is gone; who comes late has its samples from others, under its signature, and what ada said, under that of the robot she said it at.
    robots.remove(1).stop().await;
    let late = pupil(3, &locators).await;
    assert_eq!(knows(&late, [0, 6]).await, common);
    let deadline = tokio::time::Instant::now() + PATIENCE;
    while late.robot.status().learning.expect("it learns").lessons != 1 {
        assert!(tokio::time::Instant::now() < deadline, "{:?}", late.robot.status());
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    assert!(!late.robot.status().counters.contains_key("refused_lesson_unproven"));
    client.close().await;
    liar.close().await.unwrap();
    late.stop().await;
    for robot in robots {
        robot.stop().await;
    }
}

pub fn a_decision_is_proven_by_two_programs_and_no_other_is() {
    let folder = tempfile::tempdir().unwrap();
    let keys = folder.path().join("keys");
    let gestalt = |words: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_test-gestalt"));
        command.args(words).stderr(Stdio::piped()).output().expect("gestalt runs")
    };
    let folder_of_keys = keys.to_str().unwrap();
    let ran =
        gestalt(&["swarm", "--robots", "footbot:3", "--rounds", "1", "--json", "--keys", folder_of_keys]);
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    let lines = String::from_utf8(ran.stdout).unwrap();
    let told = lines.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    let decision =
        told.filter(|told| told["event"] == "decision").map(|told| told["decision"].clone()).next();
    let decision = decision.expect("a decision");
    let roster = keys.join("roster.json");
    let (file, roster) = (folder.path().join("decision.json"), roster.to_str().unwrap());
    let python = gestalt_trials::python(Need::CRYPTOGRAPHY).expect("what the trial needs");
    let verdicts = |decision: &Value, robots: &str| {
        std::fs::write(&file, decision.to_string()).unwrap();
        let file = file.to_str().unwrap();
        let by_rust = gestalt(&["verify", file, "--roster", roster, "--robots", robots]);
        let program = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/verify.py");
        let words = [file, "--roster", roster, "--robots", robots];
        let by_python = Command::new(&python).arg(program).args(words).output().unwrap();
        [by_rust, by_python]
            .map(|ran| (ran.status.success(), String::from_utf8_lossy(&ran.stderr).into_owned()))
    };
    for (robots, enough) in [("1", true), ("3", true), ("20", false)] {
        for (proven, why) in verdicts(&decision, robots) {
            assert_eq!(proven, enough, "of {robots}: {why}: {decision}");
        }
    }
    let forgeries: [&dyn Fn(&mut Value); 16] = [
        &|d| d["class"] = ((d["class"].as_u64().unwrap() + 1) % 6).into(),
        &|d| d["confidence"] = 0.96.into(),
        &|d| d["certificate"]["votes"][0]["vote"]["evidence"][0] = 1.25.into(),
        &|d| d["certificate"]["votes"][0]["vote"]["looks"] = 15.0.into(),
        &|d| d["certificate"]["votes"][1]["stamp"]["sequence"] = 1_000_000.into(),
        &|d| d["certificate"]["votes"][1]["vote"]["round"]["life"] = 5.into(),
        &|d| d["certificate"]["votes"][0]["signature"] = d["certificate"]["votes"][1]["signature"].clone(),
        &|d| d["certificate"]["robots"] = 20.into(),
        // What no vote covers is its announcer's word.
        &|d| d["final"] = (!d["final"].as_bool().unwrap()).into(),
        &|d| d["author"] = 9.into(),
        &|d| d["round"]["opener"] = 9.into(),
        &|d| d["certificate"]["elapsed_ms"] = 1.into(),
        &|d| d["class"] = Value::Null,
        &|d| d["label"] = "stop".into(),
        &|d| d["announcer"] = 9.into(),
        &|d| d["signature"] = Value::Null,
    ];
    for (n, forge) in forgeries.iter().enumerate() {
        let mut forged = decision.clone();
        forge(&mut forged);
        for (proven, why) in verdicts(&forged, "1") {
            assert!(!proven && !why.contains("Traceback"), "forgery {n} is taken for a decision: {why}");
        }
    }
}
