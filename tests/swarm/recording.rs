//! A real swarm on a recorder: what it said is in the file, and proves what it decided.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::{Duration, Instant};

use gestalt_link::{Client, LinkConfig, RobotConfig};
use gestalt_protocol::{ClassId, Gesture, Instruction, InstructorId};
use gestalt_tests::{Process, Watched, config, learning, short_rounds, start, start_learning, unique};
use serde_json::Value;

use crate::memory::SmallDisk;

const PATIENCE: Duration = Duration::from_secs(30);

fn gestalt(words: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_test-gestalt"));
    command.args(words);
    command
}

/// A recorder of that swarm, in a process of its own, that listens.
fn record(file: &Path, swarm: &str, endpoint: &str) -> Process {
    let file = file.to_str().unwrap();
    let recorder = Process::run(&mut gestalt(&["record", file, "--swarm", swarm, "-e", endpoint, "--json"]));
    let listens = |told: &[Value]| told.iter().any(|told| told["event"] == "recording").then_some(());
    recorder.wait(PATIENCE, listens).expect("it records");
    recorder
}

/// What the program says of a recording, and whether it is content with it.
fn replay(file: &Path, words: &[&str]) -> (Vec<Value>, bool) {
    let output = gestalt(&["replay", file.to_str().unwrap(), "--json"]).args(words).output().unwrap();
    let lines = String::from_utf8(output.stdout).unwrap();
    let told = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    eprint!("{}", String::from_utf8_lossy(&output.stderr));
    (told, output.status.success())
}

fn event<'a>(told: &'a [Value], name: &str) -> &'a Value {
    told.iter().find(|told| told["event"] == name).unwrap_or_else(|| panic!("no {name} in {told:#?}"))
}

/// What all robots have counted, by counter.
fn counters(robots: &[Watched]) -> BTreeMap<String, u64> {
    let mut all = BTreeMap::new();
    for robot in robots {
        for (name, count) in robot.robot.status().counters {
            *all.entry(name).or_default() += count;
        }
    }
    all
}

/// Robots on a line that learn, and a client of the first. The last one loses every third message that it should hear.
async fn learners(swarm: &str, n: u32, shown: &Arc<AtomicU8>) -> (Vec<Watched>, Client) {
    let mut robots: Vec<Watched> = Vec::new();
    for id in 0..n {
        let connect = robots.last().map(|before| before.robot.locators().to_vec()).unwrap_or_default();
        let mut config = RobotConfig {
            mind: short_rounds(),
            learning: Some(learning(3, 0.5, None)),
            ..config(id, swarm, &connect)
        };
        config.link.loss = if id + 1 == n { 0.33 } else { 0.0 };
        robots.push(start_learning(config, shown.clone()).await);
    }
    for robot in &robots {
        assert!(robot.sees_alive(n as usize - 1, PATIENCE).await);
    }
    let link = LinkConfig { connect: robots[0].robot.locators().to_vec(), ..LinkConfig::default() };
    let client = Client::open(swarm, &link).await.unwrap();
    (robots, client)
}

/// Shows a gesture for a round and says what it was; gives the count of the round.
async fn lesson(client: &Client, shown: &AtomicU8, class: u8) -> u32 {
    let ada: InstructorId = "ada".parse().unwrap();
    shown.store(class, Ordering::Relaxed);
    let mut news = client.news().await.unwrap();
    let before = client.last_decision(PATIENCE).await.unwrap().map(|last| last.decision.round.counter);
    client.instruct(&ada, &Instruction::Open).await.unwrap();
    let decided =
        tokio::time::timeout(PATIENCE, news.decision_after(before)).await.expect("a decision").unwrap();
    let round = decided.decision.round;
    let was = Instruction::Was { round, class: Gesture::Class(ClassId(class.into())) };
    client.teach(&ada, &was, Duration::from_secs(5)).await.unwrap();
    // A request that follows at once counts as a copy of the one before.
    tokio::time::sleep(Duration::from_millis(600)).await;
    round.counter
}

