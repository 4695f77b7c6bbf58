//! A robot of a sealed swarm, and a member that votes and asks.

use gestalt_protocol::{
    Announcement, ClassId, Envelope, Gesture, Instruction, InstructorId, Keys, Message, Outcome, RoundId,
    Stamp, Topic, VocabularyId, Vote, decode_json,
};
use gestalt_strategies::is_refuted;
use gestalt_trust::{
    Distrust, Identity, Instructor, Judge, Membership, Roles, Roster, Speaker, WordHeading, statement, word,
};
use zenoh::Session;

use super::*;
use crate::tls::{Bearer, Certificate, Credentials};
use crate::words::next_count;
use crate::{Client, GuestConfig, LinkConfig, Seal};

fn key(number: u8) -> Identity {
    Identity::from_bytes(&[number; 32])
}

fn roster(swarm: &str) -> Roster {
    let robots = (0..2).map(|robot| (RobotId(robot.into()), key(robot + 1).public_key())).collect();
    let members = Membership { swarm: swarm.to_owned(), epoch: 1, robots, ..Membership::default() };
    members.sign(&key(100)).unwrap()
}

/// A session of robot 0, which is nothing but a session.
async fn session(swarm: &str, roster: &Roster, to: &Robot) -> Session {
    let bearer = Bearer::Robot(RobotId(0));
    let certificate = Certificate::issue(&key(100), swarm, bearer.clone(), &key(1).public_key()).unwrap();
    let credentials = Credentials::new(roster, bearer, Arc::new(key(1)), certificate).unwrap();
    let connect = to.locators().to_vec();
    let link = LinkConfig { connect, credentials: Some(credentials), ..LinkConfig::default() };
    zenoh::open(link.client().unwrap()).await.unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn what_a_robot_holds_it_signs_for_whoever_asks() {
    let swarm = unique();
    let roster = roster(&swarm);
    let seal = Seal::issue(&key(100), roster.clone(), RobotId(1), Arc::new(key(2))).unwrap();
    let config = config(1, &swarm, &[]);
    let link = LinkConfig { listen: vec!["tls/127.0.0.1:0".to_owned()], ..config.link };
    let robot = Robot::start(RobotConfig { link, seal: Some(seal), ..config }).await.unwrap();
    let mut events = robot.events();
    let member = session(&swarm, &roster, &robot).await;
    let keys = Keys::new(&swarm).unwrap();
    let vote = Vote {
        round: RoundId { counter: 1, opener: RobotId(0), life: 0 },
        vocabulary: VocabularyId(1),
        evidence: vec![6.0, -6.0],
        looks: 3.0,
        unknown: None,
        named: vec![],
    };
    let said = Envelope {
        author: RobotId(0),
        stamp: Stamp { boot: 1, sequence: 1 },
        message: Message::Vote(vote),
        signature: None,
    };
    let signature = Some(statement::sign(&key(1), &roster.swarm_id(), &said.statement()));
    let vote = Envelope { signature, ..said }.encode();
    let end = Instant::now() + PATIENCE;
    let held = loop {
        assert!(Instant::now() < end, "it decides nothing: {:#?}", robot.status());
        member.put(keys.key(&Topic::Vote(RobotId(0))), vote.as_slice()).await.unwrap();
        match timeout(Duration::from_millis(200), events.recv()).await {
            Ok(Ok(Event::Held(held))) => break held,
            _ => continue,
        }
    };
    let announcement = loop {
        assert!(Instant::now() < end, "it does not answer: {:#?}", robot.status());
        let replies = member.get(keys.key(&Topic::Decision)).await.unwrap();
        let Ok(reply) = replies.recv_async().await else { continue };
        break decode_json::<Announcement>(&reply.result().unwrap().payload().to_bytes()).unwrap();
    };
    assert_eq!((announcement.announcer, announcement.decision.class), (RobotId(1), held.class));
    // Signed as it stands there, and so are the votes in it.
    let mut judge = Judge::new(roster, is_refuted);
    assert_eq!(judge.announcement(Duration::ZERO, &announcement), Ok(()));
    let other = Announcement { label: Some("another".to_owned()), ..announcement };
    assert_eq!(judge.announcement(Duration::ZERO, &other), Err(Distrust::Forged));
    member.close().await.unwrap();
    robot.stop().await;
}

/// Ada may say nothing, and is answered that as long as she is heard.
#[tokio::test(flavor = "multi_thread")]
async fn a_clock_that_was_set_back_silences_no_client() {
    let (swarm, folder) = (unique(), tempfile::tempdir().unwrap());
    let ada: InstructorId = "ada".parse().unwrap();
    let (of_ada, holder) = (key(90).public_key(), Bearer::Client(ada.clone()));
    let instructors = [(ada.clone(), Instructor { key: of_ada, roles: Roles::NONE })].into();
    let members = Membership { instructors, ..roster(&swarm).members().clone() };
    let roster = members.sign(&key(100)).unwrap();
    let seal = Seal::issue(&key(100), roster.clone(), RobotId(1), Arc::new(key(2))).unwrap();
    let config = config(1, &swarm, &[]);
    let link = LinkConfig { listen: vec!["tls/127.0.0.1:0".to_owned()], ..config.link };
    let robot = Robot::start(RobotConfig { link, seal: Some(seal), ..config }).await.unwrap();
    // Her word of an hour from now, as another program of hers said it by the clock of then.
    let member = session(&swarm, &roster, &robot).await;
    let open = serde_json::to_string(&Instruction::Open).unwrap();
    let heading = WordHeading { speaker: Speaker::Own(ada.clone()), count: next_count(0) + (3600 << 32) };
    let signed = word::sign(&key(90), &roster.swarm_id(), &ada, &heading, open.as_bytes());
    let of_words = Keys::new(&swarm).unwrap().key(&Topic::Word(ada.clone()));
    let end = Instant::now() + PATIENCE;
    while !robot.status().counters.contains_key("received_word") {
        assert!(Instant::now() < end, "it is not heard: {:#?}", robot.status());
        member.put(&of_words, open.clone()).attachment(signed.clone()).await.unwrap();
        sleep(Duration::from_millis(200)).await;
    }
    let words = folder.path().join("client-ada.words");
    std::fs::write(&words, heading.count.to_string()).unwrap();
    let certificate = Certificate::issue(&key(100), &swarm, holder.clone(), &of_ada).unwrap();
    let credentials = Credentials::new(&roster, holder, Arc::new(key(90)), certificate).unwrap();
    for counter in 1..=2 {
        let credentials = Some(credentials.clone().counting_in(words.clone()));
        let connect = robot.locators().to_vec();
        let link = LinkConfig { connect, credentials, ..LinkConfig::default() };
        let client = Client::open(&swarm, &link).await.unwrap();
        let round = RoundId { counter, opener: RobotId(1), life: 0 };
        let was = Instruction::Was { round, class: Gesture::Class(ClassId(0)) };
        let answer = client.teach(&ada, &was, PATIENCE).await.unwrap().expect("an answer");
        assert_eq!(answer.outcome, Outcome::NotAllowed);
        client.close().await;
    }
    member.close().await.unwrap();
    robot.stop().await;
}

/// Robots 1 and 7, of which the second has that key, if it is a member.
fn with_guest(swarm: &str, epoch: u64, guest: Option<u8>) -> Roster {
    let of_guest = guest.map(|guest| (RobotId(7), key(guest).public_key()));
    let robots = [(RobotId(0), key(1).public_key()), (RobotId(1), key(2).public_key())];
    let robots = robots.into_iter().chain(of_guest).collect();
    let members = Membership { swarm: swarm.to_owned(), epoch, robots, ..Membership::default() };
    members.sign(&key(100)).unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn a_guest_that_is_expelled_or_has_another_key_counts_no_more() {
    for after in [None, Some(9)] {
        let swarm = unique();
        let roster = with_guest(&swarm, 1, Some(8));
        let seal = Seal::issue(&key(100), roster.clone(), RobotId(1), Arc::new(key(2))).unwrap();
        let config = config(1, &swarm, &[]);
        let link = LinkConfig { listen: vec!["tls/127.0.0.1:0".to_owned()], ..config.link };
        let host = start(RobotConfig { link, seal: Some(seal), ..config }).await;
        // The round waits for what the host sees.
        host.looking.abort();
        let with_key = |number| GuestConfig {
            id: RobotId(7),
            name: "guest".to_owned(),
            boot: 1,
            identity: Some(Arc::new(key(number))),
        };
        let guest = host.robot.guest(with_key(8)).await.unwrap();
        guest.learned(Arc::new(Fixed::default()), "fixed");
        host.status("it is there", |status| status.alive.contains(&RobotId(7))).await;
        host.robot.open_round();
        let end = Instant::now() + PATIENCE;
        while guest.open().is_none() {
            assert!(Instant::now() < end, "no round: {:#?}", guest.status());
            sleep(Duration::from_millis(10)).await;
        }
        // It votes, and says so again every second.
        guest.observe(look());
        sleep(Duration::from_millis(500)).await;
        assert!(guest.is_enrolled());
        let authority = session(&swarm, &roster, &host.robot).await;
        let next = with_guest(&swarm, 2, after).to_json();
        let end = Instant::now() + PATIENCE;
        while host.robot.status().alive.contains(&RobotId(7)) {
            assert!(Instant::now() < end, "it is still there: {:#?}", host.robot.status());
            // What is said before the link carries anything is lost.
            authority.put(Keys::new(&swarm).unwrap().key(&Topic::Roster), next.clone()).await.unwrap();
            sleep(Duration::from_millis(200)).await;
        }
        assert!(!guest.is_enrolled());
        assert!(host.robot.guest(with_key(8)).await.is_err(), "it comes back");
        sleep(Duration::from_millis(1500)).await;
        let mut events = host.robot.events();
        let end = Instant::now() + PATIENCE;
        let held = loop {
            assert!(Instant::now() < end, "it decides nothing: {:#?}", host.robot.status());
            host.robot.observe(look());
            match timeout(Duration::from_millis(100), events.recv()).await {
                Ok(Ok(Event::Held(held))) => break held,
                _ => continue,
            }
        };
        let certificate = &held.certificate;
        let counted = certificate.votes.iter().map(|vote| vote.robot);
        let counted: Vec<_> = counted.chain(certificate.others.iter().map(|vote| vote.robot)).collect();
        assert_eq!(counted, [RobotId(1)]);
        let by_roster = host.robot.guest(with_key(9)).await;
        assert_eq!(by_roster.is_ok(), after == Some(9), "it comes with its new key: {by_roster:?}");
        drop(by_roster);
        drop(guest);
        authority.close().await.unwrap();
        host.stop().await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn a_disk_that_hangs_keeps_no_neighbour_from_a_newer_roster() {
    let (swarm, folder) = (unique(), tempfile::tempdir().unwrap());
    // Whoever reads it waits until somebody writes.
    let pipe = folder.path().join("roster.json");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let roster = with_guest(&swarm, 1, Some(8));
    let sealed = |id: u32, identity: u8, connect: &[String], file| {
        let seal = Seal::issue(&key(100), roster.clone(), RobotId(id), Arc::new(key(identity))).unwrap();
        let seal = Some(Seal { roster_file: file, ..seal });
        let config = config(id, &swarm, connect);
        let link = LinkConfig { listen: vec!["tls/127.0.0.1:0".to_owned()], ..config.link };
        start(RobotConfig { link, seal, ..config })
    };
    let hanging = sealed(1, 2, &[], Some(pipe.clone())).await;
    let neighbour = sealed(7, 8, hanging.robot.locators(), None).await;
    neighbour.status("it is linked", |status| status.alive.contains(&RobotId(1))).await;
    let authority = session(&swarm, &roster, &hanging.robot).await;
    let (to_one, next) =
        (Keys::new(&swarm).unwrap().key(&Topic::RosterFor(RobotId(1))), with_guest(&swarm, 2, Some(8)));
    let epoch = |watched: &Watched| watched.robot.status().counters.get("roster_epoch").copied();
    let end = Instant::now() + PATIENCE;
    while epoch(&neighbour) != Some(2) {
        assert!(Instant::now() < end, "it is not told: {:?} goes by it", epoch(&hanging));
        authority.put(&to_one, next.to_json()).await.unwrap();
        sleep(Duration::from_millis(200)).await;
    }
    // The reader goes on, and finds nothing.
    std::fs::OpenOptions::new().read(true).write(true).open(&pipe).unwrap();
    authority.close().await.unwrap();
    neighbour.stop().await;
    hanging.stop().await;
}
