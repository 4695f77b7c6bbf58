//! Robots that find each other by multicast, and one who answers their calls in the name of others.

use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use gestalt_link::{LinkConfig, RobotConfig, Scouting};
use gestalt_protocol::ClassId;
use gestalt_tests::{sealed, start, unique, with_eve};

use crate::siege::REFRACTORY;
use crate::trouble::counted;
use crate::wall::voters;

const PATIENCE: Duration = Duration::from_secs(30);

/// Answers a call for robots as one who is at that endpoint, in Zenoh's words: HELLO, version 9, a router with that id.
fn hello(id: u128, locator: &str) -> Vec<u8> {
    let mut bytes = vec![0x22, 9, 15 << 4];
    bytes.extend(id.to_le_bytes());
    bytes.extend([1, u8::try_from(locator.len()).unwrap()]);
    bytes.extend(locator.as_bytes());
    bytes
}

/// Answers every call in the name of all members, before and after they did: that they are where nobody says a word. How many answers it gave.
fn lie(group: Ipv4Addr, port: u16, ids: &[u128], nowhere: &str, on: &AtomicBool) -> u64 {
    let lo = Ipv4Addr::LOCALHOST;
    let socket = socket2::Socket::new(socket2::Domain::IPV4, socket2::Type::DGRAM, None).unwrap();
    socket.set_reuse_address(true).unwrap();
    socket.bind(&SocketAddr::from((group, port)).into()).unwrap();
    socket.join_multicast_v4(&group, &lo).unwrap();
    let socket = UdpSocket::from(socket);
    socket.set_read_timeout(Some(Duration::from_millis(100))).unwrap();
    let (mut given, mut call) = (0, [0; 1500]);
    while on.load(Ordering::Relaxed) {
        let Ok((_, caller)) = socket.recv_from(&mut call) else { continue };
        for late in [Duration::ZERO, Duration::from_millis(150)] {
            std::thread::sleep(late);
            for id in ids {
                given += u64::from(socket.send_to(&hello(*id, nowhere), caller).is_ok());
            }
        }
    }
    given
}

pub async fn robots_that_find_each_other_do_so_though_their_calls_are_answered_by_a_liar() {
    let members = with_eve(&unique("hello"), 3);
    let group = "239.255.77.78".parse().unwrap();
    let port = 20_000 + (std::process::id() % 20_000) as u16;
    // It takes connections, and says nothing.
    let silent = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let nowhere = format!("tls/{}", silent.local_addr().unwrap());
    let swarm = u128::from(crc32fast::hash(members.swarm.as_bytes()));
    // As robots name their sessions. Robots that are no members are said to be there too.
    let id = |nonce: u64, robot: u32| u128::from(nonce | 1 << 63) << 64 | swarm << 32 | u128::from(robot);
    let ids: Vec<u128> = (0..3).chain(1000..1100).map(|robot| id(1, robot)).collect();
    let on = Arc::new(AtomicBool::new(true));
    let liar = on.clone();
    let lying = std::thread::spawn(move || lie(group, port, &ids, &nowhere, &liar));
    let robot = |id: u32| {
        let scouting = Scouting { address: format!("{group}:{port}"), interface: "lo".to_owned() };
        let plain = sealed(id, &members, &[]);
        let link = LinkConfig { scouting: Some(scouting), ..plain.link };
        start(RobotConfig { link, ..plain }, Some(ClassId(4)))
    };
    // The first one is alone with the liar, and believes it.
    let mut robots = vec![robot(0).await];
    counted(&robots[0], "dial_failed", 2).await;
    let began = Instant::now();
    for id in 1..3 {
        robots.push(robot(id).await);
    }
    for robot in &robots {
        assert!(robot.sees_alive(2, PATIENCE).await, "{:?}", robot.robot.status());
    }
    let whole = began.elapsed();
    // On a busy machine a vote may come when the others have decided.
    let mut voted = Vec::new();
    for counter in 1..=4 {
        robots[0].robot.open_round();
        voted = voters(&mut robots, counter).await;
        if voted.iter().all(|voted| voted.len() == 3) {
            break;
        }
        tokio::time::sleep(REFRACTORY).await;
    }
    assert!(voted.iter().all(|voted| voted.len() == 3), "{voted:?}");
    on.store(false, Ordering::Relaxed);
    let given = lying.join().unwrap();
    let dials: Vec<_> =
        robots.iter().map(|it| it.robot.status().counters.get("dial_failed").copied()).collect();
    eprintln!("whole after {whole:?}; {given} lies, dials in vain: {dials:?}");
    for robot in robots {
        robot.stop().await;
    }
}
