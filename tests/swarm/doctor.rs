//! The doctor, called to real swarms: a healthy one, and one in which everything that can be planted is planted.

use std::net::TcpListener;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use gestalt_link::RobotConfig;
use gestalt_peer::body::Body;
use gestalt_peer::config::{CameraSection, Config, DeviceSection, ModelSection, SourceSection};
use gestalt_protocol::{CameraState, ClassId, Keys, RobotId, Status, Topic};
use gestalt_strategies::{MindConfig, Quorum, Vocabulary};
use gestalt_tests::{Watched, config, model, start, unique};
use gestalt_vision::config::DeviceSettings;
use serde_json::{Value, json};

use crate::trouble::attach;

const PATIENCE: Duration = Duration::from_secs(20);

/// What a visit came to.
struct Visit {
    code: Option<i32>,
    findings: Vec<Value>,
    took: Duration,
}

impl Visit {
    /// Has the doctor look at a robot, as a program of its own.
    async fn pay(file: &Path) -> Self {
        let began = Instant::now();
        let mut command = tokio::process::Command::new(env!("CARGO_BIN_EXE_test-gestalt"));
        let ran = command.arg("doctor").arg(file).arg("--json").output().await.expect("the doctor comes");
        let (said, took) = (String::from_utf8_lossy(&ran.stdout).into_owned(), began.elapsed());
        let report: Value = serde_json::from_str(&said)
            .unwrap_or_else(|error| panic!("{error}: {said}{}", String::from_utf8_lossy(&ran.stderr)));
        assert_eq!(report["healthy"] == true, ran.status.success(), "{report:#}");
        let findings = report["findings"].as_array().expect("findings").clone();
        Self { code: ran.status.code(), findings, took }
    }

    /// That a failure of that check says so, why it matters, and how to mend it.
    #[track_caller]
    fn names(&self, check: &str, what: &str, fix: &str) {
        let text = |finding: &Value, key: &str| finding[key].as_str().unwrap_or_default().to_owned();
        let named = self.findings.iter().any(|it| {
            it["check"] == check
                && it["severity"] == "failure"
                && text(it, "what").contains(what)
                && text(it, "fix").contains(fix)
                && !text(it, "why").is_empty()
        });
        assert!(named, "{check}: {what}: {fix}: {:#}", json!(self.findings));
    }
}

/// Three robots that all hear each other.
async fn three(swarm: &str) -> Vec<Watched> {
    let mut robots = vec![start(config(1, swarm, &[]), Some(ClassId(3))).await];
    let first = robots[0].robot.locators().to_vec();
    robots.push(start(config(2, swarm, &first), None).await);
    robots.push(start(config(3, swarm, &first), None).await);
    for robot in &robots {
        assert!(robot.sees_alive(2, PATIENCE).await);
    }
    robots
}

/// The configuration of robot 7, which sees and learns, as a file.
fn robot_7(
    folder: &Path,
    swarm: &str,
    listen: &str,
    connect: &[String],
    change: impl FnOnce(&mut Value),
) -> PathBuf {
    let mut config = json!({
        "robot": {"id": 7},
        "swarm": swarm,
        "camera": {"source": {"rendered": {}}},
        "model": "rendered",
        "learning": {"enabled": true, "memory": folder.join("robot.memory")},
        "links": {"scouting": {"enabled": false}},
        "zenoh": {"listen": {"endpoints": [listen]}, "connect": {"endpoints": connect}},
    });
    change(&mut config);
    let file = folder.join("robot.json5");
    std::fs::write(&file, config.to_string()).unwrap();
    file
}

fn free_port() -> String {
    format!("tcp/{}", TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap())
}

