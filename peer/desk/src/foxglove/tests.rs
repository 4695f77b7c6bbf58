//! The server without a swarm, and real clients: whom it lets in, what they are sent, and what it bears.

use std::time::{Duration, Instant};

use futures_util::{SinkExt, StreamExt};
use gestalt_protocol::{Instruction, RobotId};
use gestalt_tape::{Entry, Kind, Passing, Sink as _, schema};
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use serde_json::{Value, json};
use tokio::net::TcpStream;
use tokio::sync::mpsc;
use tokio::time::{sleep, timeout};
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::{Error, Message};
use tokio_tungstenite::{WebSocketStream, client_async};

use super::*;
use crate::asks::Ask;
use crate::follow::Show;
use crate::view::Input;

const SOON: Duration = Duration::from_secs(10);

struct Stage {
    address: SocketAddr,
    hub: Arc<Hub>,
    easel: Arc<Easel>,
    known: Arc<Known>,
    asked: mpsc::Receiver<Ask>,
    keys: Keys,
}

/// Serves a swarm that is not there; with a token it behaves as one that can be reached from elsewhere.
async fn stage(token: Option<&str>, limits: Limits) -> Stage {
    let Viewing { door, mut origins, .. } = Viewing::at("0".parse().unwrap());
    let door = Door { limits, ..door };
    origins.push("http://localhost:8080".to_owned());
    let (listener, address, _) = door.listen("Foxglove").await.unwrap();
    let keys = Keys::new("gestalt").unwrap();
    let hub = Arc::new(Hub::new(keys.clone()));
    let easel = Arc::new(Easel::new(keys.clone(), service(&keys)));
    let known = Arc::new(Known::new());
    let (asks, asked) = Asks::new();
    let info = Info { swarm: "gestalt".to_owned(), session: "1".to_owned(), service: service(&keys) };
    let host = Host {
        hub: hub.clone(),
        pictures: easel.pictures(),
        known: known.clone(),
        asks,
        info: Arc::new(info),
        patience: limits.patience,
    };
    let token = token.map(|token| Token::new(token).unwrap());
    let guard = Guard::new(&door.address, address, token).for_viewers(origins);
    let server = Server { guard, host, places: Arc::new(Semaphore::new(limits.readers)) };
    let gate = Gate::new(listener, limits.connections, limits.patience);
    tokio::spawn(serve(gate, server, std::future::pending()));
    Stage { address, hub, easel, known, asked, keys }
}

/// A viewer.
struct Viewer(WebSocketStream<TcpStream>);

