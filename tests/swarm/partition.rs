//! A swarm that falls apart in the middle of a round.

use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};

use gestalt_protocol::{Decision, Reason};
use gestalt_strategies::{MindConfig, Quorum, outcome};
use gestalt_tests::Process;
use serde_json::{Value, json};

use crate::field::Field;

const PATIENCE: Duration = Duration::from_secs(20);

const HERE: [usize; 3] = [0, 1, 2];
const THERE: [usize; 3] = [3, 4, 5];

/// With a fixed quorum, which each part has.
pub fn the_parts_of_a_cut_swarm_decide_apart_and_agree_at_the_heal() {
    let links: Vec<_> = (0..5).map(|i| (i, i + 1)).collect();
    // Three see one thing and three another, equally sure of it: as long as all hear all, nobody can decide.
    let mut field =
        Field::new(6, &links, Quorum::Evidence(3), |node| Some((if node < 3 { 1 } else { 2 }, 0.7)));
    field.robots[0].order("open");
    let opened = |told: &[serde_json::Value]| told.iter().any(|t| t["event"] == "opened").then_some(());
    for robot in &field.robots {
        robot.wait(PATIENCE, opened).expect("all take part");
    }
    field.namespaces.cut((2, 3));
    let (here, there) = (field.agreed(1, &HERE, PATIENCE), field.agreed(1, &THERE, PATIENCE));
    assert_eq!([&here["class"], &there["class"]], [&json!(1), &json!(2)], "{here} {there}");
    field.namespaces.heal((2, 3));
    let all: Vec<usize> = (0..6).collect();
    let agreed = field.agreed(1, &all, Duration::from_secs(30));
    assert!([&here["class"], &there["class"]].contains(&&agreed["class"]), "one of the two wins: {agreed}");
}

/// What parts nine robots in a line between the fourth and the fifth, while instructors on both sides go on.
#[derive(Clone, Copy, Debug)]
enum Fault {
    /// Nothing arrives, either way.
    Cut,
    /// Nothing reaches this one of the two; what it says arrives.
    Deaf(u32),
    /// Nothing arrives, either way; and some links carry few bytes a second: one in each part, and the one that comes back.
    CutAndSlow,
}

pub fn a_part_without_the_majority_decides_nothing_and_says_why() {
    parted_again_and_again(Fault::Cut);
}

pub fn a_part_that_is_not_heard_by_the_majority_decides_nothing_and_says_why() {
    parted_again_and_again(Fault::Deaf(BETWEEN.1));
}

pub fn a_part_that_does_not_hear_the_majority_decides_nothing_and_says_why() {
    parted_again_and_again(Fault::Deaf(BETWEEN.0));
}

pub fn parts_of_slow_neighbours_come_together_as_soon() {
    parted_again_and_again(Fault::CutAndSlow);
}

/// The four, of nine; and who opens rounds, at the far ends.
const FEW: [usize; 4] = [3, 2, 1, 0];
const BETWEEN: (u32, u32) = (3, 4);
const FAR: [usize; 2] = [0, 8];

const SLOW: [(u32, u32); 3] = [(1, 2), BETWEEN, (6, 7)];
const BYTES_PER_SECOND: u32 = 8000;

/// As many as robots need that knew nothing, and more.
const LESSONS: usize = 24;

/// After the deadline of the round in whose midst the swarm falls apart, both parts are by themselves.
const APART: Duration = Duration::from_secs(6);

/// How soon all is as if nothing had happened, on a machine that does nothing else.
const TOGETHER: Duration = Duration::from_secs(5);

/// With `GESTALT_LONG` ten times for 60 s, by the default configuration; otherwise once, beside other tests, and a round that is decided
/// by nobody takes two seconds instead of five.
fn parted_again_and_again(fault: Fault) {
    match std::env::var_os("GESTALT_LONG") {
        Some(_) => {
            (0..10).for_each(|_| parted(fault, Duration::from_secs(60), TOGETHER, &MindConfig::default()));
        }
        None => {
            let rounds = MindConfig { deadline: Duration::from_secs(2), ..MindConfig::default() };
            parted(fault, Duration::from_secs(12), 2 * TOGETHER, &rounds);
        }
    }
}

