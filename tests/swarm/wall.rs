//! The wall around a sealed swarm: who gets in, who does not, and who is put out.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

use gestalt_link::{Bearer, Certificate, Client, Credentials, LinkConfig, RobotConfig};
use gestalt_protocol::{ClassId, Gesture, Instruction, Keys, Outcome, RobotId, RoundId, Topic};
use gestalt_strategies::{MindConfig, Quorum};
use gestalt_tests::{Watched, agreed, by_tls, config, credentials, key, sealed, start, unique, with_eve};
use gestalt_trust::{Instructor, Membership, Role, Roles};
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use zenoh::Wait;
use zenoh::qos::CongestionControl;
use zenoh::sample::Locality;

use crate::page;
use crate::stranger::star;
use crate::trouble::{counted, invented};

const PATIENCE: Duration = Duration::from_secs(30);

/// How long after the word all robots must have acted on it.
const EXPULSION: Duration = Duration::from_secs(2);

/// How long a member may take to be linked, whoever else is at the door.
pub const LINKING: Duration = Duration::from_secs(5);

/// A robot that is reached by TLS alone.
fn walled(id: u32, members: &Membership, connect: &[String]) -> RobotConfig {
    let robot = sealed(id, members, connect);
    let listen = vec!["tls/127.0.0.1:0".to_owned()];
    // What is let in is timed by the lease.
    let lease = LinkConfig::default().lease;
    RobotConfig { link: LinkConfig { listen, lease, ..robot.link }, ..robot }
}

/// The zenoh configuration of a stranger in that mode, which will not wait for ever.
pub fn stranger(mode: &str, endpoint: &str, tls: Option<&Value>) -> zenoh::Config {
    let mut zenoh = zenoh::Config::default();
    let mut set = |key: &str, value: Value| zenoh.insert_json5(key, &value.to_string()).unwrap();
    set("mode", json!(mode));
    set("connect/endpoints", json!([endpoint]));
    set("connect/timeout_ms", json!(1500));
    set("connect/exit_on_failure", json!(false));
    set("listen/endpoints", json!([]));
    set("scouting/multicast/enabled", json!(false));
    if let Some(tls) = tls {
        set("transport/link/tls", tls.clone());
    }
    zenoh
}

/// Who is alive, who is linked, the round, and how many messages came.
type Standing = (Vec<RobotId>, Vec<RobotId>, Option<RoundId>, u64);

/// Where the swarm stands, as far as a stranger could move it.
fn standing(robots: &[Watched]) -> Vec<Standing> {
    let of = |robot: &Watched| {
        let status = robot.robot.status();
        let heard = |kind: &str| status.counters.get(kind).copied().unwrap_or_default();
        let received = heard("received_vote") + heard("received_decision") + heard("received_feedback");
        (status.alive, status.neighbours, status.round, received)
    };
    robots.iter().map(of).collect()
}