impl Stage {
    /// Asks to be let in with these headers; the status where it is not.
    async fn connect(&self, path: &str, headers: &[(&'static str, &str)]) -> Result<Viewer, u16> {
        let mut request = format!("ws://{}{path}", self.address).into_client_request().unwrap();
        for (name, value) in headers {
            request.headers_mut().insert(*name, value.parse().unwrap());
        }
        let stream = TcpStream::connect(self.address).await.unwrap();
        match timeout(SOON, client_async(request, stream)).await.expect("an answer") {
            Ok((socket, response)) => {
                assert_eq!(response.headers()["sec-websocket-protocol"], wire::SUBPROTOCOL);
                Ok(Viewer(socket))
            }
            Err(Error::Http(response)) => Err(response.status().as_u16()),
            Err(error) => panic!("{error}"),
        }
    }

    async fn viewer(&self) -> Viewer {
        let mut viewer = self.connect("/", &[SPEAKS]).await.unwrap();
        for op in ["serverInfo", "advertise", "advertiseServices"] {
            assert_eq!(viewer.json().await["op"], op);
        }
        viewer
    }

    fn say(&self, entry: &Entry) -> bool {
        self.hub.write(entry, Duration::ZERO)
    }
}

const SPEAKS: (&str, &str) = ("sec-websocket-protocol", "foxglove.sdk.v1");

impl Viewer {
    /// The next message; pings are answered on the way.
    async fn next(&mut self) -> Option<Message> {
        loop {
            match timeout(SOON, self.0.next()).await.expect("a message")? {
                Ok(Message::Ping(_)) => {}
                Ok(message) => return Some(message),
                Err(_) => return None,
            }
        }
    }

    async fn json(&mut self) -> Value {
        match self.next().await {
            Some(Message::Text(text)) => serde_json::from_str(&text).unwrap(),
            other => panic!("{other:?} is no text"),
        }
    }

    async fn data(&mut self) -> (u32, u64, Vec<u8>) {
        match self.next().await {
            Some(Message::Binary(bytes)) if bytes[0] == 1 => (
                u32::from_le_bytes(bytes[1..5].try_into().unwrap()),
                u64::from_le_bytes(bytes[5..13].try_into().unwrap()),
                bytes[13..].to_vec(),
            ),
            other => panic!("{other:?} is no message data"),
        }
    }

    async fn send(&mut self, value: Value) {
        self.0.send(Message::text(value.to_string())).await.unwrap();
    }

    async fn subscribe(&mut self, id: u32, channel: u32) {
        self.send(json!({"op": "subscribe", "subscriptions": [{"id": id, "channelId": channel}]})).await;
    }

    /// Waits until everything that was sent before is done.
    async fn settle(&mut self) {
        self.send(json!({"op": "unsubscribe", "subscriptionIds": [4_000_000]})).await;
        while let Some(message) = self.next().await {
            if message.into_text().is_ok_and(|text| text.contains("4000000")) {
                return;
            }
        }
        panic!("closed");
    }

    async fn call(&mut self, service: u32, encoding: &str, payload: &[u8]) {
        let mut bytes = vec![2];
        for number in [service, 77, u32::try_from(encoding.len()).unwrap()] {
            bytes.extend(number.to_le_bytes());
        }
        bytes.extend([encoding.as_bytes(), payload].concat());
        self.0.send(Message::binary(bytes)).await.unwrap();
    }
}

fn decision(at: u64, data: &str) -> Entry {
    let channel = "/gestalt/gestalt/decision".to_owned();
    Entry { kind: Kind::Decision, channel, at, published: at, data: data.as_bytes().to_vec() }
}

/// The numbers of all channels that are advertised, by topic.
fn advertised(message: &Value) -> std::collections::BTreeMap<String, u32> {
    let channels = message["channels"].as_array().unwrap().iter();
    channels
        .map(|it| (it["topic"].as_str().unwrap().to_owned(), it["id"].as_u64().unwrap().try_into().unwrap()))
        .collect()
}

#[tokio::test]
async fn only_who_may_is_let_in_and_only_who_speaks_the_protocol() {
    let stage = stage(None, Limits::default()).await;
    for protocol in ["foxglove.websocket.v1", "chat", "foxglove.sdk.v1x"] {
        assert_eq!(
            stage.connect("/", &[("sec-websocket-protocol", protocol)]).await.err(),
            Some(400),
            "{protocol}"
        );
    }
    assert_eq!(stage.connect("/", &[]).await.err(), Some(400), "no protocol");
    assert_eq!(stage.connect("/other", &[SPEAKS]).await.err(), Some(404));
    assert!(stage.connect("/", &[("sec-websocket-protocol", "chat, foxglove.sdk.v1")]).await.is_ok());
    for origin in
        ["http://evil.example", "null", "http://127.0.0.1:1", "https://app.foxglove.dev.evil.example"]
    {
        assert_eq!(stage.connect("/", &[SPEAKS, ("origin", origin)]).await.err(), Some(403), "{origin}");
    }
    let own = format!("http://{}", stage.address);
    for origin in [own.as_str(), "https://app.foxglove.dev", "file://", "http://localhost:8080"] {
        assert!(stage.connect("/", &[SPEAKS, ("origin", origin)]).await.is_ok(), "{origin}");
    }
    for host in ["evil.example", "192.168.1.5:8765"] {
        assert_eq!(stage.connect("/", &[SPEAKS, ("host", host)]).await.err(), Some(403), "{host}");
    }
    assert_eq!(stage.hub.visits().clients, 5);
}

#[tokio::test]
async fn from_elsewhere_a_token_is_needed() {
    const TOKEN: &str = "a-token-of-somebodys-own";
    let stage = stage(Some(TOKEN), Limits::default()).await;
    for path in [
        "/",
        "/?token=",
        "/?token=a-token-of-somebody-else",
        "/layout.json",
        "/?Token=a-token-of-somebodys-own",
    ] {
        assert_eq!(stage.connect(path, &[SPEAKS]).await.err(), Some(401), "{path}");
    }
    assert!(stage.connect(&format!("/?token={TOKEN}"), &[SPEAKS]).await.is_ok());
    assert!(stage.connect("/", &[SPEAKS, ("authorization", &format!("Bearer {TOKEN}"))]).await.is_ok());
}

#[tokio::test]
async fn a_client_is_told_of_channels_and_gets_what_it_subscribes_to_and_no_more() {
    let stage = stage(None, Limits::default()).await;
    let mut viewer = stage.connect("/", &[SPEAKS]).await.unwrap();
    let info = viewer.json().await;
    assert_eq!(info["capabilities"], json!(["services", "connectionGraph"]));
    assert_eq!(info["supportedEncodings"], json!(["json"]));
    let channels = viewer.json().await;
    let ids = advertised(&channels);
    let told = channels["channels"].as_array().unwrap();
    assert!(told.iter().all(|it| it["schema"].as_str().is_some_and(|schema| !schema.is_empty())));
    let log = told.iter().find(|it| it["topic"] == "/gestalt/gestalt/log").unwrap();
    assert_eq!(
        [&log["encoding"], &log["schemaEncoding"], &log["schemaName"]],
        ["protobuf", "protobuf", "foxglove.Log"]
    );
    let decisions = told.iter().find(|it| it["topic"] == "/gestalt/gestalt/decision").unwrap();
    let described: Value = serde_json::from_str(decisions["schema"].as_str().unwrap()).unwrap();
    assert_eq!(Some(described), schema(Kind::Decision));
    let service = viewer.json().await;
    assert_eq!(service["services"][0]["name"], "/gestalt/gestalt/say");
    // Nothing comes before it is asked for; then all of it, in order; and nothing after.
    assert!(stage.say(&decision(1, "before")));
    viewer.subscribe(9, ids["/gestalt/gestalt/decision"]).await;
    viewer.settle().await;
    for at in 2..6 {
        assert!(stage.say(&decision(at, &format!("number {at}"))));
        assert_eq!(viewer.data().await, (9, at, format!("number {at}").into_bytes()));
    }
    for (wrong, why) in [
        (json!({"id": 1, "channelId": 999}), "no channel 999"),
        (json!({"id": 3, "channelId": 1}), "already"),
    ] {
        viewer.send(json!({"op": "subscribe", "subscriptions": [wrong]})).await;
        let status = viewer.json().await;
        assert!(status["op"] == "status" && status["level"] == 2, "{status}");
        assert!(status["message"].as_str().unwrap().contains(why), "{status}");
    }
    viewer.send(json!({"op": "unsubscribe", "subscriptionIds": [9]})).await;
    viewer.settle().await;
    assert!(stage.say(&decision(6, "after")));
    viewer.settle().await;
    assert_eq!(stage.hub.visits().dropped, 0);
}

#[tokio::test]
async fn channels_come_and_go_with_their_robots_and_nothing_of_them_is_missed() {
    let stage = stage(None, Limits::default()).await;
    let mut viewer = stage.viewer().await;
    let presence = |alive| Passing::presence(RobotId(7), alive, 5).entry(&stage.keys).unwrap();
    assert!(stage.say(&presence(true)));
    let mut ids = std::collections::BTreeMap::new();
    while ids.len() < 5 {
        let told = viewer.json().await;
        assert_eq!(told["op"], "advertise");
        ids.extend(advertised(&told));
    }
    let names: Vec<&str> =
        ids.keys().map(|topic| topic.strip_prefix("/gestalt/gestalt/robot/7/").unwrap()).collect();
    assert_eq!(names, ["alive", "decision", "sample", "status", "vote"]);
    // Who is there is told to whoever asks late.
    viewer.subscribe(1, ids["/gestalt/gestalt/robot/7/alive"]).await;
    let (_, _, data) = viewer.data().await;
    assert_eq!(serde_json::from_slice::<Value>(&data).unwrap(), json!({"robot": 7, "alive": true}));
    // The first word of somebody new is there for those who subscribe when they are told of it, for a while.
    let word = |who: &str| Entry {
        kind: Kind::Feedback,
        channel: format!("/gestalt/gestalt/instructor/{who}/feedback"),
        ..decision(8, "{}")
    };
    for (who, kept) in [("ada", true), ("bob", false)] {
        assert!(stage.say(&word(who)));
        let told = advertised(&viewer.json().await);
        if !kept {
            stage.hub.age(Duration::from_secs(3));
        }
        viewer.subscribe(if kept { 2 } else { 3 }, *told.values().next().unwrap()).await;
        if kept {
            assert_eq!(viewer.data().await, (2, 8, b"{}".to_vec()));
        }
        viewer.settle().await;
    }
    assert!(stage.say(&presence(false)));
    let (_, _, data) = viewer.data().await;
    assert_eq!(serde_json::from_slice::<Value>(&data).unwrap()["alive"], false);
    let mut gone = Vec::new();
    for _ in 0..5 {
        let told = viewer.json().await;
        assert_eq!(told["op"], "unadvertise");
        gone.extend(told["channelIds"].as_array().unwrap().iter().map(|id| id.as_u64().unwrap()));
    }
    gone.sort_unstable();
    let mut expected: Vec<u64> = ids.values().map(|id| u64::from(*id)).collect();
    expected.sort_unstable();
    assert_eq!(gone, expected);
}

#[test]
fn channels_are_bounded_whoever_makes_them_up() {
    let keys = Keys::new("gestalt").unwrap();
    let hub = Hub::new(keys.clone());
    for robot in 0..5000 {
        hub.write(&Passing::presence(RobotId(robot), true, 1).entry(&keys).unwrap(), Duration::ZERO);
    }
    let word = |who: u32| Entry {
        kind: Kind::Feedback,
        channel: format!("/gestalt/gestalt/instructor/{who}/feedback"),
        ..decision(8, "{}")
    };
    let taken = (0..5000).filter(|who| hub.write(&word(*who), Duration::ZERO)).count();
    assert!(taken < 2048, "{taken}");
    let (seat, _) = hub.join().unwrap();
    assert!(seat.channels.len() <= 4096);
    assert!(hub.write(&decision(9, "{}"), Duration::ZERO), "what is there stays there");
}

#[tokio::test]
async fn words_are_passed_on_as_they_were_said_and_what_means_nothing_fails() {
    let mut stage = stage(None, Limits::default()).await;
    let mut viewer = stage.viewer().await;
    let long = format!(r#"{{"say":"new {}"}}"#, "x".repeat(5000));
    for (service, encoding, payload, why) in [
        (9, "json", r#"{"say":"look"}"#, "no service 9"),
        (1, "protobuf", r#"{"say":"look"}"#, "encoding"),
        (1, "json", &long, "too long"),
        (1, "json", "{", "gestalt teach"),
        (1, "json", r#"{"say":"right"}"#, "no round has been decided"),
    ] {
        viewer.call(service, encoding, payload.as_bytes()).await;
        let failure = viewer.json().await;
        assert_eq!([&failure["op"], &failure["callId"]], [&json!("serviceCallFailure"), &json!(77)]);
        assert_eq!(failure["serviceId"], service);
        assert!(failure["message"].as_str().unwrap().contains(why), "{failure}");
    }
    assert!(stage.asked.try_recv().is_err(), "nothing was said to the swarm");
    viewer.call(1, "json", br#"{"say":"look"}"#).await;
    let ask = timeout(SOON, stage.asked.recv()).await.unwrap().unwrap();
    assert_eq!(ask.instruction, Instruction::Open);
    // It is listened to meanwhile.
    viewer.settle().await;
    ask.answer.send(Ok(None)).unwrap();
    let Some(Message::Binary(answer)) = viewer.next().await else { panic!("no answer") };
    let head = [&[3, 1, 0, 0, 0, 77, 0, 0, 0, 4, 0, 0, 0], &b"json"[..]].concat();
    assert_eq!(answer[..head.len()], head);
    let answer: Value = serde_json::from_slice(&answer[head.len()..]).unwrap();
    assert_eq!(answer["words"], "asked all robots to look");
}

#[tokio::test]
async fn links_and_what_is_wrong_are_told_whenever_they_change() {
    let stage = stage(None, Limits::default()).await;
    let mut viewer = stage.viewer().await;
    let show = || stage.known.with(|view, now| stage.easel.show(view, now));
    viewer.send(json!({"op": "subscribeConnectionGraph"})).await;
    assert_eq!(viewer.json().await["op"], "connectionGraphUpdate");
    for (id, links) in [(1, vec![2]), (2, vec![1])] {
        let mut status = gestalt_protocol::Status::new(RobotId(id), String::new(), 1);
        status.neighbours = links.into_iter().map(RobotId).collect();
        status.errors = vec![gestalt_protocol::Reported { at_ms: 1, what: "no camera".to_owned() }];
        stage.known.hear(Input::Came(RobotId(id)));
        stage.known.hear(Input::Status(Box::new(status)));
    }
    show();
    let told = [viewer.json().await, viewer.json().await, viewer.json().await];
    let problems: Vec<&Value> =
        told.iter().filter(|it| it["op"] == "status").map(|it| &it["message"]).collect();
    assert_eq!(problems, ["robot 1: no camera", "robot 2: no camera"]);
    let graph = told.iter().find(|it| it["op"] == "connectionGraphUpdate").unwrap();
    let link = json!({"name": "/gestalt/gestalt/robot/1/vote", "subscriberIds": ["robot/2"]});
    assert!(graph["subscribedTopics"].as_array().unwrap().contains(&link), "{graph}");
    // Nothing new is nothing said; and one who comes late is told all the same.
    show();
    viewer.send(json!({"op": "unsubscribeConnectionGraph"})).await;
    viewer.settle().await;
    let mut late = stage.connect("/", &[SPEAKS]).await.unwrap();
    let all = [late.json().await, late.json().await, late.json().await, late.json().await, late.json().await];
    assert_eq!(all.iter().filter(|it| it["op"] == "status").count(), 2);
    stage.known.hear(Input::Left(RobotId(2)));
    show();
    assert_eq!(viewer.json().await, json!({"op": "removeStatus", "statusIds": ["robot/2"]}));
    viewer.settle().await;
}

#[tokio::test]
async fn nonsense_is_refused_and_counted_and_others_do_not_notice() {
    let stage = stage(None, Limits::default()).await;
    let (mut good, mut bad) = (stage.viewer().await, stage.viewer().await);
    good.subscribe(1, 1).await;
    good.settle().await;
    let before = stage.hub.visits().refused;
    let rng = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
    let mut runner = TestRunner::new_with_rng(Config::default(), rng);
    let any = proptest::collection::vec(proptest::num::u8::ANY, 0..300);
    for number in 0..600_u64 {
        use proptest::strategy::{Strategy, ValueTree};
        let mut bytes = any.new_tree(&mut runner).unwrap().current();
        let message = match number % 3 {
            0 => Message::binary(bytes),
            1 => {
                bytes.insert(0, 2);
                Message::binary(bytes)
            }
            _ => Message::text(String::from_utf8_lossy(&bytes).into_owned()),
        };
        bad.0.send(message).await.unwrap();
        if number % 50 == 0 {
            bad.settle().await;
            assert!(stage.say(&decision(number, "{}")));
            assert_eq!(good.data().await.1, number);
        }
    }
    bad.settle().await;
    assert!(stage.hub.visits().refused - before >= 600, "{:?}", stage.hub.visits());
    // A list of mistakes is no list of answers.
    let many: Vec<Value> = (0..5000).map(|id| json!({"id": id, "channelId": 100_000 + id})).collect();
    bad.send(json!({"op": "subscribe", "subscriptions": many})).await;
    let mut answers = 0;
    while !bad.json().await["message"].as_str().unwrap().contains("more mistakes") {
        answers += 1;
    }
    assert!(answers <= 40, "{answers}");
    // What is too long ends the connection, and nobody else's.
    let _ = bad.0.send(Message::text("x".repeat(wire::MAX_REQUEST + 1))).await;
    while !matches!(bad.next().await, None | Some(Message::Close(_))) {}
    assert!(stage.say(&decision(1000, "{}")));
    assert_eq!(good.data().await.1, 1000);
    assert_eq!(stage.hub.visits().dropped, 0);
}

#[tokio::test]
async fn who_never_reads_is_dropped_and_the_others_get_everything_at_once() {
    let limits = Limits { patience: Duration::from_secs(2), ..Limits::default() };
    let stage = stage(None, limits).await;
    let mut good = stage.viewer().await;
    good.subscribe(1, 1).await;
    good.settle().await;
    let mut idle = Vec::new();
    for _ in 0..10 {
        let mut viewer = stage.viewer().await;
        viewer.subscribe(1, 1).await;
        viewer.settle().await;
        idle.push(viewer);
    }
    let data = "y".repeat(60_000);
    let mut slowest = Duration::ZERO;
    for at in 0..1500 {
        let began = Instant::now();
        assert!(stage.say(&decision(at, &data)));
        assert_eq!(good.data().await.1, at);
        slowest = slowest.max(began.elapsed());
    }
    println!("the slowest of 1,500 messages of 60 kB took {slowest:?} beside ten that never read");
    assert!(slowest < Duration::from_secs(1), "{slowest:?}");
    let began = Instant::now();
    while stage.hub.visits().dropped < 10 {
        assert!(began.elapsed() < Duration::from_secs(20), "{:?}", stage.hub.visits());
        good.settle().await;
        sleep(Duration::from_millis(100)).await;
    }
    assert_eq!(stage.hub.visits().dropped, 10);
    good.settle().await;
}

#[tokio::test]
async fn who_gives_no_sign_of_life_is_dropped_though_nothing_waits_for_it() {
    let limits = Limits { patience: Duration::from_millis(600), readers: 1, ..Limits::default() };
    let stage = stage(None, limits).await;
    let _silent = stage.viewer().await;
    assert_eq!(stage.connect("/", &[SPEAKS]).await.err(), Some(503), "there is room for one");
    let began = Instant::now();
    while stage.hub.visits().dropped == 0 {
        assert!(began.elapsed() < SOON, "it is still there");
        sleep(Duration::from_millis(20)).await;
    }
    sleep(Duration::from_millis(500)).await;
    // And one that answers stays.
    let mut good = stage.viewer().await;
    for _ in 0..15 {
        good.settle().await;
        sleep(Duration::from_millis(100)).await;
    }
    assert_eq!(stage.hub.visits().dropped, 1);
}

#[tokio::test]
async fn all_are_told_when_it_closes() {
    let stage = stage(None, Limits::default()).await;
    let mut viewer = stage.viewer().await;
    stage.hub.close();
    let Some(Message::Close(Some(frame))) = viewer.next().await else { panic!("no goodbye") };
    assert_eq!(u16::from(frame.code), 1001);
    let mut late = stage.connect("/", &[SPEAKS]).await.unwrap();
    assert!(!matches!(late.next().await, Some(Message::Text(_))), "nobody is served any more");
}

#[tokio::test]
async fn a_port_in_use_is_named_with_the_way_out() {
    let taken = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let error = Viewing::at(address.parse().unwrap()).door.listen("Foxglove").await.unwrap_err().to_string();
    assert!(error.contains(&address) && error.contains("Foxglove") && error.contains("port 0"), "{error}");
}

#[test]
fn a_recorder_hands_the_hub_what_it_would_write() {
    let hub = Arc::new(Hub::new(Keys::new("gestalt").unwrap()));
    let mut live = Live::new(hub.clone());
    assert!(live.write(&decision(1, "{}")).unwrap());
    live.flush().unwrap();
    live.finish(std::collections::BTreeMap::new()).unwrap();
}

/// The layout names what is there before anything has happened, and no field that messages have not.
#[test]
fn the_layout_names_topics_and_fields_that_there_are() {
    let keys = Keys::new("gestalt").unwrap();
    let channels = Entry::channels(&keys, None);
    let layout: Value = serde_json::from_str(server::LAYOUT).unwrap();
    let mut named = 0;
    let panels = layout["configById"].as_object().unwrap();
    for path in texts(&layout["configById"]).into_iter().filter(|text| text.starts_with('/')) {
        named += 1;
        let (topic, fields) = path.split_once('.').unwrap_or((&path, ""));
        if topic == service(&keys) {
            continue;
        }
        let (kind, _) =
            channels.iter().find(|(_, it)| it == topic).unwrap_or_else(|| panic!("{topic} is not there"));
        let mut at = schema(*kind).unwrap_or_default();
        for field in fields.split('.').filter(|field| !field.is_empty()) {
            let (name, is_list) = field.strip_suffix("[:]").map_or((field, false), |name| (name, true));
            let found = at["properties"].get(name).cloned();
            let open = at.get("additionalProperties").is_some().then(|| at["additionalProperties"].clone());
            at = found.or(open).unwrap_or_else(|| panic!("{path}: there is no {name}"));
            if is_list {
                at = at["items"].clone();
            }
        }
    }
    assert!(named >= 12, "{named}");
    for text in texts(&layout["layout"]).iter().filter(|text| text.contains('!')) {
        assert!(panels.contains_key(text), "{text} has no panel");
    }
    for panel in panels.values().filter(|panel| panel["serviceName"].is_string()) {
        let payload = panel["requestPayload"].as_str().unwrap();
        let last = ("5@2-3f9a01c7".parse().unwrap(), Some(gestalt_protocol::ClassId(3)));
        assert!(say::instruction(payload.as_bytes(), Some(last)).is_ok(), "{payload}");
    }
}

fn texts(value: &Value) -> Vec<String> {
    match value {
        Value::String(text) => vec![text.clone()],
        Value::Array(items) => items.iter().flat_map(texts).collect(),
        Value::Object(fields) => fields.values().flat_map(texts).collect(),
        _ => Vec::new(),
    }
}