fn parted(fault: Fault, time: Duration, soon: Duration, config: &MindConfig) {
    let links: Vec<_> = (0..8).map(|i| (i, i + 1)).collect();
    let mut field = Field::learning(9, &links, config);
    learn(&mut field);
    let before: Vec<usize> = field.robots.iter().map(|robot| robot.told().len()).collect();
    field.robots[0].order("open");
    for (robot, before) in field.robots.iter().zip(before) {
        let opened = |told: &[Value]| told[before..].iter().any(|t| t["event"] == "opened").then_some(());
        robot.wait(PATIENCE, opened).expect("all take part");
    }

    let began = Instant::now();
    fault.begin(&field);
    std::thread::sleep(APART);
    let before: Vec<usize> = field.robots.iter().map(|robot| robot.told().len()).collect();
    let mut rounds = 0;
    while began.elapsed() < time {
        let class = [1, 3][rounds % 2];
        rounds += 1;
        field.show(class);
        let [few, most] = &round(&mut field, &FAR)[..] else { panic!("one at each end") };
        assert_eq!([&few["class"], &most["class"]], [&Value::Null, &json!(class)], "{fault:?}: {few} {most}");
        teach(&mut field, 0, "ada", class);
        teach(&mut field, 8, "bob", class);
    }
    for robot in FEW {
        let told = field.robots[robot].told();
        let held: Vec<_> = told[before[robot]..].iter().filter(|told| told["event"] == "held").collect();
        assert!(held.len() >= rounds, "robot {robot} held {} decisions of {rounds} rounds", held.len());
        for held in held {
            says_why(&held["decision"]);
        }
    }

    let knew: Vec<u64> = field.robots.iter_mut().map(|robot| common(&status(robot)).1).collect();
    fault.end(&field);
    let healed = Instant::now();
    let (known, at) = together(&mut field, healed);
    let took = healed.elapsed();
    eprintln!(
        "{fault:?}: {rounds} rounds apart, {knew:?} samples known; {known} everywhere {took:?} after the heal \
         (all known, the same held, the same known: {at:?})"
    );
    assert!(known > *knew.iter().max().expect("nine robots"), "neither part learned anything from the other");
    assert!(took <= soon, "{fault:?}: together {took:?} after the heal");
    field.show(3);
    let last = field.robots.iter().flat_map(Process::told).filter_map(|told| told["round"].as_u64()).max();
    field.robots[0].order("open");
    let agreed = field.agreed(last.expect("rounds") + 1, &[0, 1, 2, 3, 4, 5, 6, 7, 8], PATIENCE);
    assert_eq!([&agreed["class"], &agreed["certificate"]["robots"]], [&json!(3), &json!(9)], "{agreed}");
    for (round, gestures) in gestures(&field) {
        assert!(gestures.len() <= 1, "{fault:?}: round {round} was decided for {gestures:?}");
    }
}

impl Fault {
    fn begin(self, field: &Field) {
        match self {
            Self::Cut => field.namespaces.cut(BETWEEN),
            Self::Deaf(node) => field.namespaces.deafen(BETWEEN, node),
            Self::CutAndSlow => {
                SLOW.iter().for_each(|link| field.namespaces.narrow(*link, BYTES_PER_SECOND));
                field.namespaces.cut(BETWEEN);
            }
        }
    }

    /// The link between the parts is there again; slow ones stay as slow.
    fn end(self, field: &Field) {
        match self {
            Self::Cut | Self::CutAndSlow => field.namespaces.heal(BETWEEN),
            Self::Deaf(_) => field.namespaces.widen(BETWEEN),
        }
    }
}

/// Shows all gestures in turn, and says what they are, until two in a row are decided for what they are.
fn learn(field: &mut Field) {
    let mut known = 0;
    for class in [0, 2, 4, 5, 1, 3].into_iter().cycle().take(LESSONS) {
        field.show(class);
        let decided = &round(field, &FAR[..1])[0];
        known = if decided["class"] == json!(class) { known + 1 } else { 0 };
        if known == 2 {
            return;
        }
        teach(field, 0, "ada", class);
    }
    panic!(
        "{LESSONS} lessons were not enough: {:?}",
        field.robots[0].told().iter().rfind(|t| t["event"] == "held")
    );
}