pub async fn a_stranger_in_any_mode_neither_reads_nor_changes_anything() {
    let swarm = unique("walled");
    let members = with_eve(&swarm, 3);
    let (mut robots, locators) = star(3, |id, connect| walled(id, &members, connect)).await;
    robots[0].robot.open_round();
    agreed(&mut robots, 1, PATIENCE).await;
    // All that is still under way arrives.
    tokio::time::sleep(Duration::from_secs(1)).await;
    let before = standing(&robots);

    // The authority's certificate is no secret: with it, a stranger finds the robots' true.
    let of_eve = credentials(&members, Bearer::Client("eve".parse().unwrap()), key(666)).tls();
    let nothing = json!({
        "root_ca_certificate_base64": of_eve["root_ca_certificate_base64"],
        "enable_mtls": false,
        "verify_name_on_connect": false,
    });
    // Robot 0 and eve by an authority of the stranger's own, with their names.
    let usurped = |holder: Bearer| {
        let mut usurper = members.clone();
        usurper.instructors.clear();
        usurper.robots.insert(RobotId(0), key(77).public_key());
        let roster = usurper.sign(&key(66)).unwrap();
        let certificate =
            Certificate::issue(&key(66), &swarm, holder.clone(), &key(77).public_key()).unwrap();
        let credentials = Credentials::new(&roster, holder, Arc::new(key(77)), certificate).unwrap();
        let mut tls = credentials.tls();
        tls["root_ca_certificate_base64"] = of_eve["root_ca_certificate_base64"].clone();
        tls
    };
    let robot = usurped(Bearer::Robot(RobotId(0)));
    let client = usurped(Bearer::Client("eve".parse().unwrap()));
    let plain = locators[0].replace("tls/", "tcp/");
    let keys = Keys::new(&swarm).unwrap();
    for mode in ["client", "peer", "router"] {
        for (endpoint, tls) in
            [(&locators[0], &nothing), (&locators[0], &robot), (&locators[0], &client), (&plain, &nothing)]
        {
            // A client that reaches nobody does not open; the others do, and are alone.
            let Ok(session) = zenoh::open(stranger(mode, endpoint, Some(tls))).await else { continue };
            let heard = session.declare_subscriber("**").allowed_origin(Locality::Remote).await.unwrap();
            let all = session
                .declare_subscriber(format!("gestalt/{swarm}/**"))
                .allowed_origin(Locality::Remote)
                .await
                .unwrap();
            let round = RoundId { counter: 2, opener: RobotId(0), life: 9 };
            let decision = serde_json::to_vec(&invented(round, RobotId(1), 1, 200)).unwrap();
            for topic in [Topic::Decision, Topic::Feedback("ada".parse().unwrap()), Topic::Vote(RobotId(1))] {
                let put = session.put(keys.key(&topic), decision.clone());
                put.congestion_control(CongestionControl::Drop).await.unwrap();
            }
            let open = serde_json::to_vec(&Instruction::Open).unwrap();
            session.put(keys.key(&Topic::Feedback("ada".parse().unwrap())), open).await.unwrap();
            let replies =
                session.get(keys.every_robot("status")).timeout(Duration::from_millis(500)).await.unwrap();
            let answered = replies.recv_async().await.is_ok_and(|reply| reply.result().is_ok());
            let mut routers = session.info().routers_zid().await;
            assert!(!answered && routers.next().is_none(), "{mode} {endpoint}");
            assert!(heard.try_recv().unwrap().is_none() && all.try_recv().unwrap().is_none(), "{mode}");
            session.close().await.unwrap();
        }
    }
    assert_eq!(standing(&robots), before, "nothing of all that changed anything");

    robots[0].robot.open_round();
    let second = agreed(&mut robots, 2, PATIENCE).await;
    assert_eq!((second.class, second.certificate.robots), (Some(ClassId(4)), 3), "{second:?}");
    for robot in robots {
        robot.stop().await;
    }
}

async fn client(swarm: &str, endpoint: &[String], credentials: Option<Credentials>) -> Client {
    let link = LinkConfig { connect: endpoint.to_vec(), credentials, ..LinkConfig::default() };
    Client::open(swarm, &link).await.expect("it is let in")
}

