//! Robots that find each other by multicast, and one who answers their calls in the name of others.

use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use gestalt_link::{Bearer, Client, Credentials, LinkConfig, RobotConfig, Scouting};
use gestalt_protocol::ClassId;
use gestalt_tests::{by_tls, config, credentials, key, sealed, start, unique, with_eve};
use gestalt_trust::{Instructor, Membership, Role, Roles};
use serde_json::{Value, json};

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

/// A router of somebody's that answers every call, as all do, and asks nobody for anything.
async fn router(protocol: &str, scouting: &Scouting, tls: Option<&Value>) -> (zenoh::Session, String) {
    let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let listen = format!("{protocol}/{free}");
    let mut zenoh = zenoh::Config::default();
    let mut set = |key: &str, value: Value| zenoh.insert_json5(key, &value.to_string()).unwrap();
    set("mode", json!("router"));
    set("listen/endpoints", json!([listen]));
    set("scouting/multicast/address", json!(scouting.address));
    set("scouting/multicast/interface", json!(scouting.interface));
    // It hangs on nobody else's.
    set("scouting/multicast/autoconnect", json!([]));
    if let Some(tls) = tls {
        set("transport/link/tls", tls.clone());
    }
    (zenoh::open(zenoh).await.unwrap(), listen)
}

async fn attached(members: &Membership, ada: &Credentials, link: LinkConfig) -> Result<Option<u32>, String> {
    let link = LinkConfig { credentials: Some(ada.clone()), ..link };
    let client = Client::open(&members.swarm, &link).await.map_err(|error| error.to_string())?;
    let robot = client.attached().await.map(|robot| robot.0);
    client.close().await;
    Ok(robot)
}

pub async fn a_client_of_a_sealed_swarm_attaches_to_its_robots_and_to_no_one_else() {
    let mut members = with_eve(&unique("attached"), 2);
    let teaches = Instructor { key: key(90).public_key(), roles: Roles::up_to(Role::Teach) };
    members.instructors.insert("ada".parse().unwrap(), teaches);
    let ada = credentials(&members, Bearer::Client("ada".parse().unwrap()), key(90));
    let eve = credentials(&members, Bearer::Client("eve".parse().unwrap()), key(666)).tls();
    let port = 20_000 + (std::process::id() % 20_000) as u16;
    let scouting = Scouting { address: format!("239.255.77.79:{port}"), interface: "lo".to_owned() };
    let (open, at) = router("tcp", &scouting, None).await;
    let (of_eve, at_eve) = router("tls", &scouting, Some(&eve)).await;
    let looks = || LinkConfig { scouting: Some(scouting.clone()), ..LinkConfig::default() };
    let names = |connect: &[String]| LinkConfig { connect: connect.to_vec(), ..LinkConfig::default() };

    // They answer, and nobody else does.
    let alone = attached(&members, &ada, looks()).await;
    assert!(alone.as_ref().is_err_and(|error| error.contains("none answers")), "{alone:?}");
    let named = attached(&members, &ada, names(std::slice::from_ref(&at_eve))).await;
    assert!(named.as_ref().is_err_and(|error| error.contains("relay for others")), "{named:?}");
    let far = attached(&members, &ada, names(&["tcp/192.0.2.1:7447".to_owned()])).await;
    assert!(far.as_ref().is_err_and(|error| error.contains("tls/ endpoint")), "{far:?}");

    let robot = sealed(1, &members, &[]);
    let link = LinkConfig { scouting: Some(scouting.clone()), ..robot.link };
    let robot = start(RobotConfig { link, ..robot }, Some(ClassId(4))).await;
    for _ in 0..3 {
        assert_eq!(attached(&members, &ada, looks()).await, Ok(Some(1)));
    }
    assert_eq!(attached(&members, &ada, names(&by_tls(robot.robot.locators()))).await, Ok(Some(1)));
    let here = robot.robot.for_clients().unwrap().to_owned();
    assert_eq!(attached(&members, &ada, names(&[here])).await, Ok(Some(1)));
    // Her roster is of a time when that robot had another key.
    let mut before = members.clone();
    before.robots.insert(gestalt_protocol::RobotId(1), key(11).public_key());
    let ada = credentials(&before, Bearer::Client("ada".parse().unwrap()), key(90));
    let other = attached(&before, &ada, names(&by_tls(robot.robot.locators()))).await;
    assert!(other.as_ref().is_err_and(|error| error.contains("newest roster")), "{other:?}");
    eprintln!("strangers at {at} and {at_eve}: {alone:?}, {named:?}, {far:?}, {other:?}");
    open.close().await.unwrap();
    of_eve.close().await.unwrap();
    robot.stop().await;
}

pub async fn a_client_attaches_to_its_own_swarm_and_comes_back_to_it() {
    let port = 20_000 + (std::process::id() % 20_000) as u16;
    let scouting = Scouting { address: format!("239.255.77.80:{port}"), interface: "lo".to_owned() };
    let looks = LinkConfig { scouting: Some(scouting.clone()), ..LinkConfig::default() };
    let (swarm, other) = (unique("own"), unique("other"));
    let robot = |id: u32, swarm: &str| {
        let plain = config(id, swarm, &[]);
        let link = LinkConfig { scouting: Some(scouting.clone()), ..plain.link };
        start(RobotConfig { link, ..plain }, None)
    };
    // Another swarm answers, and a router through which nobody of this one is reached.
    let mut strangers = Vec::new();
    for id in 5..13 {
        strangers.push(robot(id, &other).await);
    }
    let (router, at) = router("tcp", &scouting, None).await;
    let nobody = Client::open(&swarm, &looks).await;
    assert!(nobody.as_ref().is_err_and(|error| error.to_string().contains(&swarm)), "{nobody:?}");
    // A robot that answers no calls is behind it.
    let plain = config(1, &swarm, &[at]);
    let zenoh = json!({"mode": "client"}).as_object().unwrap().clone();
    let behind =
        start(RobotConfig { link: LinkConfig { zenoh, listen: Vec::new(), ..plain.link }, ..plain }, None)
            .await;
    let client = Client::open(&swarm, &looks).await.unwrap();
    let heard = client.statuses(Duration::from_secs(2)).await.unwrap();
    assert_eq!(heard.iter().map(|status| status.robot.0).collect::<Vec<_>>(), [1]);
    client.close().await;
    behind.stop().await;
    let first = robot(2, &swarm).await;
    for _ in 0..3 {
        let client = Client::open(&swarm, &looks).await.unwrap();
        assert_eq!(client.attached().await.map(|robot| robot.0), Some(2));
        client.close().await;
    }
    // It goes, and another one of its swarm comes when strangers have been tried for longer than a look takes.
    let client = Client::open(&swarm, &looks).await.unwrap();
    first.stop().await;
    tokio::time::sleep(Duration::from_secs(8)).await;
    assert_eq!(client.attached().await, None);
    let second = robot(3, &swarm).await;
    let came_back = async {
        while client.attached().await.map(|robot| robot.0) != Some(3) {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    };
    tokio::time::timeout(PATIENCE, came_back).await.expect("it looks again");
    client.close().await;
    router.close().await.unwrap();
    for robot in strangers.into_iter().chain([second]) {
        robot.stop().await;
    }
}
