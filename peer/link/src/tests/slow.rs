//! A neighbour that does not read holds up nobody.

use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::Duration;

use gestalt_protocol::{Keys, RobotId};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;
use tokio::time::{sleep, timeout};
use zenoh::Wait;
use zenoh::qos::{CongestionControl, Priority};

use super::{PATIENCE, config, start, swarm, unique};
use crate::RobotConfig;

/// Set in the process of its own that a test runs in.
const ALONE: &str = "GESTALT_LINK_TEST_ALONE";

/// Runs that test of this file in a process of its own: all sessions of a process share Zenoh's two threads for what is received, and a session
/// that is held up, as is the point here, may hold up both.
fn alone(test: &str, it: impl Future<Output = ()>) {
    if std::env::var_os(ALONE).is_some() {
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(4).enable_all().build();
        return runtime.unwrap().block_on(it);
    }
    let mut child = Command::new(std::env::current_exe().unwrap());
    child.args([&format!("tests::slow::{test}"), "--exact", "--nocapture"]).env(ALONE, "1");
    let output = child.output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    let passed = output.status.success() && said.contains(" 1 passed");
    assert!(passed, "{}\n{said}\n{}", output.status, String::from_utf8_lossy(&output.stderr));
}

/// Forwards between who connects and a robot, until it is told to forward nothing more from the robot. Gives where to
/// connect.
async fn proxy(robot: String, open: watch::Receiver<bool>) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let at = listener.local_addr().unwrap();
    tokio::spawn(async move {
        let (stream, _) = listener.accept().await.unwrap();
        let (mut from, mut to) = stream.into_split();
        let (mut back, mut forth) = TcpStream::connect(robot).await.unwrap().into_split();
        let other = tokio::spawn(async move { tokio::io::copy(&mut from, &mut forth).await });
        let mut bytes = vec![0; 1 << 16];
        while *open.borrow() {
            let Ok(length @ 1..) = back.read(&mut bytes).await else { break };
            to.write_all(&bytes[..length]).await.unwrap();
        }
        // Both ends stay open; what the robot sends is read no more.
        let _ = other.await;
    });
    format!("tcp/{at}")
}

/// A router that dials there, and keeps its links without a sign of life for a minute.
async fn neighbour(at: String, more: &[(&str, serde_json::Value)]) -> zenoh::Session {
    let mut config = zenoh::Config::default();
    for (key, value) in [
        ("mode", serde_json::json!("router")),
        ("listen/endpoints", serde_json::json!([])),
        ("connect/endpoints", serde_json::json!([at])),
        ("scouting/multicast/enabled", serde_json::json!(false)),
        ("transport/link/tx/lease", serde_json::json!(60_000)),
    ]
    .iter()
    .chain(more)
    {
        config.insert_json5(key, &value.to_string()).unwrap();
    }
    zenoh::open(config).await.unwrap()
}

/// One that says it is a robot, asks for one queue for all, fills it, and never says a word, so that it is hung up: to say so to it, there is no room.
#[test]
fn a_neighbour_that_does_not_read_is_hung_up_and_delays_nobody() {
    alone("a_neighbour_that_does_not_read_is_hung_up_and_delays_nobody", one_with_one_queue());
}

async fn one_with_one_queue() {
    let name = unique();
    let mut first: RobotConfig = config(1, &name, &[]);
    first.link.lease = Duration::from_secs(60);
    let mut robots = swarm(&name, 2, first).await;
    let (open, is_open) = watch::channel(true);
    let at = robots[0].robot.locators()[0].trim_start_matches("tcp/").to_owned();
    let id = crate::identity::zenoh_id(RobotId(9), &name, 1);
    let more = [("id", serde_json::json!(id)), ("transport/unicast/qos/enabled", serde_json::json!(false))];
    let deaf = neighbour(proxy(at, is_open).await, &more).await;
    let filler = format!("gestalt/{name}/robot/9/filler");
    let heard = deaf.declare_subscriber(&filler).await.unwrap();
    let session = robots[0].robot.session.clone();
    let (fill, full) = (filler.clone(), Arc::new(AtomicBool::new(false)));
    while heard.try_recv().unwrap().is_none() {
        session.put(&fill, vec![0_u8; 10]).await.unwrap();
        sleep(Duration::from_millis(50)).await;
    }
    open.send_replace(false);
    let ended = full.clone();
    let filling = std::thread::spawn(move || {
        // What does not fit is dropped.
        while !ended.load(Ordering::Relaxed) {
            let put = session.put(&fill, vec![0_u8; 30_000]).congestion_control(CongestionControl::Drop);
            put.wait().unwrap();
            std::thread::sleep(Duration::from_millis(1));
        }
    });
    let deaf_one =
        |status: &gestalt_protocol::Status| status.counters.get("links_deaf").is_some_and(|n| *n > 0);
    robots[0].status("it is hung up", deaf_one).await;
    let hub = robots[0].robot.locators().to_vec();
    robots.push(start(config(3, &name, &hub)).await);
    robots[2].status("who comes is met", |status| status.alive.len() == 3).await;
    let mut counter = 0;
    for _ in 0..4 {
        counter = robots[1].decide(counter).await.round.counter;
    }
    full.store(true, Ordering::Relaxed);
    filling.join().unwrap();
    drop(heard);
    timeout(PATIENCE, deaf.close()).await.expect("it closes").unwrap();
    for robot in robots {
        timeout(PATIENCE, robot.stop()).await.expect("it stops");
    }
}

