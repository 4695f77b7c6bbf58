//! The example that teaches from Python, with other instructors beside it.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::AtomicU8;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use gestalt_link::{Client, LinkConfig, RobotConfig};
use gestalt_protocol::{Gesture, Instruction, Outcome};
use gestalt_tests::{Watched, agreed, config, learning, short_rounds, start_learning, unique};
use gestalt_trials::{Need, python};
use serde_json::{Value, json};
use tokio::time::timeout;
use zenoh::handlers::FifoChannelHandler;
use zenoh::pubsub::Subscriber;
use zenoh::sample::Sample;

const PATIENCE: Duration = Duration::from_secs(60);

/// Longer than a request to open a round may be a copy of the one before.
const BETWEEN: Duration = Duration::from_millis(700);

/// `teach.py`, with the test as its person.
struct Teacher {
    program: Child,
    keyboard: ChildStdin,
    lines: Receiver<String>,
}

impl Teacher {
    fn start(python: &str, swarm: &str, endpoint: &str) -> Self {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/teach.py");
        let mut command = Command::new(python);
        command.arg(script).args(["--connect", endpoint, "--swarm", swarm]);
        let mut program = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let (keyboard, screen) = (program.stdin.take().unwrap(), program.stdout.take().unwrap());
        let (line, lines) = channel();
        std::thread::spawn(move || {
            for shown in BufReader::new(screen).lines().map_while(Result::ok) {
                if line.send(shown).is_err() {
                    break;
                }
            }
        });
        Self { program, keyboard, lines }
    }

    /// The next line that it shows in which that stands.
    fn shows(&self, part: &str) -> String {
        loop {
            let shown = self.lines.recv_timeout(PATIENCE).unwrap_or_else(|error| panic!("{part}: {error}"));
            eprintln!("teach.py: {shown}");
            if shown.contains(part) {
                return shown;
            }
        }
    }

    fn is_told(&mut self, gesture: &str) {
        writeln!(self.keyboard, "{gesture}").expect("it waits for its person");
    }
}

impl Drop for Teacher {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}

/// The counter of the round that the next lesson is about.
async fn lesson(said: &Subscriber<FifoChannelHandler<Sample>>) -> Value {
    let lesson = async {
        loop {
            let word: Value =
                serde_json::from_slice(&said.recv_async().await.unwrap().payload().to_bytes()).unwrap();
            if word["say"] == "was" {
                return word["round"]["counter"].clone();
            }
        }
    };
    timeout(PATIENCE, lesson).await.expect("it teaches")
}

pub async fn a_word_from_python_is_about_the_round_that_was_opened_for_it() {
    let python = python(Need::ZENOH).expect("the trial needs it");
    let (swarm, shown) = (unique("python"), Arc::new(AtomicU8::new(4)));
    let mut robots: Vec<Watched> = Vec::new();
    for id in 1..=2 {
        let connect = robots.first().map_or_else(Vec::new, |first| first.robot.locators().to_vec());
        let config = RobotConfig {
            mind: short_rounds(),
            learning: Some(learning(8, 1.0, None)),
            ..config(id, &swarm, &connect)
        };
        robots.push(start_learning(config, shown.clone()).await);
    }
    assert!(robots[0].sees_alive(1, PATIENCE).await);
    let locators = robots[0].robot.locators().to_vec();
    let link = LinkConfig { connect: locators.clone(), ..LinkConfig::default() };
    let client = Client::open(&swarm, &link).await.unwrap();
    let mut overhearing = zenoh::Config::default();
    for (key, value) in [
        ("mode", json!("client")),
        ("connect/endpoints", json!(locators)),
        ("scouting/multicast/enabled", json!(false)),
    ] {
        overhearing.insert_json5(key, &value.to_string()).unwrap();
    }
    let overhearing = zenoh::open(overhearing).await.unwrap();
    let said =
        overhearing.declare_subscriber(format!("gestalt/{swarm}/instructor/python/feedback")).await.unwrap();

    let mut teacher = Teacher::start(&python, &swarm, &locators[0]);
    assert!(teacher.shows("round ").starts_with("round 1: "));
    // While its person thinks, somebody else opens rounds, and a word of its name is answered that it did not say.
    for round in 2..=3 {
        tokio::time::sleep(BETWEEN).await;
        client.instruct(&"ada".parse().unwrap(), &Instruction::Open).await.unwrap();
        agreed(&mut robots, round, PATIENCE).await;
    }
    let other = Instruction::Retire { class: Gesture::Label("nonsense".to_owned()) };
    let refused = client.teach(&"python".parse().unwrap(), &other, PATIENCE).await.unwrap();
    assert_eq!(refused.map(|answer| answer.outcome), Some(Outcome::UnknownGesture));

    teacher.is_told("4");
    assert_eq!(lesson(&said).await, 1, "it was shown round 1");
    let answer = teacher.shows("samples of it");
    assert!(answer.contains(" learned, "), "{answer}");
    assert!(teacher.shows("round ").starts_with("round 4: "), "the one that it opened");
    teacher.is_told("4");
    assert_eq!(lesson(&said).await, 4);
    teacher.shows(" learned, ");

    drop(teacher);
    overhearing.close().await.unwrap();
    client.close().await;
    for robot in robots {
        robot.stop().await;
    }
}
