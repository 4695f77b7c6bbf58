//! A swarm live in Foxglove: real robots, the program that serves them, and viewers that share no line with it.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::{Duration, Instant};

use gestalt_link::{Client, LinkConfig, RobotConfig};
use gestalt_protocol::{Instruction, InstructorId, RobotId};
use gestalt_tests::{Process, Watched, config, learning, short_rounds, start_learning, unique};
use gestalt_trials::python;
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::time::{sleep, timeout};

const PATIENCE: Duration = Duration::from_secs(30);

/// Robots that learn on a line, what is in front of their cameras, and the program beside them.
struct School {
    swarm: String,
    robots: Vec<Watched>,
    shown: Arc<AtomicU8>,
    client: Client,
    watch: Process,
    url: String,
}

impl School {
    async fn start(n: u32) -> Self {
        let (swarm, shown) = (unique("foxglove"), Arc::new(AtomicU8::new(3)));
        let mut robots: Vec<Watched> = Vec::new();
        for id in 0..n {
            let connect = robots.last().map(|it| it.robot.locators().to_vec()).unwrap_or_default();
            let config = RobotConfig {
                mind: short_rounds(),
                learning: Some(learning(3, 0.5, None)),
                ..config(id, &swarm, &connect)
            };
            robots.push(start_learning(config, shown.clone()).await);
        }
        for robot in &robots {
            assert!(robot.sees_alive(n as usize - 1, PATIENCE).await);
        }
        let connect = robots[0].robot.locators().to_vec();
        let link = LinkConfig { connect: connect.clone(), ..LinkConfig::default() };
        let client = Client::open(&swarm, &link).await.unwrap();
        let (watch, url) = watch(&swarm, &connect[0]);
        Self { swarm, robots, shown, client, watch, url }
    }

    fn topic(&self, what: &str) -> String {
        format!("/gestalt/{}/{what}", self.swarm)
    }

    /// The port of the server, which a plain connection needs.
    fn address(&self) -> &str {
        self.url.trim_start_matches("ws://").trim_end_matches('/')
    }

    /// What became of the viewers, at the end of it all.
    async fn end(self) -> Value {
        self.watch.signal("INT");
        let closed = |told: &[Value]| told.iter().find(|told| told["event"] == "foxglove_closed").cloned();
        let closed = tokio::task::block_in_place(|| self.watch.wait(PATIENCE, closed)).expect("it ends");
        self.client.close().await;
        for robot in self.robots {
            robot.stop().await;
        }
        closed["visits"].clone()
    }
}

/// `gestalt watch --foxglove`, and where it serves.
fn watch(swarm: &str, endpoint: &str) -> (Process, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_test-gestalt"));
    command.args(["watch", "--foxglove", "0", "--swarm", swarm, "-e", endpoint, "--json"]);
    let watch = Process::run(&mut command);
    let serves = |told: &[Value]| told.iter().find(|told| told["event"] == "foxglove").cloned();
    let url = tokio::task::block_in_place(|| watch.wait(PATIENCE, serves)).expect("it serves")["url"].clone();
    (watch, url.as_str().unwrap().to_owned())
}

/// The viewer in Python.
struct Viewer(Process);

impl Viewer {
    fn open(url: &str) -> Self {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("swarm/viewer.py");
        let python = python(&["websockets"]).expect("there is a Python with websockets");
        let viewer = Self(Process::run(Command::new(python).arg(script).arg(url)));
        viewer.wait("services", |_| true);
        viewer
    }

    /// The first thing it told that is as `pick` says.
    fn wait(&self, event: &str, pick: impl Fn(&Value) -> bool) -> Value {
        let found = |told: &[Value]| told.iter().find(|it| it["event"] == event && pick(it)).cloned();
        let found = tokio::task::block_in_place(|| self.0.wait(PATIENCE, found));
        found.unwrap_or_else(|| panic!("no such {event} in {:#?}", self.0.told()))
    }

    fn order(&mut self, order: Value) {
        self.0.order(&order.to_string());
    }

    /// Says it by the service, and gives back what came of it.
    fn call(&mut self, service: &str, request: Value) -> Value {
        let answers = |told: &[Value]| {
            let is_answer = |it: &&Value| it["event"] == "response" || it["event"] == "serviceCallFailure";
            told.iter().filter(is_answer).cloned().collect::<Vec<_>>()
        };
        let before = answers(&self.0.told()).len();
        self.order(json!({"do": "call", "service": service, "request": request}));
        let next = |told: &[Value]| answers(told).get(before).cloned();
        tokio::task::block_in_place(|| self.0.wait(PATIENCE, next)).expect("an answer")
    }
}