pub async fn a_run_with_faults_is_recorded_whole_proven_and_counted_otherwise() {
    const QUORUMS: [&str; 3] = ["majority", "3", "5"];
    let (folder, swarm) = (tempfile::tempdir().unwrap(), unique("tape"));
    let file = folder.path().join("run.mcap");
    let shown = Arc::new(AtomicU8::new(0));
    let (mut robots, client) = learners(&swarm, 5, &shown).await;
    let recorder = record(&file, &swarm, &robots[0].robot.locators()[0]);
    // Subscriptions travel along the line.
    tokio::time::sleep(Duration::from_secs(1)).await;
    let before = counters(&robots);
    let mut last = 0;
    // Until each gesture was shown they say, rightly, that they do not know.
    for class in [0, 1, 2, 3, 4, 5, 0, 3, 5, 1, 2, 4] {
        last = lesson(&client, &shown, class).await;
    }
    // The last in turn, that hears not all, may answer as late as this.
    tokio::time::sleep(Duration::from_secs(3)).await;
    // And one that leaves in the midst of it all.
    let gone = robots.pop().unwrap();
    let mut after = counters(std::slice::from_ref(&gone));
    gone.stop().await;
    last = lesson(&client, &shown, 5).await.max(last);
    tokio::time::sleep(Duration::from_secs(1)).await;
    for (name, count) in counters(&robots) {
        *after.entry(name).or_default() += count;
    }
    recorder.signal("INT");
    let ended = |told: &[Value]| told.iter().find(|told| told["event"] == "recorded").cloned();
    let ledger = recorder.wait(PATIENCE, ended).expect("it ends")["ledger"].clone();
    for lost in ["dropped", "lost"] {
        assert_eq!(ledger[lost].as_object().map(serde_json::Map::len), Some(0), "{ledger}");
    }
    assert_eq!((&ledger["received"], &ledger["unattached_ms"]), (&ledger["written"], &Value::from(0)));

    let mut words =
        vec!["--rule", "majority,mean_probability,log_pool,confidence_weighted,correlated_pool", "--quorum"];
    let quorums = QUORUMS.join(",");
    words.push(&quorums);
    let (_, content) = replay(&file, &["--quorum", "0", "--sweep", "alpha"]);
    assert!(!content, "what is asked for by name is no combination to be left out");
    let began = Instant::now();
    let (told, content) = replay(&file, &words);
    let took = began.elapsed();
    let proof = &event(&told, "proof")["proof"];
    assert!(content && proof["differences"] == Value::from(Vec::<Value>::new()), "{proof:#}");
    let rounds = event(&told, "recording")["rounds"].as_u64().unwrap();
    assert!(proof["reproduced"].as_u64() >= Some(rounds) && rounds >= 13, "{proof} of {rounds} rounds");
    let happened = &event(&told, "happened")["score"];
    assert!(happened["right"].as_u64() >= Some(2), "{happened}");
    eprintln!(
        "{} decisions, {rounds} rounds to {last}, replayed in {took:?}: {happened}",
        proof["reproduced"]
    );

    // Counted again by another program, which shares no line with this one.
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("swarm/recount.py");
    let python = std::env::var("GESTALT_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let recount =
        Command::new(python).arg(script).arg(&file).args(QUORUMS).stderr(Stdio::inherit()).output().unwrap();
    assert!(recount.status.success(), "the recount fails");
    let recount: Value = serde_json::from_slice(&recount.stdout).unwrap();
    let mut compared = 0;
    for row in told.iter().filter(|told| told["event"] == "what_if") {
        let quorum = row["quorum"].as_str().map_or_else(|| row["quorum"].to_string(), str::to_owned);
        let name = format!("{} {quorum}", row["rule"].as_str().unwrap());
        for outcome in row["outcomes"].as_array().unwrap() {
            let counter = outcome["round"]["counter"].to_string();
            assert_eq!(recount["outcomes"][&name][&counter], outcome["would"], "{name}, round {counter}");
            compared += 1;
        }
    }
    assert_eq!(compared as u64, 15 * rounds, "all rules and quorums, all rounds");

    // What robots say that they said is what was heard. Zenoh drops rather than waits where a machine is too busy to send: one
    // in fifty, at most, and never does the recording have more than was said.
    let counts = recount["counts"].as_object().unwrap();
    let heard = |end: &str, beside: &str| -> u64 {
        let of = |topic: &&String| topic.ends_with(end) && (beside.is_empty() || topic.contains(beside));
        counts.iter().filter(|(topic, _)| of(topic)).map(|(_, count)| count.as_u64().unwrap()).sum()
    };
    let said = |name: &str| -> u64 {
        let at = |counters: &BTreeMap<String, u64>| counters.get(name).copied().unwrap_or(0);
        at(&after) - at(&before)
    };
    eprintln!("{counts:#?}");
    for (counter, end, beside) in [
        ("sent_vote", "/vote", ""),
        ("sent_sample", "/sample", ""),
        ("sent_robot_decision", "/decision", "/robot/"),
        ("sent_answer", "/answer", ""),
    ] {
        let (heard, said) = (heard(end, beside), said(counter));
        assert!(said > 0 && heard <= said && said - heard <= 1 + said / 50, "{counter}: {heard} of {said}");
    }
    if let Some(checked) = recount["checked"].as_object() {
        for (topic, count) in counts {
            assert_eq!(checked.get(topic), Some(count), "{topic}, as PyPI's mcap reads it");
        }
    }

    played(&file, &swarm, last).await;
    client.close().await;
    for robot in robots {
        robot.stop().await;
    }
}

/// Clients of the recording hear what clients of the swarm heard.
async fn played(file: &Path, swarm: &str, last: u32) {
    let path = file.to_str().unwrap();
    let same = gestalt(&["replay", path, "--play", "--as", swarm]).output().unwrap();
    assert!(!same.status.success(), "not under the name of a swarm that may hear it");
    let words = [
        "replay",
        path,
        "--play",
        "--speed",
        "4",
        "-l",
        "tcp/127.0.0.1:0",
        "--no-multicast-scouting",
        "--json",
    ];
    let stage = Process::run(&mut gestalt(&words));
    let plays = |told: &[Value]| told.iter().find(|told| told["event"] == "playing").cloned();
    let plays = stage.wait(PATIENCE, plays).expect("it plays");
    let connect = vec![plays["endpoints"][0].as_str().unwrap().to_owned()];
    let name = plays["swarm"].as_str().unwrap();
    assert_eq!(name, format!("{swarm}-replay"));
    let client = Client::open(name, &LinkConfig { connect, ..LinkConfig::default() }).await.unwrap();
    let mut news = client.news().await.unwrap();
    let heard =
        tokio::time::timeout(PATIENCE, news.decision_after(Some(last - 1))).await.expect("the last decision");
    assert_eq!(heard.unwrap().decision.round.counter, last);
    assert!(client.statuses(PATIENCE).await.unwrap().len() >= 4, "robots answer");
    assert_eq!(client.last_decision(PATIENCE).await.unwrap().unwrap().decision.round.counter, last);
    client.close().await;
}

pub async fn a_recorder_that_is_killed_loses_less_than_a_second() {
    let (folder, swarm) = (tempfile::tempdir().unwrap(), unique("killed"));
    let file = folder.path().join("run.mcap");
    let mut robots = vec![start(config(0, &swarm, &[]), Some(ClassId(2))).await];
    let locators = robots[0].robot.locators().to_vec();
    robots.push(start(config(1, &swarm, &locators), Some(ClassId(2))).await);
    assert!(robots[0].sees_alive(1, PATIENCE).await);
    let mut recorder = record(&file, &swarm, &locators[0]);
    let link = LinkConfig { connect: locators, ..LinkConfig::default() };
    let client = Client::open(&swarm, &link).await.unwrap();
    let mut decisions = client.decisions().await.unwrap();
    let mut heard = Vec::new();
    for _ in 0..3 {
        robots[0].robot.open_round();
        let decided =
            tokio::time::timeout(PATIENCE, decisions.next()).await.expect("a decision").unwrap().unwrap();
        heard.push((Instant::now(), decided.decision.round.counter));
        tokio::time::sleep(Duration::from_millis(700)).await;
    }
    recorder.kill();
    let killed = Instant::now();
    let (told, content) = replay(&file, &[]);
    assert!(content, "torn is not wrong");
    assert!(event(&told, "recording")["torn"].is_u64(), "{told:#?}");
    let kept = event(&told, "proof")["proof"]["reproduced"].as_u64().unwrap();
    let older = heard.iter().filter(|(at, _)| killed - *at >= Duration::from_secs(1)).count();
    assert!(older >= 2 && kept >= older as u64, "{kept} of {older} that are older than a second");
    client.close().await;
    for robot in robots {
        robot.stop().await;
    }
}

pub async fn a_full_disk_ends_the_recorder_and_not_the_swarm() {
    let (disk, swarm) = (SmallDisk::new(), unique("full-tape"));
    let folder: PathBuf = disk.0.path().to_owned();
    std::fs::write(folder.join("junk"), vec![0_u8; (4 << 20) - (48 << 10)]).expect("it fits");
    let mut robots = vec![start(config(0, &swarm, &[]), Some(ClassId(2))).await];
    let locators = robots[0].robot.locators().to_vec();
    robots.push(start(config(1, &swarm, &locators), Some(ClassId(2))).await);
    assert!(robots[0].sees_alive(1, PATIENCE).await);
    let file = folder.join("run.mcap");
    let words = ["record", file.to_str().unwrap(), "--swarm", &swarm, "-e", &locators[0]];
    let mut recorder = gestalt(&words).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let began = Instant::now();
    let mut round = 0;
    let ended = loop {
        round += 1;
        robots[1].robot.open_round();
        for robot in &mut robots {
            let decision = robot.decision(round, PATIENCE).await.expect("the swarm does not notice");
            assert_eq!(decision.class, Some(ClassId(2)));
        }
        if let Some(status) = recorder.try_wait().unwrap() {
            break status;
        }
        assert!(began.elapsed() < 3 * PATIENCE, "the recorder goes on on a full disk");
        tokio::time::sleep(Duration::from_millis(600)).await;
    };
    let mut said = String::new();
    std::io::Read::read_to_string(&mut recorder.stderr.take().unwrap(), &mut said).unwrap();
    assert!(!ended.success() && said.contains("lost") && said.contains("make room"), "{ended}: {said}");
    let (told, content) = replay(&file, &[]);
    assert!(content && event(&told, "recording")["torn"].is_u64(), "{told:#?}");
    assert!(event(&told, "recording")["damage"].as_array().unwrap().is_empty(), "it ends with a whole chunk");
    for robot in robots {
        robot.stop().await;
    }
}