pub async fn clients_with_a_key_are_let_in_and_do_what_they_may_and_no_more() {
    let swarm = unique("clients");
    let mut members = with_eve(&swarm, 3);
    let ada = Instructor { key: key(90).public_key(), roles: Roles::up_to(Role::Teach) };
    members.instructors.insert("ada".parse().unwrap(), ada);
    members.local = Roles::up_to(Role::Open);
    let (mut robots, locators) = star(3, |id, connect| sealed(id, &members, connect)).await;
    let (tls, here) = (by_tls(&locators), vec![robots[0].robot.for_clients().unwrap().to_owned()]);
    let ada =
        client(&swarm, &tls, Some(credentials(&members, Bearer::Client("ada".parse().unwrap()), key(90))))
            .await;
    let eve =
        client(&swarm, &tls, Some(credentials(&members, Bearer::Client("eve".parse().unwrap()), key(666))))
            .await;
    let local = client(&swarm, &here, None).await;
    let mut heard = eve.decisions().await.unwrap();
    let name = |name: &str| name.parse().unwrap();
    // She says it in any name she likes, and it is said in her own.
    ada.instruct(&name("console"), &Instruction::Open).await.unwrap();
    let first = agreed(&mut robots, 1, PATIENCE).await;
    let told = tokio::time::timeout(PATIENCE, heard.next()).await.unwrap().unwrap().unwrap();
    assert_eq!((told.decision.round, told.decision.class), (first.round, Some(ClassId(4))));
    assert_eq!(eve.statuses(Duration::from_secs(2)).await.unwrap().len(), 3);

    // Eve may listen. Her words, and those of whoever is local beyond opening rounds, are answered and change nothing.
    let was = Instruction::Was { round: first.round, class: Gesture::Class(ClassId(3)) };
    let answer = eve.teach(&name("eve"), &was, PATIENCE).await.unwrap().expect("an answer");
    assert_eq!(answer.outcome, Outcome::NotAllowed);
    // Her page says so too, also of the word that has no answer but a refusal.
    let credentials = credentials(&members, Bearer::Client(name("eve")), key(666));
    let link = LinkConfig { connect: tls, credentials: Some(credentials), ..LinkConfig::default() };
    let desk = page::desk(&swarm, &link, 0).await;
    let told = page::Reader::open(&desk).await.say(&json!({"say": "open"})).await;
    assert_eq!(told["answer"]["outcome"], "not_allowed", "{told}");
    assert_eq!(told["words"], Outcome::NotAllowed.describe());
    desk.close().await;
    let answer = local.teach(&name("console"), &was, PATIENCE).await.unwrap().expect("an answer");
    assert_eq!(answer.outcome, Outcome::NotAllowed);
    // Without a key nobody speaks for one who has one, and hears that.
    let answer = local.teach(&name("ada"), &was, PATIENCE).await.unwrap().expect("an answer");
    assert_eq!(answer.outcome, Outcome::NotAllowed);
    counted(&robots[0], "refused_feedback_unsigned", 1).await;
    // They do not learn; her word is heeded as far as that.
    let answer = ada.teach(&name("ada"), &was, PATIENCE).await.unwrap().expect("an answer");
    assert_eq!(answer.outcome, Outcome::NotLearning);
    // Whoever is local opens rounds, through the robot.
    local.instruct(&name("console"), &Instruction::Open).await.unwrap();
    let second = agreed(&mut robots, 2, PATIENCE).await;
    assert_eq!(second.class, Some(ClassId(4)));
    counted(&robots[2], "received_word", 2).await;

    for client in [ada, eve, local] {
        client.close().await;
    }
    for robot in robots {
        robot.stop().await;
    }
}

/// The robots that each robot's decision of a round knows the votes of. Without a quorum each says for itself that there is none.
pub async fn voters(robots: &mut [Watched], counter: u32) -> Vec<Vec<u32>> {
    let mut voters = Vec::new();
    for robot in robots {
        let decision = robot.decision(counter, PATIENCE).await;
        let certificate = decision.unwrap_or_else(|| panic!("{:?}", robot.robot.status())).certificate;
        let voted = certificate.votes.iter().map(|counted| counted.robot.0);
        voters.push(voted.chain(certificate.others.iter().map(|held| held.robot.0)).collect());
    }
    voters
}

