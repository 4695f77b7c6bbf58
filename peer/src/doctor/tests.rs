use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use gestalt_link::rounds_in_words;
use gestalt_protocol::{Camera, CameraState, LearningStatus, RobotId, Status};
use gestalt_strategies::MindConfig;
use serde_json::json;

use super::robot::{CameraFacts, Given, KeyFacts, MemoryFacts, PortFacts, RobotFacts, Room};
use super::swarm::{Answer, RosterFacts, SwarmFacts};
use super::{Finding, Severity, robot, swarm};

/// November 2026.
const NOW: Duration = Duration::from_secs(1_795_400_000);

fn well() -> RobotFacts {
    RobotFacts {
        described: Some("robot.json5".to_owned()),
        model: Some(Ok("hands.gestalt".to_owned())),
        memory: Some(MemoryFacts {
            path: "/data/robot.memory".into(),
            room: Room::Enough,
            held: false,
            trouble: None,
        }),
        keys: Some(KeyFacts {
            folder: "keys".into(),
            key: "keys/robot-1.key".into(),
            exposed: false,
            trouble: None,
            locked: None,
        }),
        ports: vec![PortFacts { endpoint: "tls/0.0.0.0:7447".to_owned(), taken: None }],
        multicast: Some(Ok(())),
        camera: Some(camera()),
        ..RobotFacts::new(RobotId(1), NOW)
    }
}

fn camera() -> CameraFacts {
    CameraFacts {
        source: "device /dev/video0".to_owned(),
        setting: "camera: {source: {device: {path: \"/dev/video0\"}}}".to_owned(),
        devices: vec!["/dev/video2".to_owned()],
        live: true,
        held: false,
        size: [640, 480],
        fps: 15.0,
        gave: Ok(GIVEN),
    }
}

const GIVEN: Given = Given { size: [640, 480], fps: Some(14.8), contrast: 40.0, same: false };

fn member(id: u32) -> Answer {
    let status = Status {
        session: format!("{id:032x}"),
        alive: (1..=3).map(RobotId).collect(),
        vocabulary: vec!["fist".to_owned(), "palm".to_owned()],
        clock_ms: u64::try_from(NOW.as_millis()).ok(),
        rounds: rounds_in_words(&MindConfig::default()),
        learning: Some(LearningStatus { space: "5eed".to_owned(), ..LearningStatus::default() }),
        ..Status::new(RobotId(id), format!("robot-{id}"), 1)
    };
    let asked = (NOW - Duration::from_millis(30), NOW + Duration::from_millis(30));
    Answer { status, asked, grown: BTreeMap::new() }
}

fn sound() -> SwarmFacts {
    SwarmFacts {
        name: "demo".to_owned(),
        parts: vec![(1..=3).map(member).collect()],
        ..SwarmFacts::default()
    }
}

/// A swarm in which something is wrong with the third robot.
fn with(change: impl FnOnce(&mut Status)) -> SwarmFacts {
    let mut facts = sound();
    change(&mut facts.parts[0][2].status);
    facts
}

fn roster(robots: u32, epoch: u64) -> RosterFacts {
    RosterFacts { epoch, robots: (1..=robots).map(RobotId).collect() }
}

/// A swarm that goes by a roster of that epoch, and its third robot by another.
fn going_by(epoch: u64, third: u64) -> SwarmFacts {
    let mut facts = sound();
    for (answer, epoch) in facts.parts[0].iter_mut().zip([epoch, epoch, third]) {
        answer.status.counters.insert("roster_epoch".to_owned(), epoch);
    }
    facts
}

fn on(change: impl FnOnce(&mut RobotFacts)) -> RobotFacts {
    let mut facts = well();
    change(&mut facts);
    facts
}

fn troubles(findings: Vec<Finding>) -> Vec<Finding> {
    findings.into_iter().filter(|finding| finding.severity != Severity::Fine).collect()
}

/// The one trouble of some facts, which says that and has that fix.
#[track_caller]
fn is_named(planted: &str, findings: Vec<Finding>, severity: Severity, check: &str, what: &str, fix: &str) {
    let found = troubles(findings);
    let [one] = found.as_slice() else { panic!("{planted}: {found:#?}") };
    assert_eq!((one.check, one.severity), (check, severity), "{planted}: {one:#?}");
    assert!(one.what.contains(what) && one.fix.contains(fix) && !one.why.is_empty(), "{planted}: {one:#?}");
}