pub async fn a_viewer_in_python_sees_what_zenoh_carries_teaches_and_sees_the_links() {
    let school = School::start(4).await;
    let mut decisions = school.client.decisions().await.unwrap();
    let mut viewer = Viewer::open(&school.url);
    assert_eq!(viewer.wait("connected", |_| true)["subprotocol"], "foxglove.sdk.v1");
    let info = viewer.wait("serverInfo", |_| true)["told"].clone();
    assert_eq!(info["capabilities"], json!(["services", "connectionGraph"]));
    let (say, decided) = (school.topic("say"), school.topic("decision"));
    for topic in
        ["decision", "question", "log", "recorder", "robot/3/vote", "robot/3/status", "robot/0/alive"]
    {
        let topic = school.topic(topic);
        viewer.wait("advertise", |it| it["topics"].as_array().unwrap().contains(&json!(topic)));
        viewer.order(json!({"do": "subscribe", "topic": topic}));
    }
    viewer.order(json!({"do": "graph"}));
    viewer.wait("message", |it| it["topic"] == school.topic("recorder"));

    // Decisions are what Zenoh carries, each once, and in the same order.
    let (mut carried, mut truth) = (Vec::new(), Value::Null);
    for class in [3_u8, 0, 5, 3] {
        school.shown.store(class, Ordering::Relaxed);
        let answer = viewer.call(&say, json!({"say": "look"}));
        assert_eq!(answer["body"]["words"], "asked all robots to look", "{answer}");
        let announced = timeout(PATIENCE, decisions.next()).await.unwrap().unwrap().unwrap();
        let round = announced.decision.round;
        carried.push(announced);
        let is_it = |it: &Value| it["topic"] == decided && it["body"]["round"] == json!(round);
        let seen = viewer.wait("message", is_it);
        assert!(seen["at"].as_u64() > Some(1_700_000_000_000_000_000), "{seen}");
        // Taught by a word of which the round is left out, and learned.
        sleep(Duration::from_millis(500)).await;
        let answer = viewer.call(&say, json!({"say": format!("was {class}")}));
        assert_eq!(answer["body"]["words"], "learned", "{answer}");
        assert_eq!(answer["body"]["answer"]["to"]["round"], json!(round));
        truth = json!(round);
        sleep(Duration::from_millis(700)).await;
    }
    let told = viewer.0.told();
    let seen: Vec<Value> = told
        .iter()
        .filter(|it| it["event"] == "message" && it["topic"] == decided)
        .map(|it| it["body"].clone())
        .collect();
    let carried: Vec<Value> =
        carried.iter().map(|it| comparable(serde_json::to_value(it).unwrap())).collect();
    assert_eq!(seen.into_iter().map(comparable).collect::<Vec<_>>(), carried);
    // A robot says the same of itself: what was taught is in its training set.
    let statuses = school.client.statuses(Duration::from_secs(2)).await.unwrap();
    let learned = |status: &gestalt_protocol::Status| {
        let learning = status.learning.as_ref().expect("it learns");
        learning.lessons > 0 && learning.shared.iter().chain(&learning.personal).sum::<usize>() > 0
    };
    assert_eq!(statuses.iter().filter(|status| learned(status)).count(), 4, "{statuses:#?}");
    let answer = viewer.call(&say, json!({"say": "undo"}));
    assert_eq!(answer["body"]["answer"]["to"], json!({"say": "retract", "round": truth}), "{answer}");
    let answer = viewer.call(&say, json!({"say": "dance"}));
    assert!(answer["event"] == "serviceCallFailure" && answer["told"]["message"].is_string(), "{answer}");

    // The links are those of the line.
    let mut links = BTreeSet::new();
    for update in viewer.0.told().iter().filter(|it| it["event"] == "connectionGraphUpdate") {
        for topic in update["told"]["subscribedTopics"].as_array().unwrap() {
            let Some(robot) = topic["name"].as_str().unwrap().strip_suffix("/vote") else { continue };
            let robot = robot.strip_prefix(&school.topic("")).unwrap().to_owned();
            links.retain(|(from, _)| *from != robot);
            let who = topic["subscriberIds"].as_array().unwrap().iter();
            links.extend(who.map(|it| (robot.clone(), it.as_str().unwrap().to_owned())));
        }
    }
    let line = (0..3).flat_map(|it| [(it, it + 1), (it + 1, it)]);
    assert_eq!(links, line.map(|(from, to)| (format!("robot/{from}"), format!("robot/{to}"))).collect());

    // Who leaves is gone with its channels; and a viewer is told when the server closes.
    let mut school = school;
    let gone = school.robots.pop().unwrap();
    gone.stop().await;
    let votes = school.topic("robot/3/vote");
    viewer.wait("unadvertise", |_| true);
    viewer.wait("connectionGraphUpdate", |it| {
        it["told"]["removedTopics"].as_array().unwrap().contains(&json!(votes))
    });
    let visits = school.end().await;
    assert_eq!(viewer.wait("closed", |_| true)["code"], 1001);
    assert_eq!((&visits["clients"], &visits["dropped"]), (&json!(1), &json!(0)), "{visits}");
}

