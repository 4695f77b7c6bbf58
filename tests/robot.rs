//! A robot as a process, for the scenarios: it reads orders on stdin and prints what happens as a line of JSON
//! each. Its argument is one JSON object.

mod lies;

use std::io::{BufRead, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use gestalt_link::boot_number;
use gestalt_link::{Client, Event, LinkConfig, Robot, RobotConfig};
use gestalt_peer::center::Center;
use gestalt_peer::config::ModelSection;
use gestalt_peer::stream::{Sender, StreamEvent};
use gestalt_protocol::{ClassId, Decision, Gesture, Instruction, RobotId};
use gestalt_strategies::MindConfig;
use gestalt_tests::{
    Fixed, center_config, config, gesture, learning, look, seal, sender_config, short_rounds, with_eve,
};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde_json::{Value, json};
use tokio::sync::mpsc;
use tokio::time::Instant;

fn main() {
    let orders: Value = std::env::args()
        .nth(1)
        .and_then(|text| serde_json::from_str(&text).ok())
        .expect("one argument: {\"id\": 1, \"swarm\": \"demo\", \"link\": {…}, \"sees\": 3}");
    let (lines, stdin) = mpsc::channel(16);
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines().map_while(Result::ok) {
            if lines.blocking_send(line).is_err() {
                break;
            }
        }
    });
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .expect("threads for the robot");
    runtime.block_on(run(&orders, stdin));
}

