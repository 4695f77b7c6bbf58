//! The server, asked by a plain TCP client: what it refuses, what it bears, and that it tells all readers the same.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, Instant};

use gestalt_protocol::{Instruction, RobotId, Status};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::mpsc;
use tokio::time::{sleep, timeout};

use super::*;
use crate::asks::{Ask, Asks};
use crate::board::Board;
use crate::door::{Address, Door, Gate, Limits, Token};
use crate::follow::Show;
use crate::known::Known;
use crate::view::Input;
use crate::view::tests::decided;

const SOON: Duration = Duration::from_secs(10);

/// A page without a swarm.
struct Page {
    address: SocketAddr,
    board: Arc<Board>,
    known: Arc<Known>,
    asks: mpsc::Receiver<Ask>,
}

/// Serves one; with a token it behaves as one that can be reached from elsewhere.
async fn page(token: Option<&str>, limits: Limits) -> Page {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let door = Door { limits, ..Door::at(Address::default()) };
    let (board, known) = (Arc::new(Board::new("test")), Arc::new(Known::new()));
    let (sender, asks) = Asks::new();
    let token = token.map(|token| Token::new(token).unwrap());
    let server = Server::new(&door, address, token, &board, known.clone(), sender);
    tokio::spawn(serve(
        Gate::new(listener, limits.connections, limits.patience),
        server,
        std::future::pending(),
    ));
    board.beat(known.now());
    Page { address, board, known, asks }
}

impl Page {
    async fn connect(&self) -> TcpStream {
        TcpStream::connect(self.address).await.unwrap()
    }

    /// Asks, and reads until the connection is closed.
    async fn ask(&self, request: &str, headers: &[(&str, &str)], body: &str) -> String {
        let mut stream = self.connect().await;
        stream.write_all(self.request(request, headers, body).as_bytes()).await.unwrap();
        let mut answer = Vec::new();
        timeout(SOON, stream.read_to_end(&mut answer)).await.expect("an answer").unwrap();
        String::from_utf8(answer).unwrap()
    }

    fn request(&self, request: &str, headers: &[(&str, &str)], body: &str) -> String {
        let mut text =
            format!("{request} HTTP/1.1\r\nConnection: close\r\nContent-Length: {}\r\n", body.len());
        if !headers.iter().any(|(name, _)| *name == "Host") {
            text += &format!("Host: {}\r\n", self.address);
        }
        headers.iter().for_each(|(name, value)| text += &format!("{name}: {value}\r\n"));
        text + "\r\n" + body
    }

    async fn status(&self, request: &str, headers: &[(&str, &str)], body: &str) -> u16 {
        code(&self.ask(request, headers, body).await)
    }

    /// A reader of events, and what it has read.
    async fn reader(&self) -> (TcpStream, String) {
        let mut stream = self.connect().await;
        stream.write_all(self.request("GET /events", &[], "").as_bytes()).await.unwrap();
        let mut read = String::new();
        read_until(&mut stream, &mut read, |read| read.contains("event: beat") || code(read) >= 400).await;
        (stream, read)
    }
}

fn code(answer: &str) -> u16 {
    answer.split(' ').nth(1).and_then(|code| code.parse().ok()).unwrap_or_default()
}

async fn read_until(stream: &mut TcpStream, read: &mut String, done: impl Fn(&str) -> bool) {
    let mut bytes = vec![0; 65536];
    while !done(read) {
        let length = timeout(SOON, stream.read(&mut bytes)).await.expect("more to read").unwrap();
        assert!(length > 0, "closed after {read}");
        read.push_str(&String::from_utf8_lossy(&bytes[..length]));
    }
}