/// A decision without what is absent: Zenoh's has `null` there.
fn comparable(value: Value) -> Value {
    match value {
        Value::Object(fields) => fields
            .into_iter()
            .filter(|(_, value)| !value.is_null())
            .map(|(name, value)| (name, comparable(value)))
            .collect::<serde_json::Map<_, _>>()
            .into(),
        Value::Array(items) => items.into_iter().map(comparable).collect(),
        other => other,
    }
}

/// Asks to be let in by hand, as one who means no good; what is answered first.
async fn knock(address: &str, headers: &str) -> (TcpStream, String) {
    let mut stream = TcpStream::connect(address).await.unwrap();
    let request = format!(
        "GET / HTTP/1.1\r\nHost: {address}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
         Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n{headers}\r\n"
    );
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = vec![0; 16];
    timeout(PATIENCE, stream.read_exact(&mut answer)).await.expect("an answer").unwrap();
    (stream, String::from_utf8_lossy(&answer).into_owned())
}

/// A frame as a client masks it, with a mask of nothing.
fn frame(opcode: u8, payload: &[u8]) -> Vec<u8> {
    let length = u16::try_from(payload.len()).unwrap().to_be_bytes();
    [&[0x80 | opcode, 0x80 | 126], &length[..], &[0; 4], payload].concat()
}

pub async fn viewers_that_never_read_are_dropped_and_rounds_stay_as_quick() {
    const SPEAKS: &str = "Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n";
    let mut school = School::start(3).await;
    let ada: InstructorId = "ada".parse().unwrap();
    let mut quick = Vec::new();
    let mut slow = Vec::new();
    let mut idle = Vec::new();
    for round in 1..=8 {
        if round == 5 {
            // A foreign page, another protocol, and nonsense are refused, each as it should be.
            let foreign = format!("{SPEAKS}Origin: http://evil.example\r\n");
            for (headers, status) in
                [(foreign.as_str(), "403"), ("", "400"), ("Sec-WebSocket-Protocol: chat\r\n", "400")]
            {
                assert!(knock(school.address(), headers).await.1.contains(status), "{headers}");
            }
            let ids: Vec<Value> = (1..60).map(|id| json!({"id": id, "channelId": id})).collect();
            let subscribe = json!({"op": "subscribe", "subscriptions": ids}).to_string();
            for _ in 0..14 {
                let (mut stream, answer) = knock(school.address(), SPEAKS).await;
                assert!(answer.contains("101"), "{answer}");
                stream.write_all(&frame(1, subscribe.as_bytes())).await.unwrap();
                for nonsense in [&b"\x02\x01"[..], b"\xff\xff\xff", b""] {
                    stream.write_all(&frame(2, nonsense)).await.unwrap();
                }
                idle.push(stream);
            }
        }
        let began = Instant::now();
        school.client.instruct(&ada, &Instruction::Open).await.unwrap();
        for robot in &mut school.robots {
            assert!(robot.decision(round, PATIENCE).await.is_some(), "round {round}");
        }
        if round < 5 { &mut quick } else { &mut slow }.push(began.elapsed());
        sleep(Duration::from_millis(700)).await;
    }
    println!("alone: {quick:?}; beside viewers that never read: {slow:?}");
    let worst = |all: &[Duration]| all.iter().copied().max().unwrap_or_default();
    assert!(worst(&slow) < worst(&quick) + Duration::from_secs(1), "{quick:?}, then {slow:?}");
    // They hear nothing of it, but their places are free again.
    let began = Instant::now();
    loop {
        let mut taken = Vec::new();
        for _ in 0..16 {
            let (stream, answer) = knock(school.address(), SPEAKS).await;
            taken.push((stream, answer.contains("101")));
        }
        if taken.iter().all(|(_, is_in)| *is_in) {
            break;
        }
        assert!(began.elapsed() < PATIENCE, "they are still there");
        drop(taken);
        sleep(Duration::from_secs(1)).await;
    }
    assert_eq!(
        school.client.statuses(PATIENCE).await.unwrap().iter().map(|it| it.robot).collect::<Vec<_>>(),
        [0, 1, 2].map(RobotId)
    );
    let visits = school.end().await;
    println!("{visits}");
    assert_eq!(visits["dropped"], 14, "{visits}");
    assert!(visits["refused"].as_u64() >= Some(14 * 3), "{visits}");
    drop(idle);
}