#[test]
fn what_is_well_is_said_to_be_well() {
    assert_eq!(troubles(robot::findings(&well())), []);
    assert_eq!(troubles(swarm::findings(&sound())), []);
    assert!(robot::findings(&well()).iter().all(|it| it.fix.is_empty() && !it.what.is_empty()));
}

#[test]
fn each_fault_of_a_robot_is_named_alone_with_its_fix() {
    let memory = |room: Room| on(|facts| facts.memory.as_mut().unwrap().room = room);
    let gave = |gave: Result<Given, String>| on(|facts| facts.camera.as_mut().unwrap().gave = gave);
    let key = "rouns: unknown key";
    for (facts, check, what, fix) in [
        (on(|it| it.clock = Duration::from_secs(77)), "clock", "1970-01-01", "timedatectl"),
        (on(|it| it.problems = vec![key.to_owned()]), "configuration", key, "gestalt config"),
        (
            on(|it| it.unreadable = Some("cannot read robot.json5".to_owned())),
            "configuration",
            "cannot read",
            "gestalt config >",
        ),
        (
            on(|it| it.model = Some(Err("hands.gestalt is damaged".to_owned()))),
            "model",
            "damaged",
            "gestalt train",
        ),
        (memory(Room::NoFolder), "memory", "/data is not there", "mkdir -p /data"),
        (memory(Room::Full), "memory", "no room", "df -h /data"),
        (
            memory(Room::ReadOnly("read-only file system".to_owned())),
            "memory",
            "cannot be written",
            "remount,rw",
        ),
        (memory(Room::Unreadable("the disk fails".to_owned())), "memory", "the disk fails", "dmesg"),
        (
            on(|it| it.keys.as_mut().unwrap().locked = Some("read-only file system".to_owned())),
            "keys",
            "read-only",
            "let the user",
        ),
        (
            on(|it| it.memory.as_mut().unwrap().held = true),
            "memory",
            "another process",
            "fuser /data/robot.memory",
        ),
        (
            on(|it| it.memory.as_mut().unwrap().trouble = Some("memory is damaged".to_owned())),
            "memory",
            "damaged",
            "mv /data/robot.memory /data/robot.memory.damaged",
        ),
        (
            on(|it| it.keys.as_mut().unwrap().exposed = true),
            "keys",
            "other users",
            "chmod 600 keys/robot-1.key",
        ),
        (
            on(|it| it.keys.as_mut().unwrap().trouble = Some("robot 1 is not on the roster".to_owned())),
            "keys",
            "roster",
            "gestalt trust request",
        ),
        (
            on(|it| it.ports[0].taken = Some("another program listens there".to_owned())),
            "port",
            "tls/0.0.0.0:7447",
            "sport = :7447",
        ),
        (
            on(|it| it.multicast = Some(Err("dropped".to_owned()))),
            "multicast",
            "dropped",
            "--no-multicast-scouting",
        ),
        (
            gave(Err("/dev/video0 does not exist".to_owned())),
            "camera",
            "does not exist",
            "--source /dev/video2",
        ),
        (
            gave(Err("no permission to read /dev/video0".to_owned())),
            "camera",
            "permission",
            "usermod -aG video",
        ),
        (gave(Ok(Given { contrast: 0.5, ..GIVEN })), "camera", "one colour", "uncover"),
        (gave(Ok(Given { same: true, ..GIVEN })), "camera", "over and over", "unplug"),
    ] {
        is_named(what, robot::findings(&facts), Severity::Failure, check, what, fix);
    }
    // What is the service's is not to be made another's, and what may be sound is not to be moved away.
    for room in [Room::ReadOnly("permission denied".to_owned()), Room::Unreadable("it fails".to_owned())] {
        let fixes: String = robot::findings(&memory(room)).iter().map(|it| it.fix.clone()).collect();
        assert!(!fixes.contains("chown") && !fixes.contains("mv "), "{fixes}");
    }
    let small = gave(Ok(Given { size: [320, 240], fps: Some(5.0), ..GIVEN }));
    is_named("size", robot::findings(&small), Severity::Warning, "camera", "320×240 at 5.0", "width_px: 320");
}

