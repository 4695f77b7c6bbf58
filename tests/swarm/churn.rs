//! Nine robots in a grid whose links are cut silently and healed at random while rounds run.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use gestalt_strategies::Quorum;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde_json::Value;

use crate::field::Field;

/// With `GESTALT_LONG` set: ten runs of 30 s; otherwise two of 10 s.
fn extent() -> (u64, Duration) {
    match std::env::var_os("GESTALT_LONG") {
        Some(_) => (10, Duration::from_secs(30)),
        None => (2, Duration::from_secs(10)),
    }
}

fn grid() -> Vec<(u32, u32)> {
    let across = (0..9).filter(|i| i % 3 < 2).map(|i| (i, i + 1));
    let down = (0..6).map(|i| (i, i + 3));
    across.chain(down).collect()
}

pub fn a_grid_under_churn_never_ends_a_round_differently_and_agrees_in_calm() {
    let (runs, time) = extent();
    for seed in 0..runs {
        one_run(seed, time);
    }
}

fn one_run(seed: u64, time: Duration) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    // One robot mistakes the gesture. Alone or with few others it would settle on another one than the rest; the
    // quorum keeps it from that, however the links are cut.
    let mut field = Field::new(9, &grid(), Quorum::Evidence(4), |node| match node {
        0 | 2 | 3 | 4 | 6 | 8 => Some((1, 0.7)),
        1 => Some((2, 0.7)),
        _ => None,
    });
    let links: Vec<_> = field.namespaces.links().collect();
    let mut cut = vec![false; links.len()];
    let began = Instant::now();
    let mut opened = 0;
    while began.elapsed() < time {
        let k = rng.next_u32() as usize % links.len();
        if cut[k] {
            field.namespaces.heal(links[k]);
        } else if cut.iter().filter(|cut| **cut).count() < 5 {
            field.namespaces.cut(links[k]);
        } else {
            continue;
        }
        cut[k] = !cut[k];
        // The last round has its time before the calm that is measured.
        let last_call = began.elapsed() + Duration::from_secs(2) > time;
        if !last_call && opened as u128 * 2000 <= began.elapsed().as_millis() {
            opened += 1;
            let opener = rng.next_u32() as usize % 9;
            field.robots[opener].order("open");
        }
        std::thread::sleep(Duration::from_millis(u64::from(100 + rng.next_u32() % 400)));
    }
    for (k, link) in links.iter().enumerate() {
        if cut[k] {
            field.namespaces.heal(*link);
        }
    }
    let calm = Instant::now();
    let agreed = wait_until_last_agreed(&field, Duration::from_secs(30));
    let took = calm.elapsed();
    let last = lasts(&field)[0].as_ref().map(|(round, decision)| (*round, decision["class"].clone()));
    eprintln!("churn, seed {seed}: {opened} rounds opened, {last:?} held by all after {took:?} of calm");
    let differing = differing_outcomes(&field);
    assert!(agreed, "seed {seed}: no agreement in 30 s of calm: {:?}", lasts(&field));
    assert!(differing.is_empty(), "seed {seed}: rounds ended differently: {differing:?}");
}

/// The last decision each robot holds: its round, and all of it.
fn lasts(field: &Field) -> Vec<Option<(u64, Value)>> {
    let last = |told: &[Value]| {
        let held = told.iter().rev().find(|told| told["event"] == "held")?;
        Some((held["round"].as_u64()?, held["decision"].clone()))
    };
    field.robots.iter().map(|robot| last(&robot.told())).collect()
}

fn wait_until_last_agreed(field: &Field, patience: Duration) -> bool {
    let deadline = Instant::now() + patience;
    while Instant::now() < deadline {
        let newest =
            field.robots.iter().flat_map(|robot| robot.told()).filter_map(|told| told["round"].as_u64());
        let newest = newest.max();
        let lasts = lasts(field);
        if lasts
            .iter()
            .all(|last| last.is_some() && *last == lasts[0] && last.as_ref().map(|l| l.0) == newest)
        {
            return true;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    false
}

/// The rounds that ended with more than one gesture, by what the robots last held of each. "No decision" is none.
fn differing_outcomes(field: &Field) -> BTreeMap<u64, BTreeMap<u64, Vec<usize>>> {
    let mut outcomes: BTreeMap<u64, BTreeMap<u64, Vec<usize>>> = BTreeMap::new();
    for (node, robot) in field.robots.iter().enumerate() {
        let told = robot.told();
        let held = told.iter().filter(|told| told["event"] == "held");
        let finals: BTreeMap<_, _> =
            held.map(|told| (told["round"].as_u64(), told["class"].as_u64())).collect();
        for (round, class) in finals {
            if let (Some(round), Some(class)) = (round, class) {
                outcomes.entry(round).or_default().entry(class).or_default().push(node);
            }
        }
    }
    let decided = outcomes.len();
    assert!(decided > 0, "no round ended with a gesture");
    outcomes.retain(|_, classes| classes.len() > 1);
    eprintln!("churn: {decided} rounds ended with a gesture, {} of them with several", outcomes.len());
    outcomes
}
