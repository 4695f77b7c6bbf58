//! From a vote to the decision at a neighbour, beside a raw Zenoh put of the same size on the same kind of link.
//!
//! Each sample of the one is followed by a sample of the other, so that both see the same machine.

use std::sync::mpsc;
use std::time::{Duration, Instant};

use gestalt_link::{Event, LinkConfig, Robot, RobotConfig, fresh_nonce};
use gestalt_protocol::{Envelope, Keys, Message, RobotId, RoundId, Stamp, Topic, VocabularyId, Vote};
use gestalt_strategies::MindConfig;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::{Session, Wait};

const SAMPLES: u32 = 300;
const SWARM: &str = "bench";

#[tokio::main]
async fn main() {
    let robot = Robot::start(RobotConfig {
        id: RobotId(1),
        name: "bench".to_owned(),
        boot: 1,
        swarm: SWARM.to_owned(),
        mind: MindConfig::default(),
        fusion: None,
        link: LinkConfig { listen: vec!["tcp/127.0.0.1:0".to_owned()], ..LinkConfig::default() },
        vocabulary: None,
        learning: None,
        nonce: fresh_nonce(),
        seal: None,
    })
    .await
    .expect("the robot starts");
    let voter = session(&[], robot.locators()).await;
    let receiver = session(&["tcp/127.0.0.1:0".to_owned()], &[]).await;
    let locators: Vec<String> = receiver.info().locators().await.iter().map(ToString::to_string).collect();
    let sender = session(&[], &locators).await;

    let (arrived, arrivals) = mpsc::channel();
    let _subscriber = receiver
        .declare_subscriber("raw/vote")
        .callback(move |_| {
            let _ = arrived.send(Instant::now());
        })
        .await
        .expect("a subscriber");
    let (held, holds) = mpsc::channel();
    let mut events = robot.events();
    std::thread::spawn(move || {
        while let Ok(event) = events.blocking_recv() {
            let now = Instant::now();
            if matches!(event, Event::Held(_)) && held.send(now).is_err() {
                break;
            }
        }
    });
    let vote_key = Keys::new(SWARM).expect("a swarm's name").key(&Topic::Vote(RobotId(0)));
    tokio::time::sleep(Duration::from_secs(1)).await;

    let (mut raw, mut decided) = (Vec::new(), Vec::new());
    for counter in 1..=SAMPLES {
        let vote = vote(counter);
        let began = put(&sender, "raw/vote", vote.clone());
        raw.push(arrivals.recv_timeout(Duration::from_secs(5)).expect("the put arrives") - began);
        std::thread::sleep(Duration::from_millis(10));
        let began = put(&voter, &vote_key, vote);
        decided.push(holds.recv_timeout(Duration::from_secs(5)).expect("the robot decides") - began);
        std::thread::sleep(Duration::from_millis(10));
    }
    let (raw, decided) = (median(&mut raw), median(&mut decided));
    println!("raw Zenoh put -> callback     median {raw:?} of {SAMPLES}");
    println!("vote -> decision at neighbour median {decided:?} of {SAMPLES}");
    println!("ratio {:.2} (promised: at most 2)", decided.as_secs_f64() / raw.as_secs_f64());
    robot.stop().await;
}

async fn session(listen: &[String], connect: &[String]) -> Session {
    let mut config = zenoh::Config::default();
    for (key, value) in [
        ("mode", serde_json::json!("router")),
        ("listen/endpoints", serde_json::json!(listen)),
        ("connect/endpoints", serde_json::json!(connect)),
        ("scouting/multicast/enabled", serde_json::json!(false)),
        ("timestamping/enabled", serde_json::json!(true)),
    ] {
        config.insert_json5(key, &value.to_string()).expect("a key of Zenoh's");
    }
    zenoh::open(config).await.expect("a session")
}

/// A vote that suffices, over six classes; each for a round of its own.
fn vote(counter: u32) -> Vec<u8> {
    let vote = Vote {
        round: RoundId { counter, opener: RobotId(0), life: 0 },
        vocabulary: VocabularyId(1),
        evidence: vec![6.0, -1.2, -1.2, -1.2, -1.2, -1.2],
        looks: 3.0,
    };
    let stamp = Stamp { boot: 1, sequence: counter };
    Envelope { author: RobotId(0), stamp, message: Message::Vote(vote), signature: None }.encode()
}

fn put(session: &Session, key: &str, bytes: Vec<u8>) -> Instant {
    let began = Instant::now();
    session
        .put(key, bytes)
        .priority(Priority::DataHigh)
        .congestion_control(CongestionControl::Drop)
        .express(true)
        .wait()
        .expect("the session sends");
    began
}

fn median(times: &mut [Duration]) -> Duration {
    times.sort_unstable();
    times[times.len() / 2]
}