#[tokio::test]
async fn names_and_origins_of_others_are_refused_whatever_is_asked() {
    let page = page(None, Limits::default()).await;
    let port = page.address.port();
    for request in ["GET /", "GET /events", "GET /metrics", "POST /say", "GET /nothing"] {
        for host in
            ["evil.example", &format!("evil.example:{port}"), "192.168.1.5", "localhost.evil.example", ""]
        {
            assert_eq!(page.status(request, &[("Host", host)], "").await, 403, "{request} as '{host}'");
        }
        let twice = [("Host", "localhost"), ("Host", "evil.example")];
        assert!([400, 403].contains(&page.status(request, &twice, "").await), "{request} under two names");
        for origin in ["http://evil.example", "null", "http://127.0.0.1:1", "https://localhost"] {
            assert_eq!(page.status(request, &[("Origin", origin)], "").await, 403, "{request} from {origin}");
        }
    }
    for host in [
        "localhost".to_owned(),
        format!("localhost:{port}"),
        format!("[::1]:{port}"),
        format!("127.0.0.1:{port}"),
    ] {
        let own = format!("http://{host}");
        assert_eq!(page.status("GET /", &[("Host", &host), ("Origin", &own)], "").await, 200, "{host}");
    }
}

#[tokio::test]
async fn without_the_token_nothing_of_the_swarm_is_shown_or_done() {
    const TOKEN: &str = "a-token-of-somebodys-own";
    let mut page = page(Some(TOKEN), Limits::default()).await;
    for request in ["GET /events", "GET /metrics", "GET /decision.json", "POST /say"] {
        for given in
            [None, Some("Bearer a-token-of-somebody-else"), Some(TOKEN), Some("Bearer "), Some("Basic YTpi")]
        {
            let headers: Vec<_> = given.map(|given| ("Authorization", given)).into_iter().collect();
            let body = r#"{"say":"open"}"#;
            assert_eq!(page.status(request, &headers, body).await, 401, "{request} with {given:?}");
        }
    }
    assert!(page.asks.try_recv().is_err(), "nothing was said to the swarm");
    let bearer = format!("Bearer {TOKEN}");
    assert_eq!(page.status("GET /metrics", &[("Authorization", &bearer)], "").await, 200);
    assert_eq!(page.status("GET /", &[], "").await, 200, "the page itself tells nothing");
}

#[tokio::test]
async fn every_answer_forbids_what_the_page_does_not_need() {
    let page = page(None, Limits::default()).await;
    page.known.hear(Input::Came(RobotId(1)));
    for request in
        ["GET /", "GET /page.js", "GET /page.css", "GET /icon.svg", "GET /metrics", "GET /none", "POST /say"]
    {
        let answer = page.ask(request, &[], "").await.to_ascii_lowercase();
        let (head, _) = answer.split_once("\r\n\r\n").unwrap();
        for header in [
            "content-security-policy: default-src 'none'; script-src 'self'; style-src 'self';",
            "x-content-type-options: nosniff",
            "referrer-policy: no-referrer",
            "cross-origin-resource-policy: same-origin",
        ] {
            assert!(head.contains(header), "{request}: {header} is not in {head}");
        }
        assert!(!head.contains("unsafe") && !head.contains("access-control"), "{head}");
    }
}

#[test]
fn the_page_is_small_and_asks_nobody_else_and_writes_no_html() {
    let all: String = files::FILES.iter().map(|(_, _, content)| *content).collect();
    assert!(all.len() < 100_000, "{} bytes", all.len());
    let addresses: Vec<_> =
        all.match_indices("http").map(|(at, _)| &all[at..(at + 26).min(all.len())]).collect();
    assert!(
        addresses.iter().all(|address| address.starts_with("http://www.w3.org/2000/svg")),
        "{addresses:?}"
    );
    for forbidden in
        ["innerHTML", "outerHTML", "insertAdjacent", "document.write", "eval(", " style=\"", "onclick="]
    {
        assert!(!all.contains(forbidden), "{forbidden}");
    }
}

