//! The page of a swarm: what it shows and does is what the swarm says and hears.

use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::{Duration, Instant};

use gestalt_desk::{Address, Desk, Door};
use gestalt_link::{Client, Heard, LinkConfig, RobotConfig};
use gestalt_protocol::{Instruction, RobotId};
use gestalt_tests::{Browser, Process, Watched, config, learning, short_rounds, start_learning, unique};
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::task::block_in_place;
use tokio::time::timeout;

const PATIENCE: Duration = Duration::from_secs(30);

/// Robots that learn on a line, what is in front of all cameras, and their page.
struct School {
    swarm: String,
    robots: Vec<Watched>,
    link: LinkConfig,
    shown: Arc<AtomicU8>,
    desk: Desk,
}

impl School {
    async fn start(robots: u32, name: impl Fn(u32) -> String) -> Self {
        let swarm = unique("page");
        let shown = Arc::new(AtomicU8::new(3));
        let mut line: Vec<Watched> = Vec::new();
        for id in 0..robots {
            let connect: Vec<String> =
                line.last().map(|it| it.robot.locators()[0].clone()).into_iter().collect();
            let config = RobotConfig {
                name: name(id),
                mind: short_rounds(),
                learning: Some(learning(3, 0.5, None)),
                ..config(id, &swarm, &connect)
            };
            line.push(start_learning(config, shown.clone()).await);
        }
        for robot in &line {
            assert!(robot.sees_alive(robots as usize - 1, PATIENCE).await, "all know all");
        }
        let link = LinkConfig { connect: line[0].robot.locators().to_vec(), ..LinkConfig::default() };
        let desk = desk(&swarm, &link, 0).await;
        Self { swarm, robots: line, link, shown, desk }
    }

    async fn client(&self) -> Client {
        Client::open(&self.swarm, &self.link).await.unwrap()
    }

    async fn end(self) {
        self.desk.close().await;
        for robot in self.robots {
            robot.stop().await;
        }
    }
}

pub async fn desk(swarm: &str, link: &LinkConfig, port: u16) -> Desk {
    let door = Door::at(port.to_string().parse::<Address>().unwrap());
    Desk::open(Client::open(swarm, link).await.unwrap(), swarm, door).await.unwrap()
}

/// Whoever reads the page's events, by a plain connection.
pub struct Reader {
    stream: TcpStream,
    read: String,
    host: String,
}

impl Reader {
    pub async fn open(desk: &Desk) -> Self {
        let host = desk.address().to_string();
        let mut stream = TcpStream::connect(&host).await.unwrap();
        let request = format!("GET /events HTTP/1.1\r\nHost: {host}\r\n\r\n");
        stream.write_all(request.as_bytes()).await.unwrap();
        Self { stream, read: String::new(), host }
    }

    /// Waits until the newest event of that name is as `pick` says; what came before is passed over.
    async fn wait(&mut self, name: &str, pick: impl Fn(&Value) -> bool) -> Value {
        let mark = format!("event: {name}\ndata: ");
        let deadline = tokio::time::Instant::now() + PATIENCE;
        let mut bytes = vec![0; 65536];
        loop {
            let found = self.read.rfind(&mark).map(|at| &self.read[at + mark.len()..]);
            let found = found.and_then(|rest| serde_json::from_str::<Value>(rest.split_once("\n\n")?.0).ok());
            if let Some(found) = found.filter(&pick) {
                return found;
            }
            let read = tokio::time::timeout_at(deadline, self.stream.read(&mut bytes)).await;
            let length = read.unwrap_or_else(|_| panic!("no such {name} in {}", self.read)).unwrap();
            assert!(length > 0, "the page closed");
            // Parts of events are told in chunks of HTTP, whose lengths stand on lines of their own.
            self.read.push_str(&String::from_utf8_lossy(&bytes[..length]));
        }
    }

    pub async fn say(&self, word: &Value) -> Value {
        let (mut stream, body) = (TcpStream::connect(&self.host).await.unwrap(), word.to_string());
        let request = format!(
            "POST /say HTTP/1.1\r\nHost: {}\r\nContent-Type: application/json\r\nConnection: close\r\nContent-Length: {}\r\n\r\n{body}",
            self.host,
            body.len()
        );
        stream.write_all(request.as_bytes()).await.unwrap();
        let mut answer = String::new();
        timeout(PATIENCE, stream.read_to_string(&mut answer)).await.unwrap().unwrap();
        let body = answer.split_once("\r\n\r\n").unwrap().1;
        serde_json::from_str(body).unwrap_or_else(|error| panic!("{error}: {answer}"))
    }
}