pub async fn who_is_expelled_counts_no_more_in_the_midst_of_a_round_and_comes_back_with_a_new_key() {
    let swarm = unique("expelled");
    let members = with_eve(&swarm, 4);
    // Five would be needed: a round is open until its deadline.
    let patient =
        MindConfig { quorum: Quorum::Evidence(5), deadline: Duration::from_secs(6), ..MindConfig::default() };
    let robot = |id: u32, members: &Membership, connect: &[String]| RobotConfig {
        mind: patient.clone(),
        ..sealed(id, members, connect)
    };
    let (mut robots, locators) = star(4, |id, connect| robot(id, &members, connect)).await;
    robots[0].robot.open_round();
    let first = voters(&mut robots, 1).await;
    assert!(first.iter().all(|voters| voters.contains(&3)), "{first:?}");

    robots[0].robot.open_round();
    tokio::time::sleep(Duration::from_millis(1500)).await;
    let thief = robots.pop().unwrap();
    assert!(robots[0].robot.open().is_some_and(|round| round.counter == 2));
    let mut next = members.clone();
    next.epoch = 2;
    next.expelled = [(RobotId(3), next.robots.remove(&RobotId(3)).unwrap())].into();
    let roster = next.clone().sign(&key(1000)).unwrap();
    let of_authority = Credentials::of_authority(Arc::new(key(1000)), &roster).unwrap();
    let authority = client(&swarm, &by_tls(&locators), Some(of_authority)).await;
    let began = Instant::now();
    authority.tell_roster(&roster).await.unwrap();
    for robot in &robots {
        loop {
            let status = robot.robot.status();
            let gone = |of: &[RobotId]| !of.contains(&RobotId(3));
            if status.counters["roster_epoch"] == 2 && gone(&status.alive) && gone(&status.neighbours) {
                break;
            }
            assert!(began.elapsed() < EXPULSION, "robot 3 is still there: {status:?}");
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }
    eprintln!("expelled everywhere after {:?}", began.elapsed());
    let second = voters(&mut robots, 2).await;
    assert_eq!(second, [[0, 1, 2]; 3]);
    // It knocks again and again.
    counted(&robots[0], "refused_link_not_enrolled", 3).await;
    robots[0].robot.open_round();
    let third = voters(&mut robots, 3).await;
    assert_eq!(third, [[0, 1, 2]; 3]);
    // Those who turn it away keep it waiting ever longer.
    let knocks = robots[0].robot.status().counters["refused_link_not_enrolled"];
    assert!(knocks < 40, "{knocks} knocks");

    // Enrolled anew while the thief still knocks.
    next.epoch = 3;
    next.robots.insert(RobotId(3), key(33).public_key());
    let roster = next.clone().sign(&key(1000)).unwrap();
    authority.tell_roster(&roster).await.unwrap();
    let seal = gestalt_link::Seal::issue(&key(1000), roster, RobotId(3), Arc::new(key(33))).unwrap();
    let anew = RobotConfig { seal: Some(seal), ..robot(3, &next, &locators) };
    robots.push(start(anew, Some(ClassId(4))).await);
    for robot in &robots {
        assert!(robot.sees_alive(3, PATIENCE).await);
    }
    robots[0].robot.open_round();
    let fourth = voters(&mut robots, 4).await;
    assert!(fourth.iter().all(|voters| voters.contains(&3)), "{fourth:?}");
    // Who starts with the roster of before is told of the newest by its neighbours.
    robots.remove(2).stop().await;
    let late = start(robot(2, &members, &locators), None).await;
    counted(&late, "roster_epoch", 3).await;
    authority.close().await;
    late.stop().await;
    thief.stop().await;
    for robot in robots {
        robot.stop().await;
    }
}

/// Opens so many sessions at once, more than there is room for, which come again when they are hung up; those that opened.
async fn crowd(number: usize, endpoint: &str, tls: Option<&Value>) -> Vec<zenoh::Session> {
    let mut opening = tokio::task::JoinSet::new();
    for _ in 0..number {
        // Opening blocks, also where it is awaited.
        let config = stranger("client", endpoint, tls);
        opening.spawn_blocking(move || zenoh::open(config).wait());
    }
    opening.join_all().await.into_iter().flatten().collect()
}

pub async fn who_opens_many_sessions_keeps_nobody_out() {
    let swarm = unique("crowded");
    let mut members = with_eve(&swarm, 3);
    let ada = Instructor { key: key(90).public_key(), roles: Roles::up_to(Role::Teach) };
    members.instructors.insert("ada".parse().unwrap(), ada);
    let (mut robots, locators) = star(2, |id, connect| sealed(id, &members, connect)).await;
    let (tls, here) = (by_tls(&locators), robots[0].robot.for_clients().unwrap().to_owned());
    let eve = credentials(&members, Bearer::Client("eve".parse().unwrap()), key(666)).tls();
    let (eves, locals) = tokio::join!(crowd(72, &tls[0], Some(&eve)), crowd(40, &here, None));
    counted(&robots[0], "refused_link_too_many", 72).await;

    // A robot that starts, an instructor, and whoever may put eve out.
    let began = Instant::now();
    robots.push(start(sealed(2, &members, &locators), Some(ClassId(4))).await);
    assert!(robots[2].sees_alive(2, PATIENCE).await, "{:?}", robots[0].robot.status());
    let roster = members.clone().sign(&key(1000)).unwrap();
    let of_authority = Credentials::of_authority(Arc::new(key(1000)), &roster).unwrap();
    let ada = credentials(&members, Bearer::Client("ada".parse().unwrap()), key(90));
    let (authority, ada) =
        tokio::join!(client(&swarm, &tls, Some(of_authority)), client(&swarm, &tls, Some(ada)));
    eprintln!(
        "{} + {} sessions opened; the others are in after {:?}",
        eves.len(),
        locals.len(),
        began.elapsed()
    );
    ada.instruct(&"ada".parse().unwrap(), &Instruction::Open).await.unwrap();
    agreed(&mut robots, 1, PATIENCE).await;
    members.epoch = 2;
    members.instructors.remove(&"eve".parse().unwrap());
    authority.tell_roster(&members.sign(&key(1000)).unwrap()).await.unwrap();
    counted(&robots[0], "roster_epoch", 2).await;
    for session in eves.into_iter().chain(locals) {
        session.close().await.unwrap();
    }
    ada.close().await;
    authority.close().await;
    for robot in robots {
        robot.stop().await;
    }
}

pub async fn an_open_robot_and_a_sealed_one_do_not_link() {
    let swarm = unique("two-kinds");
    let members = with_eve(&swarm, 2);
    let guarded = start(sealed(0, &members, &[]), None).await;
    let here = guarded.robot.for_clients().unwrap().to_owned();
    // By the one endpoint that needs no certificate.
    let open = start(config(1, &swarm, &[here]), None).await;
    counted(&guarded, "refused_link_plain", 3).await;
    assert!(!guarded.sees_alive(1, Duration::from_secs(2)).await);
    assert!(guarded.robot.status().neighbours.is_empty());
    // And the other way round it is not even tried.
    let mut dials = sealed(1, &members, &[]);
    dials.link.connect = open.robot.locators().to_vec();
    let refused = gestalt_link::Robot::start(dials).await.unwrap_err().to_string();
    assert!(refused.contains("tls/"), "{refused}");
    let far = LinkConfig { listen: vec!["tcp/0.0.0.0:0".to_owned()], ..config(2, &swarm, &[]).link };
    let refused = gestalt_link::Robot::start(RobotConfig { link: far, ..config(2, &swarm, &[]) }).await;
    assert!(refused.unwrap_err().to_string().contains("trust.insecure"));
    open.stop().await;
    guarded.stop().await;
}

/// Knocks twenty times a second with bytes that are no handshake, or begin one and leave it at that, until it is stopped.
async fn knock(address: String) {
    // The head of a TLS record that announces a ClientHello, which never comes.
    let begins = [0x16, 3, 1, 2, 0, 1];
    let mut held = VecDeque::new();
    for number in 0_u32.. {
        if let Ok(mut stream) = TcpStream::connect(&address).await {
            let junk = [number as u8 | 0x80; 64];
            let _ = stream.write_all(if number.is_multiple_of(2) { &begins } else { &junk }).await;
            held.push_back(stream);
        }
        if held.len() > 100 {
            held.pop_front();
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

pub async fn junk_at_the_door_keeps_no_member_out() {
    let swarm = unique("junk");
    let members = with_eve(&swarm, 3);
    let mut robots = vec![start(walled(0, &members, &[]), Some(ClassId(4))).await];
    let locators = robots[0].robot.locators().to_vec();
    robots.push(start(walled(1, &members, &locators), Some(ClassId(4))).await);
    let address = locators[0].trim_start_matches("tls/").to_owned();
    let knocking = tokio::spawn(knock(address.clone()));
    // And those who say nothing at all.
    let mut silent = Vec::new();
    for _ in 0..200 {
        silent.push(TcpStream::connect(&address).await.unwrap());
    }
    let began = Instant::now();
    robots.push(start(walled(2, &members, &locators), Some(ClassId(4))).await);
    for robot in &robots {
        assert!(
            robot.sees_alive(2, LINKING).await,
            "after {:?}: {:?}",
            began.elapsed(),
            robot.robot.status()
        );
    }
    eprintln!("linked after {:?}", began.elapsed());
    robots[0].robot.open_round();
    let decision = agreed(&mut robots, 1, PATIENCE).await;
    assert_eq!((decision.class, decision.certificate.robots), (Some(ClassId(4)), 3));
    // The robot holds none of its files for those who say nothing.
    for stream in &mut silent {
        let closed = tokio::time::timeout(PATIENCE, stream.read(&mut [0; 16])).await;
        assert!(!matches!(closed.expect("it is hung up on"), Ok(1..)));
    }
    knocking.abort();
    let _ = knocking.await;
    for robot in robots {
        robot.stop().await;
    }
}