pub async fn a_healthy_swarm_is_found_well_within_five_seconds() {
    let (swarm, folder) = (unique("healthy"), tempfile::tempdir().unwrap());
    let robots = three(&swarm).await;
    let listen = free_port();
    let file = robot_7(folder.path(), &swarm, &listen, robots[0].robot.locators(), |_| ());
    let visit = Visit::pay(&file).await;
    assert_eq!(visit.code, Some(0));
    assert!(
        visit.findings.iter().all(|finding| finding["severity"] == "fine"),
        "{:#}",
        json!(visit.findings)
    );
    assert!(visit.took < Duration::from_secs(5), "{:?}", visit.took);
    assert!(!folder.path().join("robot.memory").exists(), "the doctor leaves nothing behind");

    // The same while it runs: what it holds itself is no fault.
    let config = Config::read(&file).unwrap();
    let body = Body::start(&config, Some(model()), 1).await.unwrap();
    for robot in &robots {
        assert!(robot.sees_alive(3, PATIENCE).await);
    }
    let visit = Visit::pay(&file).await;
    assert_eq!(visit.code, Some(0), "{:#}", json!(visit.findings));
    assert!(visit.took < Duration::from_secs(5), "{:?}", visit.took);
    body.stop().await;
    for robot in robots {
        robot.stop().await;
    }
}

pub async fn faults_that_are_planted_are_each_named_with_their_fix() {
    let (swarm, folder) = (unique("ill"), tempfile::tempdir().unwrap());
    let robots = three(&swarm).await;
    let first = robots[0].robot.locators().to_vec();
    let twin = start(RobotConfig { name: "the other".to_owned(), ..config(2, &swarm, &first) }, None).await;
    let mind = MindConfig { quorum: Quorum::Evidence(2), ..MindConfig::default() };
    let stubborn = start(RobotConfig { mind, ..config(4, &swarm, &first) }, None).await;
    let vocabulary = Some(Vocabulary::new(["fist", "palm"]).unwrap());
    let foreign = start(RobotConfig { vocabulary, ..config(5, &swarm, &first) }, None).await;
    let alone = start(config(6, &swarm, &[]), None).await;
    // A robot whose camera is not there.
    let mut blind =
        Config { camera: CameraSection::default(), model: ModelSection::Rendered, ..Config::default() };
    (blind.robot.id, blind.swarm.0) = (RobotId(8), swarm.clone());
    blind.camera.source = SourceSection::Device(DeviceSection {
        path: folder.path().join("video9"),
        v4l2: DeviceSettings::default(),
    });
    blind.links.scouting.enabled = false;
    blind.zenoh.insert("listen".to_owned(), json!({"endpoints": ["tcp/127.0.0.1:0"]}));
    blind.zenoh.insert("connect".to_owned(), json!({"endpoints": first}));
    let blind = Body::start(&blind, Some(model()), 1).await.unwrap();
    // One of another release, on a machine without a clock.
    let session = attach(&first).await;
    let old = Status {
        protocol: 2,
        clock_ms: Some(5),
        alive: (1..=9).map(RobotId).collect(),
        ..Status::new(RobotId(9), "old".to_owned(), 1)
    };
    let key = Keys::new(&swarm).unwrap().key(&Topic::Status(RobotId(9)));
    let answer = serde_json::to_string(&old).unwrap();
    let answering = session
        .declare_queryable(&key)
        .callback(move |query| {
            let reply = query.reply(query.key_expr().clone(), answer.clone());
            zenoh::Wait::wait(reply).expect("an answer");
        })
        .await
        .unwrap();
    for robot in &robots {
        assert!(robot.sees_alive(5, PATIENCE).await);
    }
    let deadline = Instant::now() + PATIENCE;
    while blind.robot().status().camera.state != CameraState::Failing {
        assert!(Instant::now() < deadline, "{:?}", blind.robot().status().camera);
        tokio::time::sleep(Duration::from_millis(50)).await;
    }

    let holder = TcpListener::bind("127.0.0.1:0").unwrap();
    let taken = format!("tcp/{}", holder.local_addr().unwrap());
    let nobody = free_port();
    let connect = [first[0].clone(), alone.robot.locators()[0].clone(), nobody.clone()];
    std::fs::write(folder.path().join("robot.memory"), "not a database").unwrap();
    let keys = folder.path().join("keys");
    let made = Command::new(env!("CARGO_BIN_EXE_test-gestalt"))
        .args(["trust", "enrol", "--local", "--swarm", &swarm, "--robots", "7"])
        .arg(&keys)
        .output()
        .unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    std::fs::set_permissions(keys.join("robot-7.key"), std::fs::Permissions::from_mode(0o644)).unwrap();
    let missing = folder.path().join("missing.mp4");
    let file = robot_7(folder.path(), &swarm, &taken, &connect, |config| {
        config["trust"] = json!({"keys": keys});
        config["camera"] = json!({"source": {"video": {"path": missing}}});
        config["rouns"] = json!({});
    });
    let visit = Visit::pay(&file).await;
    assert_eq!(visit.code, Some(1));
    visit.names("configuration", "rouns", "gestalt config");
    visit.names("port", "another program", "ss -ltnp");
    visit.names("memory", "robot.memory", "mv ");
    visit.names("keys", "other users", "chmod 600");
    visit.names("camera", "missing.mp4 does not exist", "missing.mp4");
    visit.names("endpoint", &format!("{nobody}: nothing listens"), "-l and this address");
    visit.names("parts", "do not hear each other: robots 1, 2, 3, 4, 5, 8, 9 | robot 6", "-e tcp/");
    visit.names("twin", "2 robots have the id 2", "--id N");
    visit.names("rounds", "rounds.quorum", "in the configuration of robot 4");
    visit.names("vocabulary", "fist, palm", "robot 5");
    visit.names("cameras", "the camera of robot 8", "gestalt doctor");
    visit.names("release", "robot 9: 2", "one release");
    visit.names("clocks", "robots 9 and", "robot 9");
    visit.names("seal", "this configuration: sealed", "trust: {keys");

    answering.undeclare().await.unwrap();
    session.close().await.unwrap();
    blind.stop().await;
    for robot in robots.into_iter().chain([twin, stubborn, foreign, alone]) {
        robot.stop().await;
    }
}

