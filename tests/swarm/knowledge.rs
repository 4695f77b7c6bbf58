//! Whatever is lost, cut or killed: those who live end with the same common knowledge.

use std::path::Path;
use std::time::{Duration, Instant};

use gestalt_tests::{Namespaces, Process, not_permitted, unique};
use serde_json::{Value, json};

const PORT: u16 = 7447;

/// Part of all messages that every robot drops unread.
const LOSS: f64 = 0.3;

/// The robot that is killed, and the one that joins late.
const DEAD: u32 = 2;
const LATE: u32 = 5;

fn robot(namespaces: &Namespaces, swarm: &str, id: u32) -> Process {
    let orders = json!({
        "id": id,
        "swarm": swarm,
        "sees": 0,
        "learn": {"keep": 3, "share": 0.5},
        "link": {
            "listen": [format!("tcp/0.0.0.0:{PORT}")],
            "connect": namespaces.to_dial(id, PORT),
            "loss": LOSS,
        },
    });
    Process::start(Path::new(env!("CARGO_BIN_EXE_test-robot")), Some(&namespaces.name(id)), &orders)
}

/// Its status, asked anew.
fn status(robot: &mut Process) -> Value {
    let before = robot.told().len();
    robot.order("status");
    let answered = |told: &[Value]| {
        let news = &told[before.min(told.len())..];
        news.iter().rev().find(|told| told["event"] == "status").map(|told| told["status"].clone())
    };
    robot.wait(Duration::from_secs(2), answered).unwrap_or(Value::Null)
}

/// How many samples of the common knowledge it holds.
fn common(status: &Value) -> u64 {
    let of = |part: &str| {
        status["learning"][part].as_array().map_or(0, |n| n.iter().filter_map(Value::as_u64).sum::<u64>())
    };
    of("shared") + of("external")
}

#[test]
fn under_loss_cuts_a_death_and_a_late_joiner_all_end_with_the_same_knowledge() {
    if not_permitted() {
        return;
    }
    // A ring of five, and the place of one that joins between the third and the fifth.
    let links = [(0, 1), (1, 2), (2, 3), (3, 4), (0, 4), (3, LATE), (4, LATE)];
    let namespaces = Namespaces::new(6, &links);
    let swarm = unique("knowledge");
    let mut robots: Vec<Process> = (0..5).map(|id| robot(&namespaces, &swarm, id)).collect();
    for robot in &robots {
        let all = |told: &[Value]| {
            let alive = told.iter().rev().find(|told| told["event"] == "alive")?;
            (alive["robots"].as_array()?.len() >= 4).then_some(())
        };
        assert!(robot.wait(Duration::from_secs(15), all).is_some(), "all know all");
    }
    let mut shared = 0;
    for lesson in 0..8_u32 {
        let class = lesson % 6;
        // One link after the other is cut, and healed when the next one is.
        let cut = links[lesson as usize % 5];
        namespaces.cut(cut);
        robots.iter_mut().for_each(|robot| robot.order(&format!("shown {class}")));
        robots[0].order("open");
        std::thread::sleep(Duration::from_millis(2000));
        robots[0].order(&format!("was {class}"));
        if lesson == 4 {
            // In the very moment in which it has shared.
            let of = |told: &[Value]| told.iter().filter(|told| told["event"] == "shared").count();
            let before = of(&robots[DEAD as usize].told());
            let again = |told: &[Value]| (of(told) > before).then_some(());
            shared += usize::from(robots[DEAD as usize].wait(Duration::from_secs(3), again).is_some());
            robots[DEAD as usize].kill();
        }
        std::thread::sleep(Duration::from_millis(600));
        namespaces.heal(cut);
    }
    assert_eq!(shared, 1, "the one that is killed had shared");
    robots[DEAD as usize] = robot(&namespaces, &swarm, LATE);
    let calm = Instant::now();
    let mut known = Vec::new();
    while calm.elapsed() < Duration::from_secs(10) {
        known = robots.iter_mut().map(status).collect();
        let digest = |status: &Value| status["learning"]["common"].clone();
        if known.iter().all(|status| digest(status) == digest(&known[0]) && common(status) >= 30) {
            let samples = common(&known[0]);
            return eprintln!(
                "the same {samples} samples everywhere {:?} after the last fault",
                calm.elapsed()
            );
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    let sizes: Vec<_> = known
        .iter()
        .map(|status| (&status["learning"]["common"], common(status), &status["neighbours"]))
        .collect();
    panic!("10 s after the last fault: {sizes:#?}");
}