pub async fn what_the_page_shows_and_says_is_what_the_swarm_says_and_hears() {
    let school = School::start(4, |id| format!("robot {id}")).await;
    let client = school.client().await;
    let (mut decisions, mut news) = (client.decisions().await.unwrap(), client.news().await.unwrap());
    let mut page = Reader::open(&school.desk).await;
    let all = |swarm: &Value| swarm["robots"].as_array().is_some_and(|robots| robots.len() == 4);
    let swarm = page.wait("swarm", |swarm| all(swarm) && swarm["robots"][3]["name"] != "").await;
    assert_eq!(swarm["vocabulary"], json!(["0", "1", "2", "3", "4", "5"]));
    // Look: the page shows what Zenoh says.
    page.say(&json!({"say": "open"})).await;
    let announced = timeout(PATIENCE, decisions.next()).await.unwrap().unwrap().unwrap();
    let announced = serde_json::to_value(&announced).unwrap();
    let shown = page.wait("decision", |shown| shown["round"] == announced["round"]).await;
    for field in ["class", "confidence", "final", "author", "label"] {
        assert_eq!(shown[field], announced[field], "{field}");
    }
    for field in ["robots", "quorum", "elapsed_ms", "rule"] {
        assert_eq!(shown[field], announced["certificate"][field], "{field}");
    }
    // That was 3: learned, and the curve begins.
    tokio::time::sleep(Duration::from_millis(500)).await;
    let began = Instant::now();
    let word = json!({"say": "was", "round": announced["round"], "class": "3"});
    let answer = page.say(&word).await;
    assert_eq!(answer["words"], "learned", "{answer}");
    let rounds = page.wait("rounds", |rounds| rounds["said"][0]["outcome"] == "learned").await;
    println!("learned and shown after {:?}", began.elapsed());
    assert_eq!(rounds["rounds"][0]["truth"], "3", "{rounds}");
    assert_eq!(rounds["curve"].as_array().map(Vec::len), Some(1));
    // A robot that is killed is gone from the page as its token is.
    let orders = json!({"id": 9, "swarm": school.swarm, "link": {"listen": ["tcp/127.0.0.1:0"], "connect": school.link.connect}});
    let mut killed = Process::start(Path::new(env!("CARGO_BIN_EXE_test-robot")), None, &orders);
    let is_there =
        |swarm: &Value| swarm["robots"].as_array().is_some_and(|all| all.iter().any(|it| it["id"] == 9));
    page.wait("swarm", is_there).await;
    killed.kill();
    let left = async { while news.next().await.expect("news") != Heard::Left(RobotId(9)) {} };
    timeout(PATIENCE, left).await.expect("its token goes");
    let gone = Instant::now();
    page.wait("swarm", |swarm| !is_there(swarm)).await;
    println!("gone {:?} after its token", gone.elapsed());
    assert!(gone.elapsed() < Duration::from_secs(2), "{:?}", gone.elapsed());
    client.close().await;
    school.end().await;
}

/// What the page makes of parts that its own server seldom writes so.
const SELDOM: &str = r##"(async () => {
  const told = (name, it) => take(`event: ${name}\ndata: ${JSON.stringify(it)}`);
  const words = (selector) => [...document.querySelectorAll(selector)].map((it) => it.textContent);
  const found = {};
  // These end lines, and JSON leaves them as they are.
  told("beat", { swarm: "a\u2028b\u2029c" });
  found.lines = $("swarm").textContent;
  take('event: rounds\ndata: {"rounds": [');
  told("beat", { swarm: "beside a bad part" });
  found.beside = $("swarm").textContent;

  const list = make("ol");
  for (let turn = 0; turn < 3; turn += 1) sync(list, ["a", "a"], (it) => it, () => make("li"), put);
  found.alike = list.children.length;
  const word = (at, word, more) => ({ instructor: "ada", at, round: null, word, gesture: "circle", of: null, words: "learned", ...more });
  const round = { counter: 7, opener: 0, life: 1 };
  const said = [word(6, "was", { round }), word(5, "was", { round }), word(4, "same", { of: "ring" }), word(3, "retire"), word(2, "new"), word(1, "open")];
  for (let turn = 0; turn < 3; turn += 1) told("rounds", { rounds: [], curve: [], said });
  found.said = words("#said li");

  const asks = (counter, gestures) => told("question", {
    round: { ...round, counter }, kind: "between", words: "?", gestures, answers: gestures, robot: 0,
  });
  asks(8, ["1", "2"]);
  $("replies").lastElementChild.click();
  found.others = words("#replies button");
  asks(9, ["1", "2"]);
  found.next = words("#replies button");
  asks(10, state.swarm.vocabulary);
  found.all = words("#replies button").includes("Neither");
  told("question", null);

  // Timers of one length end in their order: this one between those of the two rounds.
  const decided = (counter) => told("decision", { ...state.decision, round: { ...round, counter } });
  decided(1000);
  const between = new Promise((done) => setTimeout(() => done(settled), SETTLES));
  decided(1001);
  found.settled = await between;
  return found;
})()"##;

