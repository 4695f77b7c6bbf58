//! Different bodies, one swarm: Foot-bots that see for themselves, Parrots that stream, and a centre that sees for them.
//! All are processes of the program itself, in a line, and nobody opens rounds but what they see move.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::Command;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use gestalt_tests::{Process, model, unique};
use gestalt_vision::human::{Human, Schedule};
use serde_json::{Value, json};

const SCHEDULE: Schedule = Schedule { period: Duration::from_secs(5), still: Duration::from_millis(2400) };
const SEED: u64 = 11;
const SHOWINGS: u64 = 20;
const PATIENCE: Duration = Duration::from_secs(30);

const FOOTBOTS: u32 = 4;
const CENTRE: u32 = 10;
const PARROTS: [u32; 2] = [21, 22];

/// Writes robots' configurations and starts them, each linked to one that runs.
struct Cast {
    folder: tempfile::TempDir,
    swarm: String,
}

impl Cast {
    fn start(&self, verb: &str, id: u32, camera: Value, zenoh: Value) -> Process {
        let config = json!({
            "robot": {"id": id},
            "swarm": self.swarm,
            "camera": camera,
            "model": {"file": self.model()},
            "links": {"scouting": {"enabled": false}},
            "zenoh": zenoh,
        });
        let file = self.folder.path().join(format!("{id}.json5"));
        std::fs::write(&file, config.to_string()).unwrap();
        let gestalt = env!("CARGO_BIN_EXE_test-gestalt");
        Process::run(Command::new(gestalt).args([verb, "--json", "--config"]).arg(file))
    }

    fn model(&self) -> PathBuf {
        self.folder.path().join("hands.gestalt")
    }
}

/// A camera before the human who goes by the clock.
fn camera(model: &str, bearing_deg: f64) -> Value {
    let pose = json!({"bearing_deg": bearing_deg, "elevation_deg": 0.0, "distance_m": 0.9});
    json!({
        "model": model,
        "source": {"rendered": {"pose": pose, "seed": SEED, "schedule": SCHEDULE}},
        "motion": {"enabled": true},
    })
}

fn listening(connect: &[String]) -> Value {
    json!({"listen": {"endpoints": ["tcp/127.0.0.1:0"]}, "connect": {"endpoints": connect}})
}

/// Where a process listens, once it says so.
fn locator(process: &Process) -> String {
    let started = |told: &[Value]| told.iter().find(|told| told["event"] == "started").cloned();
    let started = process.wait(PATIENCE, started).expect("it starts");
    started["locators"][0].as_str().expect("a locator").to_owned()
}

fn clock() -> Duration {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap()
}

/// The last decision a process told of each round, by event.
fn decisions(process: &Process, event: &str) -> BTreeMap<u64, Value> {
    let told = process.told();
    let of_event = told.iter().filter(|told| told["event"] == event);
    of_event
        .filter_map(|told| Some((told["decision"]["round"]["counter"].as_u64()?, told["decision"].clone())))
        .collect()
}

pub fn footbots_on_board_and_parrots_of_a_centre_decide_twenty_gestures_alike() {
    let cast = Cast { folder: tempfile::tempdir().unwrap(), swarm: unique("mixed") };
    model().write(&cast.model()).unwrap();
    // The robots wake up while nobody is there.
    let (_, into) = SCHEDULE.divide(clock());
    std::thread::sleep(SCHEDULE.period - into);
    // Four Foot-bots in a line, the centre at its end, and the Parrots at the centre.
    let mut robots: Vec<Process> = Vec::new();
    let mut before: Vec<String> = Vec::new();
    for id in 1..=FOOTBOTS {
        let bearing = f64::from(id) * 18.0 - 45.0;
        robots.push(cast.start("peer", id, camera("footbot", bearing), listening(&before)));
        before = vec![locator(&robots[robots.len() - 1])];
    }
    let watching = json!({"model": "parrot", "motion": {"enabled": true}});
    robots.push(cast.start("center", CENTRE, watching, listening(&before)));
    let centre = vec![locator(&robots[robots.len() - 1])];
    let parrots = PARROTS.map(|id| {
        let zenoh = json!({"connect": {"endpoints": centre}});
        cast.start("stream", id, camera("parrot", f64::from(id % 2) * 30.0 - 15.0), zenoh)
    });
    // Two showings for them to find each other.
    let first = SCHEDULE.divide(clock()).0 + 2;
    let end = SCHEDULE.period * u32::try_from(first + SHOWINGS).unwrap();
    std::thread::sleep(end.saturating_sub(clock()) + Duration::from_secs(1));

    let human = Human::new(SEED);
    let held: Vec<BTreeMap<u64, Value>> = robots.iter().map(|robot| decisions(robot, "held")).collect();
    let heard: Vec<BTreeMap<u64, Value>> = parrots.iter().map(|p| decisions(p, "announced")).collect();
    let mut opened: BTreeMap<u64, u64> = BTreeMap::new();
    for told in robots.iter().flat_map(Process::told).filter(|told| told["event"] == "opened") {
        let (round, at) = (told["round"]["counter"].as_u64().unwrap(), told["at_ms"].as_u64().unwrap());
        opened.entry(round).and_modify(|first| *first = at.min(*first)).or_insert(at);
    }
    let mut by_showing: BTreeMap<u64, Vec<u64>> = BTreeMap::new();
    let (mut right, mut of_both) = (0, 0);
    for (round, at) in &opened {
        let at = Duration::from_millis(*at);
        // Whose hand has just left belongs to the showing before.
        let (showing, _) = SCHEDULE.divide(at.saturating_sub(SCHEDULE.nobody()));
        if !(first..first + SHOWINGS).contains(&showing) {
            continue;
        }
        let shown = human.last_shown(at, &SCHEDULE);
        let classes: Vec<Option<&Value>> = held.iter().map(|held| Some(&held.get(round)?["class"])).collect();
        let told: Vec<Option<&Value>> = heard.iter().map(|heard| Some(&heard.get(round)?["class"])).collect();
        eprintln!(
            "round {round} of showing {}: shown {shown:?}, held {classes:?}, heard {told:?}",
            showing - first
        );
        let decided = classes[0].expect("the first Foot-bot holds a decision");
        assert!(classes.iter().chain(&told).all(|class| *class == Some(decided)), "round {round} differs");
        right += u64::from(*decided == json!(shown));
        let votes = held[0][round]["certificate"]["votes"].as_array().expect("votes");
        let voters: Vec<u64> = votes.iter().filter_map(|vote| vote["robot"].as_u64()).collect();
        let parrots = voters.iter().filter(|robot| **robot > u64::from(CENTRE)).count();
        of_both += u64::from(parrots > 0 && parrots < voters.len());
        by_showing.entry(showing - first).or_default().push(*round);
    }
    let rounds = by_showing.values().flatten().count() as u64;
    eprintln!("{right} of {rounds} rounds right, {of_both} by votes of both kinds");
    for showing in 0..SHOWINGS {
        assert!(by_showing.contains_key(&showing), "showing {showing} has no round: {by_showing:?}");
    }
    // A process that the machine keeps from running while the hand arrives takes the rest for another gesture.
    assert!(rounds <= SHOWINGS + 1, "{rounds} rounds: {by_showing:?}");
    assert!(right + 3 >= SHOWINGS, "{right} of {SHOWINGS} right");
    assert!(of_both + 3 >= SHOWINGS, "one ballot: {of_both} of {SHOWINGS}");
}