#[test]
fn what_a_running_robot_holds_itself_is_no_fault() {
    let running = on(|facts| {
        facts.running = true;
        facts.memory.as_mut().unwrap().held = true;
        let camera = facts.camera.as_mut().unwrap();
        (camera.held, camera.gave) = (true, Err("in use".to_owned()));
    });
    assert_eq!(troubles(robot::findings(&running)), []);
    // With another camera, or with one that is not there, it has not the one that was looked at.
    let mut other = running;
    other.camera.as_mut().unwrap().held = false;
    is_named("other", robot::findings(&other), Severity::Failure, "camera", "in use", "--source /dev/video2");
    let said = |source: &str, state| Camera { source: source.to_owned(), state, ..Camera::default() };
    let has = |source: &str, state| robot::has(&said(source, state), "device /dev/video0");
    assert!(has("device /dev/video0", CameraState::Live) && has("device /dev/video0", CameraState::Opening));
    assert!(!has("rendered", CameraState::Live) && !has("device /dev/video0", CameraState::Failing));
    assert!(robot::has(&said("video pipe /tmp/frames", CameraState::Live), "video /tmp/frames"));
}

#[test]
fn each_fault_of_a_swarm_is_named_alone_with_its_fix() {
    let twin = || {
        let mut facts = sound();
        let mut other = member(3);
        (other.status.session, other.status.name) = ("another".to_owned(), "the other".to_owned());
        facts.parts[0].push(other);
        facts
    };
    let apart = || SwarmFacts { parts: vec![vec![alone(1)], vec![alone(2)]], ..sound() };
    let mut unreached = sound();
    unreached.unreached.push(("tcp/10.0.0.9:7447".to_owned(), "nothing listens there".to_owned()));
    let mine = |status: Status| SwarmFacts { mine: Some(status), ..sound() };
    for (facts, check, what, fix) in [
        (twin(), "twin", "2 robots have the id 3", "--id N"),
        (
            with(|it| it.rounds.insert("quorum".to_owned(), json!(2)).map_or((), drop)),
            "rounds",
            "robot 3: 2",
            "rounds: {quorum: \"majority\"}",
        ),
        (
            with(|it| it.rounds.insert("rule".to_owned(), json!("majority")).map_or((), drop)),
            "rounds",
            "rounds.rule",
            "robot 3",
        ),
        (with(|it| it.vocabulary.reverse()), "vocabulary", "palm, fist", "robot 3"),
        (with(|it| it.learning.as_mut().unwrap().space = "other".to_owned()), "features", "other", "robot 3"),
        (with(|it| it.sealed = true), "seal", "robot 3: sealed", "trust: {keys"),
        (with(|it| it.protocol = 2), "release", "robot 3: 2", "one release"),
        (with(|it| it.alive = vec![RobotId(3)]), "parts", "robot 3 does not hear robots 1, 2", "-e tcp/"),
        (apart(), "parts", "robot 1 | robot 2", "-e tcp/"),
        (unreached, "endpoint", "nothing listens there", "nc -vz"),
        (SwarmFacts { silent: BTreeSet::from([RobotId(9)]), ..sound() }, "parts", "robot 9", "TCP ports"),
        (with(|it| it.clock_ms = Some(5)), "clocks", "robots 3 and", "robot 3"),
        (
            with(|it| {
                (it.camera.state, it.camera.trouble) = (CameraState::Frozen, "identical pictures".to_owned())
            }),
            "cameras",
            "robot 3 (none) is frozen: identical pictures",
            "gestalt doctor",
        ),
        (
            with(|it| it.learning.as_mut().unwrap().memory = "failing: the disk is full".to_owned()),
            "memories",
            "robot 3: the disk is full",
            "gestalt doctor",
        ),
        (
            with(|it| it.counters.insert("convicted_7".to_owned(), 1).map_or((), drop)),
            "liar",
            "robot 7",
            "gestalt trust rekey 7",
        ),
        (
            mine(Status {
                rounds: rounds_in_words(&MindConfig { liars: 1, ..MindConfig::default() }),
                ..Status::new(RobotId(4), String::new(), 0)
            }),
            "rounds",
            "this configuration: 1",
            "rounds: {liars: 0}",
        ),
    ] {
        is_named(what, swarm::findings(&facts), Severity::Failure, check, what, fix);
    }
    let unasked = swarm::findings(&SwarmFacts { unasked: BTreeSet::from([RobotId(9)]), ..sound() });
    is_named("unasked", unasked, Severity::Warning, "parts", "robot 9", "-e ENDPOINT");
}