/// Lets these robots open a round, each in its part, and waits until it is over there. What each then holds.
fn round(field: &mut Field, openers: &[usize]) -> Vec<Value> {
    let before: Vec<usize> = openers.iter().map(|robot| field.robots[*robot].told().len()).collect();
    openers.iter().for_each(|robot| field.robots[*robot].order("open"));
    let over = |(robot, before): (&usize, usize)| {
        let over = |told: &[Value]| {
            let of = |event| told[before..].iter().rfind(|told| told["event"] == event);
            let (closed, held) = (of("closed")?, of("held")?);
            (closed["round"] == held["round"]).then(|| held["decision"].clone())
        };
        let held = field.robots[*robot].wait(PATIENCE, over);
        held.unwrap_or_else(|| panic!("robot {robot}: {:#?}", &field.robots[*robot].told()[before..]))
    };
    openers.iter().zip(before).map(over).collect()
}

/// Somebody at that robot says what was shown in the round of which it holds the decision.
fn teach(field: &mut Field, robot: usize, by: &str, class: u32) {
    let robot = &mut field.robots[robot];
    let said = |told: &[Value]| told.iter().filter(|told| told["event"] == "said").count();
    let (told, before) = (robot.told(), said(&robot.told()));
    let held = told.iter().rfind(|told| told["event"] == "held").expect("a decision");
    let word = json!({"say": "was", "round": held["decision"]["round"], "class": class});
    robot.order(&format!("says {by} {word}"));
    let more = |told: &[Value]| (said(told) > before).then_some(());
    robot.wait(PATIENCE, more).expect("it is told");
}

/// Four of nine decided nothing, as they are four.
fn says_why(held: &Value) {
    let decision: Decision = serde_json::from_value(held.clone()).expect("a decision");
    let certificate = &decision.certificate;
    assert_eq!((decision.class, certificate.robots, certificate.quorum), (None, 9, 5), "{held}");
    let (_, reason) = outcome(&decision, &MindConfig::default());
    assert!(matches!(reason, Reason::TooFewRobots { counted: 0..5, needed: 5 }), "{reason:?}: {held}");
}

/// Waits until all robots know all others, hold the same of the newest round, and know the same samples. How many, and when each of that
/// first was so.
fn together(field: &mut Field, since: Instant) -> (u64, [Duration; 3]) {
    let mut first = [None; 3];
    loop {
        let held = |robot: &Process| {
            let held = robot.told().into_iter().rfind(|told| told["event"] == "held");
            held.map(|held| (held["decision"]["round"].clone(), held["class"].clone()))
        };
        let last: Vec<_> = field.robots.iter().map(held).collect();
        let known: Vec<Value> = field.robots.iter_mut().map(status).collect();
        let shared: u64 = known.iter().map(|status| sum(status, "shared")).sum();
        let alive = |status: &Value| status["alive"].as_array().map_or(0, Vec::len);
        let now = [
            known.iter().all(|status| alive(status) == 9),
            last.iter().all(|held| *held == last[0]),
            known.iter().all(|status| common(status) == (common(&known[0]).0, shared)),
        ];
        for (first, now) in first.iter_mut().zip(now) {
            *first = now.then(|| first.unwrap_or_else(|| since.elapsed()));
        }
        if let [Some(alive), Some(held), Some(common)] = first {
            return (shared, [alive, held, common]);
        }
        let shown: Vec<_> =
            known.iter().map(|s| (common(s), alive(s), s["neighbours"].to_string())).collect();
        assert!(since.elapsed() < 6 * TOGETHER, "{shared} shared, {first:?} {last:#?} {shown:#?}");
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// Its status, asked anew.
fn status(robot: &mut Process) -> Value {
    let before = robot.told().len();
    robot.order("status");
    let answered = |told: &[Value]| {
        told[before..].iter().rfind(|told| told["event"] == "status").map(|t| t["status"].clone())
    };
    robot.wait(PATIENCE, answered).expect("it answers")
}

/// The common knowledge by its digest, and how many samples that is.
fn common(status: &Value) -> (String, u64) {
    (status["learning"]["common"].to_string(), sum(status, "shared") + sum(status, "external"))
}

fn sum(status: &Value, part: &str) -> u64 {
    status["learning"][part].as_array().into_iter().flatten().filter_map(Value::as_u64).sum()
}

/// For which gestures each round was decided, by any robot at any time.
fn gestures(field: &Field) -> BTreeMap<String, BTreeSet<u64>> {
    let mut gestures: BTreeMap<String, BTreeSet<u64>> = BTreeMap::new();
    for told in field.robots.iter().flat_map(Process::told).filter(|told| told["event"] == "held") {
        let of_round = gestures.entry(told["decision"]["round"].to_string()).or_default();
        of_round.extend(told["class"].as_u64());
    }
    gestures
}