async fn run(orders: &Value, mut stdin: mpsc::Receiver<String>) {
    // {"serve": {…}}: a fusion centre; {"stream": {…}}: a camera whose frames are looked at elsewhere.
    if orders["serve"].is_object() {
        return serve(orders, stdin).await;
    }
    if orders["stream"].is_object() {
        return stream(orders, stdin).await;
    }
    // {"lies": true, "members": 20}: one of a sealed swarm, and what it says is not true.
    if orders["lies"] == json!(true) {
        return lies::run(orders, stdin).await;
    }
    let id = orders["id"].as_u64().and_then(|id| u32::try_from(id).ok()).expect("\"id\": a number");
    let swarm = orders["swarm"].as_str().expect("\"swarm\": a name");
    let link: LinkConfig = serde_json::from_value(orders["link"].clone()).expect("\"link\": a LinkConfig");
    let boot = orders["boot"].as_u64().and_then(|boot| u32::try_from(boot).ok()).unwrap_or(1);
    let sees = orders["sees"].as_u64().and_then(|class| u32::try_from(class).ok()).map(ClassId);
    let p = orders["p"].as_f64().map_or(0.9, |p| p as f32);
    let quorum = serde_json::from_value(orders["quorum"].clone()).unwrap_or(MindConfig::default().quorum);
    // {"learn": {"keep": 3, "share": 0.5, "memory": "FILE", "poison": {}}}: learns what it is shown and told, believing others as the configuration says.
    let learning = orders["learn"]["keep"].as_u64().map(|keep| {
        let keep = usize::try_from(keep).expect("\"keep\": a number");
        let share = orders["learn"]["share"].as_f64().expect("\"share\": a part");
        let mut learning = learning(keep, share, orders["learn"]["memory"].as_str().map(PathBuf::from));
        if !orders["learn"]["poison"].is_null() {
            learning.config.poison =
                serde_json::from_value(orders["learn"]["poison"].clone()).expect("\"poison\": a defence");
        }
        learning
    });
    // {"rounds": {"deadline": "2s"}}: otherwise as by the default configuration, whether or not it learns.
    let rounds = match &orders["rounds"] {
        Value::Null if learning.is_some() => short_rounds(),
        Value::Null => MindConfig::default(),
        rounds => serde_json::from_value(rounds.clone()).expect("\"rounds\": how it takes part"),
    };
    let mind = MindConfig { quorum, ..rounds };
    let refractory = mind.refractory;
    let learns = learning.is_some();
    // {"members": 20}: of a sealed swarm of so many.
    let members = orders["members"].as_u64().and_then(|members| u32::try_from(members).ok());
    let seal = members.map(|members| seal(id, &with_eve(swarm, members)));
    let robot = match Robot::start(RobotConfig { link, boot, mind, learning, seal, ..config(id, swarm, &[]) })
        .await
    {
        Ok(robot) => robot,
        Err(error) => {
            eprintln!("{error}");
            std::process::exit(1);
        }
    };
    let mut events = robot.events();
    if sees.is_some() && !learns {
        robot.learned(Arc::new(Fixed::default()), "fixed");
    }
    say(id, json!({"event": "started", "locators": robot.locators()}));
    let mut rng = ChaCha8Rng::seed_from_u64(u64::from(id) << 32 | u64::from(std::process::id()));
    let mut sees = sees;
    let period = Duration::from_millis(if learns { 20 } else { 100 });
    let mut frames = tokio::time::interval(period);
    frames.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    let mut open = false;
    let mut last = None;
    // A request to open a round right after the newest began counts as a copy of that one's: this one waits until it does not.
    let mut heard_of_a_round = None;
    let mut asked = false;
    loop {
        let refractory_until = heard_of_a_round.map_or_else(Instant::now, |at: Instant| at + refractory);
        tokio::select! {
            event = events.recv() => {
                let Ok(event) = event else { continue };
                if matches!(event, Event::Opened(_) | Event::Held(_)) {
                    heard_of_a_round = Some(Instant::now());
                }
                match &event {
                    Event::Held(decision) => last = Some(decision.round),
                    Event::Opened(_) => open = true,
                    Event::Closed(_) => open = false,
                    _ => {}
                }
                say(id, described(&event));
            }
            _ = frames.tick(), if open => {
                if let Some(class) = sees {
                    robot.observe(if learns { gesture(class, &mut rng) } else { look(class, p) });
                }
            }
            () = tokio::time::sleep_until(refractory_until), if asked => {
                asked = false;
                robot.open_round();
            }
            line = stdin.recv() => match line.as_deref() {
                Some("open") => asked = true,
                // `shown 3`: what is in front of its camera from now on.
                Some(order) if order.starts_with("shown ") => {
                    sees = order["shown ".len()..].parse().ok().map(ClassId);
                }
                // `was 3`: a client says so of the last round.
                Some(order) if order.starts_with("was ") => {
                    let class = order["was ".len()..].parse().map(ClassId).expect("a class");
                    if let Some(round) = last {
                        let was = Instruction::Was { round, class: Gesture::Class(class) };
                        teach(id, swarm.to_owned(), robot.locators().to_vec(), "ada", was);
                    }
                }
                // `says bob {"say": "new", "label": "circle"}`: a client says so in that name.
                Some(order) if order.starts_with("says ") => {
                    let (by, word) = order["says ".len()..].split_once(' ').expect("a name and a word");
                    let word = serde_json::from_str(word).expect("an instruction");
                    teach(id, swarm.to_owned(), robot.locators().to_vec(), by, word);
                }
                Some("status") => say(id, json!({"event": "status", "status": robot.status()})),
                _ => break,
            },
        }
    }
    robot.stop().await;
}

/// Runs a fusion centre with the classifier of a file.
async fn serve(orders: &Value, mut stdin: mpsc::Receiver<String>) {
    let config = center_config(orders);
    let model = ModelSection::File(orders["serve"]["model"].as_str().expect("\"model\": a file").into());
    let model = gestalt_peer::model::load(&model).expect("a model").expect("a model");
    let boot = boot_number(SystemTime::now());
    let center = Center::start(&config, model, boot).await.expect("the centre starts");
    let id = config.robot.id.0;
    let mut events = center.robot().events();
    say(id, json!({"event": "started", "locators": center.robot().locators()}));
    loop {
        tokio::select! {
            event = events.recv() => {
                if let Ok(event) = event {
                    say(id, described(&event));
                }
            }
            line = stdin.recv() => match line.as_deref() {
                Some("open") => center.robot().open_round(),
                Some("status") => {
                    let (status, served) = (center.robot().status(), center.served());
                    say(id, json!({"event": "status", "status": status, "served": served}));
                }
                _ => break,
            },
        }
    }
    center.stop().await;
}