#[test]
fn a_neighbour_that_does_not_read_delays_no_decision() {
    alone("a_neighbour_that_does_not_read_delays_no_decision", one_that_is_kept());
}

async fn one_that_is_kept() {
    let name = unique();
    let mut first: RobotConfig = config(1, &name, &[]);
    // A link that is silent stays, and a message that is not to be lost would wait for a minute.
    first.link.lease = Duration::from_secs(60);
    let patient = serde_json::json!({"link": {"tx": {"queue": {"congestion_control": {"block": {"wait_before_close": 60_000_000}}}}}});
    first.link.zenoh.insert("transport".to_owned(), patient);
    let mut robots = swarm(&name, 2, first).await;
    let (open, is_open) = watch::channel(true);
    let at = robots[0].robot.locators()[0].trim_start_matches("tcp/").to_owned();
    let deaf = neighbour(proxy(at, is_open).await, &[]).await;
    let keys = Keys::new(&name).unwrap();
    let all = keys.key(&gestalt_protocol::Topic::Decision);
    let all = format!("{}/**", all.rsplit_once('/').unwrap().0);
    let heard = deaf.declare_subscriber(&all).await.unwrap();
    // Until it hears a decision, the link and the subscription may not stand yet.
    let mut counter = 0;
    while heard.try_recv().unwrap().is_none() {
        counter = robots[1].decide(counter).await.round.counter;
    }
    open.send_replace(false);
    // Fills every buffer between the robot and the neighbour: those of the system take some megabytes.
    let filler = format!("{}/filler", all.trim_end_matches("/**"));
    let session = robots[0].robot.session.clone();
    let sent = Arc::new(AtomicU32::new(0));
    let counting = sent.clone();
    std::thread::spawn(move || {
        loop {
            let put = session.put(&filler, vec![0_u8; 60_000]);
            let put = put.priority(Priority::RealTime).congestion_control(CongestionControl::Block);
            if put.wait().is_err() || session.is_closed() {
                return;
            }
            counting.fetch_add(1, Ordering::Relaxed);
        }
    });
    let mut seen = 0;
    loop {
        sleep(Duration::from_secs(1)).await;
        match sent.load(Ordering::Relaxed) {
            now if now == seen && now > 0 => break,
            now => seen = now,
        }
    }
    let before = counter;
    for _ in 0..4 {
        counter = robots[1].decide(counter).await.round.counter;
        // The robot beside the deaf one decides as well.
        let such =
            |status: &gestalt_protocol::Status| status.round.is_some_and(|round| round.counter >= counter);
        robots[0].status("it takes part", such).await;
        let held = |event: &crate::Event| match event {
            crate::Event::Held(held) if held.round.counter >= counter => Some(()),
            _ => None,
        };
        robots[0].event("it decides", held).await;
    }
    assert!(counter >= before + 4);
    let still = robots[0].robot.session.info().routers_zid().await.any(|id| id == deaf.zid());
    assert!(still, "the deaf one is linked all the while");
    drop(heard);
    // Its end frees the thread that fills.
    timeout(PATIENCE, deaf.close()).await.expect("it closes").unwrap();
    for robot in robots {
        timeout(PATIENCE, robot.stop()).await.expect("it stops");
    }
}
