//! Links that end without a word.

use std::path::Path;
use std::time::{Duration, Instant};

use gestalt_tests::{Namespaces, Process, short_rounds, unique};
use serde_json::{Value, json};

use crate::knocking::Thief;

const PATIENCE: Duration = Duration::from_secs(30);
const PORT: u16 = 7447;
const ROBOTS: u32 = 5;

/// Twice as long as the system goes on trying to send what nobody acknowledges, where it is asked to.
const LONG: Duration = Duration::from_secs(20);

/// What was on its way to whoever is gone is never acknowledged. Whoever closes such links, also those of a stranger who was not let in, must not wait
/// for that where others wait to be let in.
pub fn a_robot_whose_neighbours_and_strangers_lose_power_lets_clients_in() {
    let links: Vec<_> = (1..ROBOTS).map(|other| (other, 0)).collect();
    let namespaces = Namespaces::new(ROBOTS, &links);
    let (swarm, folder) = (unique("power"), tempfile::tempdir().unwrap());
    let start = |id: u32| {
        let tcp = namespaces.to_dial(id, PORT);
        let connect: Vec<_> = tcp.iter().map(|endpoint| endpoint.replace("tcp/", "tls/")).collect();
        let orders = json!({
            "id": id,
            "swarm": swarm,
            "members": ROBOTS,
            "sees": 0,
            "rounds": short_rounds(),
            "learn": {"keep": 3, "share": 0.5, "memory": folder.path().join(format!("{id}.memory"))},
            "link": {"listen": [format!("tls/0.0.0.0:{PORT}"), "tcp/127.0.0.1:0"], "connect": connect},
        });
        Process::start(Path::new(env!("CARGO_BIN_EXE_test-robot")), Some(&namespaces.name(id)), &orders)
    };
    let mut robots: Vec<_> = (0..ROBOTS).map(start).collect();
    let all = |told: &[Value]| {
        let alive = |told: &&Value| {
            told["robots"].as_array().is_some_and(|robots| robots.len() + 1 == ROBOTS as usize)
        };
        told.iter().filter(|told| told["event"] == "alive").find(alive).map(drop)
    };
    robots.iter_mut().for_each(|robot| robot.wait(PATIENCE, all).expect("all meet"));
    let first = &mut robots[0];
    first.order("open");
    let held = |told: &[Value]| told.iter().find(|told| told["event"] == "held").cloned();
    let round = first.wait(PATIENCE, held).expect("it decides")["decision"]["round"].clone();
    let orders = json!({"swarm": swarm, "endpoints": namespaces.to_dial(1, PORT).iter().map(|at| at.replace("tcp/", "tls/")).collect::<Vec<_>>(), "thief": ROBOTS});
    let mut thief = Thief::start(Some(&namespaces.name(1)), &orders);
    thief.is_told(serde_json::from_value(round.clone()).expect("a round"));
    let knocked = |told: &[Value]| (told.len() > 3).then_some(());
    thief.0.wait(PATIENCE, knocked).expect("it knocks");
    let (began, mut said) = (Instant::now(), 0);
    while began.elapsed() < LONG {
        match said % 10 {
            0 => namespaces.links().for_each(|link| namespaces.cut(link)),
            7 => namespaces.links().for_each(|link| namespaces.heal(link)),
            _ => {}
        }
        let word = json!({"say": "was", "round": round, "class": said % 2});
        first.order(&format!("says ada {word}"));
        said += 1;
        let so_often = |told: &[Value]| {
            (told.iter().filter(|told| told["event"] == "said").count() == said).then_some(())
        };
        first.wait(PATIENCE, so_often).expect("who is beside it is let in and answered");
        std::thread::sleep(Duration::from_millis(200));
    }
}