#[tokio::test]
async fn a_reader_gets_what_there_is_and_then_what_changes() {
    let page = page(None, Limits::default()).await;
    let (mut stream, mut read) = page.reader().await;
    assert!(read.to_ascii_lowercase().contains("content-type: text/event-stream"), "{read}");
    page.known.hear(Input::Came(RobotId(7)));
    page.known.with(|view, now| page.board.show(view, now));
    read_until(&mut stream, &mut read, |read| read.contains(r#""id":7"#)).await;
    let swarms = read.matches("event: swarm").count();
    page.known.with(|view, now| page.board.show(view, now));
    page.board.beat(page.known.now());
    let beats = read.matches("event: beat").count();
    read_until(&mut stream, &mut read, |read| read.matches("event: beat").count() > beats).await;
    assert_eq!(read.matches("event: swarm").count(), swarms, "what has not changed is not told again");
}

#[tokio::test]
async fn a_word_is_passed_on_as_it_was_said_and_what_is_none_is_refused() {
    let mut page = page(None, Limits::default()).await;
    let json = ("Content-Type", "application/json");
    let origin = format!("http://{}", page.address);
    for (body, kind, expected) in [
        (r#"{"say":"open"}"#, "text/plain", 415),
        (r#"{"say":"open"}"#, "application/x-www-form-urlencoded", 415),
        ("{", "application/json", 400),
        (r#"{"say":"dance"}"#, "application/json", 400),
        (&"x".repeat(5000), "application/json", 413),
    ] {
        assert_eq!(
            page.status("POST /say", &[("Content-Type", kind)], body).await,
            expected,
            "{kind} {body:.20}"
        );
    }
    assert!(page.asks.try_recv().is_err(), "nothing was said to the swarm");
    let said = tokio::spawn(async move {
        let ask = page.asks.recv().await.unwrap();
        ask.answer.send(Ok(None)).unwrap();
        (page, ask.instruction)
    });
    let mut stream = TcpStream::connect(&origin[7..]).await.unwrap();
    let body = r#"{"say":"open"}"#;
    let request = format!(
        "POST /say HTTP/1.1\r\nHost: {}\r\nOrigin: {origin}\r\n{}: {}\r\nContent-Length: {}\r\nConnection: close\r\n\r\n{body}",
        &origin[7..],
        json.0,
        json.1,
        body.len()
    );
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = String::new();
    timeout(SOON, stream.read_to_string(&mut answer)).await.unwrap().unwrap();
    assert_eq!(code(&answer), 200, "{answer}");
    let (page, said) = said.await.unwrap();
    assert_eq!(said, Instruction::Open);
    assert_eq!(page.status("GET /decision.json", &[], "").await, 404, "nothing was decided yet");
}

#[tokio::test]
async fn the_latest_decision_is_given_as_it_was_announced() {
    let page = page(None, Limits::default()).await;
    for counter in [2, 3] {
        let announced = decided(counter, Some(2), &[2, 2, 1]);
        page.known.hear(Input::Decided(Box::new(announced.clone())));
        let answer = page.ask("GET /decision.json", &[], "").await;
        let (_, body) = answer.split_once("\r\n\r\n").unwrap();
        assert_eq!(body, serde_json::to_string(&announced).unwrap());
    }
}

#[tokio::test]
async fn five_hundred_readers_that_never_read_are_bounded_and_cost_the_others_nothing() {
    let limits = Limits { connections: 40, readers: 20, patience: Duration::from_secs(6) };
    let page = page(None, limits).await;
    let (mut good, mut read) = page.reader().await;
    let mut idle = Vec::new();
    for _ in 0..500 {
        let mut stream = page.connect().await;
        // Whoever came too late is closed already.
        let _ = stream.write_all(page.request("GET /events", &[], "").as_bytes()).await;
        idle.push(stream);
    }
    sleep(Duration::from_millis(300)).await;
    assert!(page.board.readers() <= 20, "{} readers", page.board.readers());
    // Much is told, more than the system takes for those that do not read.
    let mut told = Status::new(RobotId(1), "x".to_owned(), 1);
    page.known.hear(Input::Came(RobotId(1)));
    let errors = vec![gestalt_protocol::Reported { at_ms: 1, what: "y".repeat(400) }; 16];
    told.errors = errors;
    let began = Instant::now();
    let mut slowest = Duration::ZERO;
    for boot in 0..1500 {
        told.boot = boot;
        page.known.hear(Input::Status(Box::new(told.clone())));
        let told = Instant::now();
        page.known.with(|view, now| page.board.show(view, now));
        let mark = format!(r#""boot":{boot},"#);
        read_until(&mut good, &mut read, |read| read.contains(&mark)).await;
        slowest = slowest.max(told.elapsed());
        read.clear();
        read.push_str("HTTP/1.1 200 ");
    }
    assert!(slowest < Duration::from_secs(3), "a reader that reads waited {slowest:?}");
    // Those that took nothing for so long are gone, and there is room again.
    while page.board.readers() > 1 {
        assert!(
            began.elapsed() < Duration::from_secs(120),
            "{} readers are still there",
            page.board.readers()
        );
        page.board.beat(page.known.now());
        read_until(&mut good, &mut read, |read| read.contains("event: beat")).await;
        read.truncate(13);
        sleep(Duration::from_millis(100)).await;
    }
    drop(idle);
}

#[tokio::test]
async fn a_connection_on_which_nothing_moves_is_closed() {
    let limits = Limits { patience: Duration::from_millis(300), ..Limits::default() };
    let page = page(None, limits).await;
    let mut stream = page.connect().await;
    stream.write_all(b"GET / HTTP/1.1\r\nHost: ").await.unwrap();
    let mut rest = Vec::new();
    timeout(SOON, stream.read_to_end(&mut rest)).await.expect("it is closed").ok();
}

#[tokio::test]
async fn metrics_are_the_counters_that_robots_report() {
    let page = page(None, Limits::default()).await;
    let mut status = Status::new(RobotId(3), "three \"\n".to_owned(), 1);
    status.counters = [("sent_vote".to_owned(), 41), ("refused_vote_stale".to_owned(), 2)].into();
    page.known.hear(Input::Came(RobotId(3)));
    page.known.hear(Input::Status(Box::new(status)));
    let text = page.ask("GET /metrics", &[], "").await;
    for line in [
        "gestalt_robots 1",
        r#"gestalt_robot_events_total{robot="3",event="sent_vote"} 41"#,
        r#"gestalt_robot_events_total{robot="3",event="refused_vote_stale"} 2"#,
        r#"gestalt_camera_state{robot="3",state="none"} 1"#,
        "# TYPE gestalt_robot_events counter",
        r#"gestalt_decision_seconds_bucket{le="+Inf"} 0"#,
        "gestalt_decision_seconds_count 0",
        "# EOF",
    ] {
        assert!(text.lines().any(|found| found.starts_with(line)), "{line} is not in {text}");
    }
    let old = page.ask("GET /metrics", &[("Accept", "text/plain")], "").await;
    for line in [
        "# TYPE gestalt_robot_events_total counter",
        "# HELP gestalt_robot_events_total What",
        "# TYPE gestalt_robots gauge",
    ] {
        assert!(old.lines().any(|found| found.starts_with(line)), "{line} is not in {old}");
    }
    assert!(!old.contains("# EOF") && !old.contains("# UNIT"), "{old}");
}

#[tokio::test]
async fn the_dashboard_asks_for_metrics_that_there_are() {
    let page = page(None, Limits::default()).await;
    let text = page.ask("GET /metrics", &[], "").await;
    let dashboard = include_str!("../../../../docs/grafana.json");
    let asked = dashboard.split(|c: char| !c.is_ascii_lowercase() && c != '_');
    let asked: std::collections::BTreeSet<_> = asked.filter(|word| word.starts_with("gestalt_")).collect();
    assert!(asked.len() > 8, "{asked:?}");
    for name in asked {
        let family = name.trim_end_matches("_total").trim_end_matches("_bucket");
        assert!(text.contains(&format!("# TYPE {family} ")), "{name}");
    }
}

#[test]
fn a_hundred_robots_cost_a_small_part_of_a_core() {
    let (board, known) = (Board::new("test"), Known::new());
    let _reader = board.reader();
    let mut statuses: Vec<Status> =
        (0..100).map(|robot| Status::new(RobotId(robot), format!("robot {robot}"), 1)).collect();
    for status in &mut statuses {
        known.hear(Input::Came(status.robot));
        status.neighbours = (0..4).map(|k| RobotId((status.robot.0 + k) % 100)).collect();
        status.counters = (0..40).map(|k| (format!("counter_{k}"), k)).collect();
    }
    // What a busy second brings: all statuses, and news all the time. The machine may be busy with other things, so the
    // fastest of some counts.
    let second = |turn: u32| {
        let began = Instant::now();
        for show in 0..10 {
            for status in statuses.iter_mut().skip(show * 10).take(10) {
                status.camera.fps = turn as f32;
                known.hear(Input::Status(Box::new(status.clone())));
            }
            known.with(|view, now| board.show(view, now));
        }
        began.elapsed()
    };
    let fastest = (0..20).map(second).min().unwrap();
    assert!(fastest < Duration::from_millis(100), "{fastest:?} of each second");
}