fn alone(id: u32) -> Answer {
    let mut answer = member(id);
    answer.status.alive = vec![RobotId(id)];
    answer
}

#[test]
fn what_may_be_meant_is_a_warning() {
    let refusing = |counter: &str| {
        let mut facts = sound();
        facts.parts[0][1].grown.insert(counter.to_owned(), 12);
        facts
    };
    let mine = Some(Status {
        rounds: rounds_in_words(&MindConfig::default()),
        ..Status::new(RobotId(2), String::new(), 0)
    });
    for (facts, check, what, fix) in [
        (refusing("refused_vote_version"), "refusals", "robot 2 refused 12", "one release"),
        (refusing("refused_word_repeated"), "refusals", "robot 2 refused 12", "client-NAME.words"),
        (refusing("refused_something_new"), "refusals", "refused_something_new", "gestalt watch --status"),
        (SwarmFacts { mine, ..sound() }, "twin", "robot 2 answers", "--id N"),
        (
            with(|it| it.counters.insert("twin".to_owned(), 1).map_or((), drop)),
            "twin",
            "robot 3 met",
            "--id N",
        ),
        (SwarmFacts { roster: Some(roster(4, 0)), ..sound() }, "members", "robot 4", "start them"),
        (SwarmFacts { roster: Some(roster(3, 2)), ..going_by(2, 1) }, "roster", "robot 3", "trust tell"),
        (SwarmFacts { roster: Some(roster(3, 3)), ..going_by(2, 2) }, "roster", "epoch 3", "trust tell"),
        (SwarmFacts { roster: Some(roster(3, 1)), ..going_by(2, 2) }, "roster", "roster here", "newest"),
        (SwarmFacts { name: "demo".to_owned(), ..SwarmFacts::default() }, "swarm", "no robot", "-e tcp/"),
    ] {
        is_named(what, swarm::findings(&facts), Severity::Warning, check, what, fix);
    }
    let mut few = sound();
    for answer in &mut few.parts[0] {
        answer.status.rounds.insert("quorum".to_owned(), json!(9));
    }
    is_named("quorum", swarm::findings(&few), Severity::Warning, "quorum", "is 9, and 3", "majority");
}

#[test]
fn clocks_are_compared_no_better_than_they_are_known() {
    let mut facts = with(|it| it.clock_ms = it.clock_ms.map(|clock| clock + 3000));
    assert_eq!(troubles(swarm::findings(&facts)).len(), 1);
    // Asked over two seconds, each may have answered at any time of them.
    for answer in &mut facts.parts[0] {
        answer.asked = (NOW, NOW + Duration::from_secs(2));
    }
    assert_eq!(troubles(swarm::findings(&facts)), []);
}

#[test]
fn robots_may_differ_in_what_belongs_to_their_cameras_and_need_not_say_what_they_do_not_know() {
    let own = with(|it| it.rounds.insert("decorrelation".to_owned(), json!("1s")).map_or((), drop));
    assert_eq!(troubles(swarm::findings(&own)), []);
    let old = with(|it| {
        (it.clock_ms, it.session, it.rounds) = (None, String::new(), BTreeMap::new());
        it.vocabulary.clear();
        it.learning = None;
    });
    assert_eq!(troubles(swarm::findings(&old)), []);
}

#[test]
fn what_liars_say_neither_panics_nor_grows() {
    let mut facts = sound();
    for id in 0..300 {
        let mut liar = member(id);
        liar.status.clock_ms = Some(if id % 2 == 0 { u64::MAX } else { 0 });
        liar.status.rounds = (0..500).map(|key| (format!("k{key}"), json!(id))).collect();
        liar.status.rounds.insert("quorum".to_owned(), json!("x".repeat(5000)));
        (liar.status.name, liar.status.camera.trouble) = ("n".repeat(5000), "t".repeat(5000));
        liar.status.camera.state = CameraState::Failing;
        liar.grown = (0..20).map(|cause| (format!("refused_{id}_{cause}"), u64::MAX)).collect();
        facts.parts[0].push(liar);
    }
    let found = swarm::findings(&facts);
    let length: usize = found.iter().map(|it| it.what.len() + it.fix.len()).sum();
    assert!(found.len() < 1000 && length < 1_000_000, "{} findings, {length} bytes", found.len());
}