pub async fn a_browser_shows_teaches_and_says_when_it_is_no_longer_live() {
    const EVIL: &str = "<img src=x onerror=alert(1)>";
    let mut school =
        School::start(8, |id| if id == 3 { EVIL.to_owned() } else { format!("robot {id}") }).await;
    let client = school.client().await;
    let mut decisions = client.decisions().await.unwrap();
    let url = school.desk.url().to_owned();
    let began = Instant::now();
    let mut browser = block_in_place(|| Browser::open(&url));
    let mut see = |expression: &str| block_in_place(|| browser.wait(expression, PATIENCE));
    see(
        "document.querySelectorAll('#robots > details').length === 8 && document.querySelector('#live').textContent === 'Live'",
    );
    println!("eight robots shown {:?} after the browser began to start", began.elapsed());
    see(&format!("document.querySelector('#robots').textContent.includes({})", json!(EVIL)));
    school.shown.store(3, Ordering::Relaxed);
    block_in_place(|| browser.press("#look"));
    let announced = timeout(PATIENCE, decisions.next()).await.unwrap().unwrap().unwrap();
    let label = announced.label.clone().unwrap_or_else(|| "undecided".to_owned());
    let shown = format!("document.querySelector('#gesture').textContent === {}", json!(label));
    let mut see = |expression: &str| block_in_place(|| browser.wait(expression, PATIENCE));
    see(&shown);
    see(&format!(
        "document.querySelector('#facts').textContent.includes('round {},')",
        announced.decision.round.counter
    ));
    tokio::time::sleep(Duration::from_millis(500)).await;
    block_in_place(|| browser.press("#gestures [data-key='3']"));
    let mut see = |expression: &str| block_in_place(|| browser.wait(expression, PATIENCE));
    let took = see("document.querySelector('#answer').textContent.includes('learned')");
    println!("learned {took:?} after the button");
    see("document.querySelector('#curve-words').textContent.includes('the swarm in')");
    // Undo takes back what was said last, and not what was decided since.
    let first = announced.decision.round.counter;
    client.instruct(&"ada".parse().unwrap(), &Instruction::Open).await.unwrap();
    let next = loop {
        let next =
            timeout(PATIENCE, decisions.next()).await.unwrap().unwrap().unwrap().decision.round.counter;
        if next > first {
            break next;
        }
    };
    let mut see = |expression: &str| block_in_place(|| browser.wait(expression, PATIENCE));
    see(&format!("document.querySelector('#facts').textContent.includes('round {next},')"));
    tokio::time::sleep(Duration::from_millis(500)).await;
    block_in_place(|| browser.press("#undo"));
    let mut see = |expression: &str| block_in_place(|| browser.wait(expression, PATIENCE));
    see(&format!("document.querySelector('#answer').textContent.startsWith('Round {first}: ')"));
    let markup =
        block_in_place(|| browser.evaluate("document.querySelectorAll('img, script:not([src])').length"));
    assert_eq!(markup, 0, "a name became a part of the page");
    let complaints = block_in_place(|| browser.complaints());
    assert!(complaints.is_empty(), "{complaints:#?}");
    let found = block_in_place(|| browser.evaluate(SELDOM));
    let expected = json!({
        "lines": "a\u{2028}b\u{2029}c",
        "beside": "beside a bad part",
        "alike": 2,
        "said": [
            "ada, round 7“it was circle” → learned",
            "ada, round 7“it was circle” → learned",
            "ada“circle is ring” → learned",
            "ada“circle is shown no more” → learned",
            "ada“circle is a new one” → learned",
            "ada“look” → learned",
        ],
        "others": ["0", "3", "4", "5"],
        "next": ["1", "2", "Neither"],
        "all": false,
        "settled": false,
    });
    assert_eq!(found, expected);
    let complaints = block_in_place(|| browser.complaints());
    assert_eq!(complaints.len(), 1, "of the bad part alone: {complaints:#?}");
    // The server goes, and comes back.
    let port = school.desk.address().port();
    school.desk.close().await;
    let began = Instant::now();
    let mut see = |expression: &str| block_in_place(|| browser.wait(expression, PATIENCE));
    see(
        "document.querySelector('#live').textContent === 'Not live' && !document.querySelector('#lost').hidden",
    );
    println!("not live {:?} after the server went", began.elapsed());
    assert!(began.elapsed() < Duration::from_secs(6), "{:?}", began.elapsed());
    school.desk = desk(&school.swarm, &school.link, port).await;
    see("document.querySelector('#live').textContent === 'Live' && document.querySelector('#lost').hidden");
    block_in_place(|| drop(browser));
    client.close().await;
    school.end().await;
}