/// A file system that is as small, and can be made to refuse what is written.
struct Disk(tempfile::TempDir);

impl Disk {
    fn new(size: &str) -> Self {
        let disk = Self(tempfile::tempdir().unwrap());
        disk.mount(&["-t", "tmpfs", "-o", &format!("size={size}"), "tmpfs"]);
        disk
    }

    fn mount(&self, words: &[&str]) {
        assert!(Command::new("mount").args(words).arg(self.0.path()).status().unwrap().success());
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        // Left mounted it would stay until the machine restarts, which is no reason to panic.
        let _ = Command::new("umount").arg("-l").arg(self.0.path()).status();
    }
}

pub async fn a_disk_without_room_and_one_that_is_read_only_are_told_apart() {
    let (swarm, folder) = (unique("disk"), tempfile::tempdir().unwrap());
    let visit = async |disk: &Disk| {
        let file = robot_7(folder.path(), &swarm, "tcp/127.0.0.1:0", &[], |config| {
            config["learning"]["memory"] = json!(disk.0.path().join("robot.memory"));
        });
        Visit::pay(&file).await
    };
    let small = Disk::new("4m");
    visit(&small).await.names("memory", "no room", "df -h");
    let fixed = Disk::new("64m");
    assert_eq!(visit(&fixed).await.code, Some(0));
    fixed.mount(&["-o", "remount,ro"]);
    visit(&fixed).await.names("memory", "cannot be written", "remount,rw");
}

pub async fn a_visit_leaves_no_trace_at_the_robots() {
    let (swarm, folder) = (unique("visit"), tempfile::tempdir().unwrap());
    let robots = three(&swarm).await;
    let file = robot_7(folder.path(), &swarm, "tcp/127.0.0.1:0", robots[1].robot.locators(), |_| ());
    Visit::pay(&file).await;
    for robot in &robots {
        let status = robot.robot.status();
        assert!(status.errors.is_empty() && status.alive.len() == 3, "{status:?}");
        assert!(!status.counters.keys().any(|name| name.starts_with("refused_")), "{:?}", status.counters);
    }
    for robot in robots {
        robot.stop().await;
    }
}