/// Streams the pictures of a folder.
async fn stream(orders: &Value, mut stdin: mpsc::Receiver<String>) {
    let (config, feed) = sender_config(orders);
    let id = config.robot.0;
    let sender = Sender::start(config, feed).expect("a thread for the camera");
    say(id, json!({"event": "started"}));
    let sending = sender.run(|event| match event {
        StreamEvent::Attached => say(id, json!({"event": "attached"})),
        StreamEvent::Detached { cause } => say(id, json!({"event": "detached", "cause": cause})),
        StreamEvent::Failed { cause, .. } => say(id, json!({"event": "failed", "cause": cause})),
        StreamEvent::Decided(announced) => say(id, outcome("announced", &announced.decision)),
        StreamEvent::Count { sent, taken, .. } => {
            say(id, json!({"event": "count", "sent": sent, "taken": taken}));
        }
    });
    tokio::select! {
        ended = sending => ended.expect("a camera that goes on for ever"),
        _ = stdin.recv() => {}
    }
}

/// Attaches a client to this robot for as long as it takes to say what the gesture of a round was.
fn teach(id: u32, swarm: String, connect: Vec<String>, by: &str, word: Instruction) {
    let by = by.parse().expect("a name");
    // Who has no key is let in by TCP alone, on the robot's own computer.
    let connect = connect.into_iter().filter(|locator| locator.starts_with("tcp/")).collect();
    tokio::spawn(async move {
        let link = LinkConfig { connect, ..LinkConfig::default() };
        let client = Client::open(&swarm, &link).await.expect("the robot listens");
        // On a loaded machine links break, and words are lost with them.
        let mut answer = Ok(None);
        for _ in 0..3 {
            answer = client.teach(&by, &word, Duration::from_secs(8)).await;
            if !matches!(answer, Ok(None)) {
                break;
            }
        }
        client.close().await;
        eprintln!("{by} said {word:?}: {:?}", answer.map(|answer| answer.map(|answer| answer.outcome)));
        say(id, json!({"event": "said"}));
    });
}

fn described(event: &Event) -> Value {
    match event {
        Event::Opened(round) => json!({"event": "opened", "round": round.counter}),
        Event::Closed(round) => json!({"event": "closed", "round": round.counter}),
        Event::Held(decision) => outcome("held", decision),
        Event::Announced(announcement) => outcome("announced", &announcement.decision),
        Event::Asked(question) => json!({"event": "asked", "question": question}),
        Event::Neighbours(robots) => json!({"event": "neighbours", "robots": ids(robots)}),
        Event::Shared(samples) => json!({"event": "shared", "samples": samples}),
        Event::Answered(_, answer) => json!({"event": "answered", "answer": answer}),
        Event::Remembered(revision) => json!({"event": "remembered", "revision": revision}),
        Event::Alive(robots) => json!({"event": "alive", "robots": ids(robots)}),
        Event::Failed { part, cause } => json!({"event": "failed", "part": part.name(), "cause": cause}),
        _ => json!({"event": "other"}),
    }
}

fn outcome(event: &str, decision: &Decision) -> Value {
    json!({
        "event": event,
        "round": decision.round.counter,
        "class": decision.class.map(|class| class.0),
        "author": decision.author.0,
        "votes": decision.certificate.votes.len(),
        "voters": ids(decision.certificate.votes.iter().map(|vote| &vote.robot)),
        "decision": decision,
    })
}

fn ids<'a>(robots: impl IntoIterator<Item = &'a RobotId>) -> Vec<u32> {
    robots.into_iter().map(|robot| robot.0).collect()
}

fn say(id: u32, mut what: Value) {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_millis());
    what["robot"] = json!(id);
    what["at_ms"] = json!(u64::try_from(now).unwrap_or(u64::MAX));
    let mut out = std::io::stdout().lock();
    // Whoever started the robot may be gone; then nobody reads.
    let _ = writeln!(out, "{what}").and_then(|()| out.flush());
}