pub async fn axe_finds_nothing_serious_on_the_page() {
    const SERIOUS: &str = "(async () => (await axe.run()).violations
        .filter(found => ['serious', 'critical'].includes(found.impact))
        .map(found => [found.id, found.help, found.nodes.map(node => node.html)]))()";
    let axe = std::fs::read_to_string(gestalt_trials::axe().expect("a trial that needs it")).unwrap();
    let school = School::start(4, |id| format!("robot {id}")).await;
    let url = school.desk.url().to_owned();
    let mut browser = block_in_place(|| Browser::open(&url));
    let is_there = "document.querySelectorAll('#robots > details').length === 4";
    block_in_place(|| browser.wait(is_there, PATIENCE));
    block_in_place(|| browser.press("#look"));
    let is_shown = "document.querySelector('#facts').textContent.includes('round 1,')";
    block_in_place(|| browser.wait(is_shown, PATIENCE));
    block_in_place(|| {
        browser.evaluate(&format!("{axe}; 1"));
        for (size, dark) in
            [(1280, 900), (390, 844)].into_iter().flat_map(|size| [(size, false), (size, true)])
        {
            // So the page stands in that window, as it stays.
            browser.picture(size, dark);
            assert_eq!(browser.evaluate(SERIOUS), json!([]), "{size:?}, dark: {dark}");
        }
    });
    block_in_place(|| drop(browser));
    school.end().await;
}

pub async fn metrics_are_read_by_promtool_and_by_python() {
    let school = School::start(3, |id| format!("robot {id}")).await;
    let mut page = Reader::open(&school.desk).await;
    page.say(&json!({"say": "open"})).await;
    page.wait("decision", |shown| shown["round"]["counter"] == 1).await;
    let get = async |accept: &str| {
        let mut stream = TcpStream::connect(&page.host).await.unwrap();
        let request = format!(
            "GET /metrics HTTP/1.0\r\nHost: {}\r\nAccept: {accept}\r\nConnection: close\r\n\r\n",
            page.host
        );
        stream.write_all(request.as_bytes()).await.unwrap();
        let mut answer = String::new();
        timeout(PATIENCE, stream.read_to_string(&mut answer)).await.unwrap().unwrap();
        answer.split_once("\r\n\r\n").unwrap().1.to_owned()
    };
    let said = piped("promtool", &["check", "metrics"], &get("text/plain").await);
    assert_eq!(said, "", "promtool is content");
    let read = "import sys\n\
        from prometheus_client.openmetrics.parser import text_string_to_metric_families as read\n\
        print(sum(sample.value for family in read(sys.stdin.read()) for sample in family.samples\n\
        if sample.name == 'gestalt_robot_events_total' and sample.labels['event'] == 'sent_vote'))";
    // What Python makes of them is what the robots count.
    let votes = |robots: &[Watched]| -> u64 {
        robots.iter().filter_map(|it| it.robot.status().counters.get("sent_vote").copied()).sum()
    };
    let python = gestalt_trials::python(&["prometheus_client"]).expect("a trial that needs it");
    let deadline = Instant::now() + PATIENCE;
    loop {
        let found = piped(&python, &["-c", read], &get("application/openmetrics-text").await);
        let counted = votes(&school.robots);
        if counted > 0 && found.trim().parse::<f64>() == Ok(counted as f64) {
            break;
        }
        assert!(Instant::now() < deadline, "Python reads {found}, robots count {counted}");
        tokio::time::sleep(Duration::from_millis(200)).await;
    }
    school.end().await;
}

/// What a program that is content says of what it reads.
fn piped(program: &str, words: &[&str], text: &str) -> String {
    let mut child = Command::new(program)
        .args(words)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap_or_else(|error| panic!("{program}: {error}"));
    std::io::Write::write_all(&mut child.stdin.take().expect("piped"), text.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{program}: {}", output.status);
    String::from_utf8(output.stdout).unwrap()
}
