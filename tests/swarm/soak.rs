//! A sealed swarm for hours: liars among it, a stranger at the door, links that break and robots that die.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use gestalt_protocol::RobotId;
use gestalt_strategies::{MindConfig, PoisonDefence};
use gestalt_tests::{Namespaces, Process, short_rounds, unique};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde_json::{Value, json};

use crate::knocking::Thief;

const PATIENCE: Duration = Duration::from_secs(30);
const PORT: u16 = 7447;
const CLASSES: usize = 6;

/// How often something breaks, or is mended.
const CHURN: Duration = Duration::from_secs(5);

/// Until the last robot is out of a round that the first has left; what is shown may change then.
const OVER: Duration = Duration::from_secs(2);

/// What each liar does in turn: one alone equivocates last, as who is convicted counts no more.
const LIES: [&str; 3] = ["flood", "poison", "equivocate"];

/// Against what they share. Who was hardly taught yet, and is without it, decides next to nothing while one poisons.
const DEFENCE: PoisonDefence = PoisonDefence { influence: 1.25, agreement: 3.0 };

/// These are never killed: their memory is watched.
const WATCHED: usize = 4;

/// How large a swarm, for how long.
struct Extent {
    honest: usize,
    liars: usize,
    time: Duration,
    /// After this long memory should grow no more.
    settled: Duration,
    /// How much it may grow all the same.
    growth: f64,
}

impl Extent {
    /// With `GESTALT_LONG` two hours, or as many seconds as `GESTALT_SOAK` says.
    fn of_environment() -> Self {
        let seconds = std::env::var("GESTALT_SOAK").ok().and_then(|seconds| seconds.parse().ok());
        match std::env::var_os("GESTALT_LONG").map(|_| Duration::from_secs(seconds.unwrap_or(7200))) {
            Some(time) => Self {
                honest: 17,
                liars: 3,
                time,
                settled: Duration::from_secs(600).min(time / 2),
                growth: 1.05,
            },
            None => {
                let time = Duration::from_secs(60);
                Self { honest: 7, liars: 1, time, settled: time / 2, growth: 1.5 }
            }
        }
    }

    fn robots(&self) -> usize {
        self.honest + self.liars
    }

    /// A ring, and chords over a quarter of it.
    fn links(&self) -> Vec<(u32, u32)> {
        let n = self.robots() as u32;
        let ring = (0..n).map(|i| (i, (i + 1) % n));
        ring.chain((0..n).map(|i| (i, (i + n.div_ceil(4)) % n))).collect()
    }
}

/// What a robot has said it keeps: by round, of which gesture and how many samples.
type Acknowledged = BTreeMap<String, (usize, u64)>;

struct Soak {
    extent: Extent,
    name: String,
    /// The honest; `None` while one is dead. Dropped, and so killed, before their namespaces.
    robots: Vec<Option<Process>>,
    liars: Vec<Process>,
    namespaces: Namespaces,
    folder: tempfile::TempDir,
    cut: Vec<(u32, u32)>,
    rng: ChaCha8Rng,
    /// What is shown.
    showing: usize,
    /// By the name of a round, what was shown in it.
    shown: BTreeMap<String, usize>,
    acknowledged: Vec<Acknowledged>,
    rounds: Rounds,
}

/// What became of the rounds.
#[derive(Debug, Default)]
struct Rounds {
    opened: usize,
    decided: usize,
    /// Announced as final, by robots.
    announced: usize,
    /// What was announced that was not shown.
    wrong: Vec<Value>,
}

impl Soak {
    fn start(extent: Extent) -> Self {
        let links = extent.links();
        let namespaces = Namespaces::new(extent.robots() as u32, &links);
        let mut soak = Self {
            name: unique("soak"),
            robots: Vec::new(),
            liars: Vec::new(),
            namespaces,
            folder: tempfile::tempdir().unwrap(),
            cut: Vec::new(),
            rng: ChaCha8Rng::seed_from_u64(13),
            showing: 0,
            shown: BTreeMap::new(),
            acknowledged: vec![Acknowledged::new(); extent.honest],
            rounds: Rounds::default(),
            extent,
        };
        soak.robots = (0..soak.extent.honest).map(|node| Some(soak.robot(node))).collect();
        soak.liars = (soak.extent.honest..soak.extent.robots()).map(|node| soak.liar(node)).collect();
        soak
    }

    fn memory(&self, node: usize) -> PathBuf {
        self.folder.path().join(format!("{node}.memory"))
    }

    fn to_dial(&self, node: usize) -> Vec<String> {
        let tcp = self.namespaces.to_dial(node as u32, PORT);
        tcp.iter().map(|endpoint| endpoint.replace("tcp/", "tls/")).collect()
    }

    fn process(&self, node: usize, orders: &Value) -> Process {
        let namespace = self.namespaces.name(node as u32);
        Process::start(Path::new(env!("CARGO_BIN_EXE_test-robot")), Some(&namespace), orders)
    }

    fn robot(&self, node: usize) -> Process {
        let rounds = MindConfig { liars: self.extent.liars as u32, ..short_rounds() };
        self.process(
            node,
            &json!({
                "id": node,
                "swarm": self.name,
                "members": self.extent.robots(),
                "sees": 0,
                "rounds": rounds,
                "learn": {"keep": 3, "share": 0.5, "memory": self.memory(node), "poison": DEFENCE},
                "link": {
                    "listen": [format!("tls/0.0.0.0:{PORT}"), "tcp/127.0.0.1:0"],
                    "connect": self.to_dial(node),
                },
            }),
        )
    }

    fn liar(&self, node: usize) -> Process {
        self.process(
            node,
            &json!({
                "id": node,
                "swarm": self.name,
                "members": self.extent.robots(),
                "lies": true,
                "link": {"connect": self.to_dial(node)},
            }),
        )
    }

    /// A stranger in the first robot's namespace, who knocks at its neighbours.
    fn stranger(&self) -> Thief {
        let orders = json!({
            "swarm": self.name,
            "endpoints": self.to_dial(0),
            "thief": RobotId(self.extent.robots() as u32),
        });
        Thief::start(Some(&self.namespaces.name(0)), &orders)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.rng.next_u64() % n as u64) as usize
    }

    fn living(&self) -> impl Iterator<Item = &Process> {
        self.robots.iter().flatten()
    }

    /// Breaks something, or mends what has been broken longest: links, and robots that are not watched.
    fn churn(&mut self) {
        if let Some(dead) = self.robots.iter().position(Option::is_none) {
            self.robots[dead] = Some(self.robot(dead));
        } else if self.cut.len() > self.extent.robots() / 6 || (!self.cut.is_empty() && self.below(3) == 0) {
            self.namespaces.heal(self.cut.remove(0));
        } else if self.below(3) == 0 {
            let links: Vec<_> = self.namespaces.links().filter(|link| !self.cut.contains(link)).collect();
            let link = links[self.below(links.len())];
            self.namespaces.cut(link);
            self.cut.push(link);
        } else {
            let dying = WATCHED + self.below(self.extent.honest - WATCHED);
            let mut robot = self.robots[dying].take().expect("none is dead");
            let told = robot.told_to_the_end();
            self.read(dying, &told);
        }
    }

    /// Shows a gesture to all, and lets a robot open a round. The name of the round, and whether it was decided there.
    fn round(&mut self, class: usize) -> Option<(usize, Value, bool)> {
        self.rounds.opened += 1;
        self.showing = class;
        let shown = format!("shown {class}");
        self.robots.iter_mut().flatten().for_each(|robot| robot.order(&shown));
        self.liars.iter_mut().for_each(|liar| liar.order(&shown));
        let opener = self.below(self.extent.honest);
        let robot = self.robots[opener].as_mut()?;
        robot.order("open");
        // What is told late of rounds before is not of this one.
        let over = |told: &[Value]| {
            let of = |event| told.iter().rfind(|told| told["event"] == event);
            let (closed, held) = (of("closed")?, of("held")?);
            let round = &held["decision"]["round"];
            let is_over = closed["round"] == held["round"] && !self.shown.contains_key(&round.to_string());
            is_over.then(|| (round.clone(), held["class"].clone()))
        };
        let (round, decided) = robot.wait(Duration::from_secs(8), over)?;
        self.shown.insert(round.to_string(), class);
        self.rounds.decided += usize::from(!decided.is_null());
        Some((opener, round, decided == json!(class)))
    }

    /// Somebody at that robot says what was shown in that round.
    fn teach(&mut self, robot: usize, round: &Value, class: usize) {
        let Some(robot) = self.robots[robot].as_mut() else { return };
        let word = json!({"say": "was", "round": round, "class": class});
        robot.order(&format!("says ada {word}"));
        let said = |told: &[Value]| told.iter().any(|told| told["event"] == "said").then_some(());
        robot.wait(PATIENCE, said).expect("it is told");
    }

    /// Takes in all that was told since.
    fn read_all(&mut self) {
        for node in 0..self.extent.honest {
            let told = self.robots[node].as_ref().map(Process::take_told).unwrap_or_default();
            self.read(node, &told);
        }
    }

    fn read(&mut self, node: usize, told: &[Value]) {
        for told in told {
            match told["event"].as_str() {
                Some("announced") => {
                    let shown = self.shown.get(&told["decision"]["round"].to_string());
                    self.rounds.announced += 1;
                    let is_wrong =
                        told["class"].as_u64().is_some_and(|class| shown != Some(&(class as usize)));
                    if is_wrong {
                        self.rounds.wrong.push(json!({"shown": shown, "told": told}));
                    }
                }
                Some("answered") => {
                    let answer = &told["answer"];
                    let class = answer["to"]["class"].as_u64().map_or(0, |class| class as usize);
                    let samples = answer["samples"].as_u64().unwrap_or(0);
                    self.acknowledged[node].insert(answer["to"]["round"].to_string(), (class, samples));
                }
                _ => {}
            }
        }
    }

    /// Everybody is there again.
    fn calm(&mut self) {
        for link in std::mem::take(&mut self.cut) {
            self.namespaces.heal(link);
        }
        for node in 0..self.extent.honest {
            if self.robots[node].is_none() {
                self.robots[node] = Some(self.robot(node));
            }
        }
        let deadline = Instant::now() + PATIENCE;
        loop {
            let alive: Vec<usize> = self
                .robots
                .iter_mut()
                .flatten()
                .map(|robot| {
                    let status = status(robot);
                    status["alive"].as_array().map_or(0, Vec::len)
                })
                .collect();
            if alive.iter().all(|alive| *alive >= self.extent.honest) {
                return;
            }
            assert!(Instant::now() < deadline, "alive, as each knows: {alive:?}");
            std::thread::sleep(Duration::from_millis(200));
        }
    }

    /// Resident kilobytes and open files of those that are never killed; of files the fewest within three seconds, as knocks come and go.
    fn resources(&self) -> Vec<(u64, usize)> {
        let of = |robot: &Process| {
            let process = PathBuf::from(format!("/proc/{}", robot.id()));
            let status = std::fs::read_to_string(process.join("status")).expect("it runs");
            let resident = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("its memory");
            let files = || std::fs::read_dir(process.join("fd")).expect("its files").count();
            let fewest = (0..30).map(|_| {
                std::thread::sleep(Duration::from_millis(100));
                files()
            });
            (
                resident.trim().trim_end_matches(" kB").parse().expect("a number"),
                fewest.min().expect("thirty"),
            )
        };
        self.living().take(WATCHED).map(of).collect()
    }
}

fn status(robot: &mut Process) -> Value {
    let before = robot.told().len();
    robot.order("status");
    let answered = |told: &[Value]| {
        told[before..].iter().rfind(|told| told["event"] == "status").map(|told| told["status"].clone())
    };
    robot.wait(PATIENCE, answered).expect("it answers")
}

/// Its samples of a class.
fn held(status: &Value, class: usize) -> u64 {
    let of = |part: &str| status["learning"][part][class].as_u64().unwrap_or(0);
    of("personal") + of("shared") + of("external")
}

pub fn liars_and_a_stranger_change_nothing_for_hours() {
    let extent = Extent::of_environment();
    let (time, settled, growth) = (extent.time, extent.settled, extent.growth);
    let mut soak = Soak::start(extent);
    soak.calm();
    let mut stranger = soak.stranger();
    let (began, mut churned, mut taught) = (Instant::now(), Instant::now(), Instant::now());
    let (mut known, mut turn, mut before) = (0, None, None);
    while began.elapsed() < time {
        let third = (LIES.len() as f64 * began.elapsed().as_secs_f64() / time.as_secs_f64()) as usize;
        if turn.replace(third) != Some(third) {
            for (i, liar) in soak.liars.iter_mut().enumerate() {
                liar.order(LIES[(i + third) % LIES.len()]);
            }
        }
        if churned.elapsed() > CHURN {
            churned = Instant::now();
            soak.churn();
        }
        let class = soak.rounds.opened % CLASSES;
        soak.read_all();
        if let Some((opener, round, right)) = soak.round(class) {
            if let Ok(round) = serde_json::from_value(round.clone()) {
                stranger.is_told(round);
            }
            known = if right { known + 1 } else { 0 };
            if known < CLASSES && (taught.elapsed() > settled || began.elapsed() < settled) {
                taught = Instant::now();
                soak.teach(opener, &round, class);
            }
        }
        std::thread::sleep(OVER);
        if before.is_none() && began.elapsed() > settled {
            before = Some(soak.resources());
        }
    }
    soak.liars.iter_mut().for_each(|liar| liar.order("equivocate"));
    soak.calm();
    soak.round(0);
    std::thread::sleep(OVER);
    soak.read_all();
    let (before, after) = (before.expect("it settled"), soak.resources());
    let knocks = stranger.0.told().len();
    assert_eq!(stranger.0.ended(), None, "the stranger's process ended by itself");
    let statuses: Vec<Value> = soak.robots.iter_mut().flatten().map(status).collect();
    let Rounds { opened, decided, announced, wrong } = &soak.rounds;
    let acknowledged: u64 =
        soak.acknowledged.iter().flat_map(BTreeMap::values).map(|(_, samples)| samples).sum();
    eprintln!(
        "{:?}: {opened} rounds, {decided} decided, {announced} announced as final, {} of them wrong; {acknowledged} samples acknowledged; {knocks} knocks; \
         kilobytes and files {before:?} -> {after:?}",
        began.elapsed(),
        wrong.len()
    );
    assert!(wrong.is_empty(), "{} wrong: {:#}", wrong.len(), wrong[0]);
    assert!(decided * 4 > *opened, "{decided} of {opened} rounds came to something");
    let turned_away = |status: &Value| status["counters"]["refused_link_not_enrolled"].as_u64();
    assert!(statuses.iter().filter_map(turned_away).sum::<u64>() > 0, "the stranger knocked nowhere");
    for (node, (status, acknowledged)) in statuses.iter().zip(&soak.acknowledged).enumerate() {
        for liar in soak.extent.honest..soak.extent.robots() {
            let convicted = &status["counters"][format!("convicted_{liar}")];
            assert_eq!(convicted, &json!(1), "robot {node}, of {liar}: {:#}", status["counters"]);
        }
        for class in 0..CLASSES {
            let promised: u64 = acknowledged.values().filter(|(of, _)| *of == class).map(|(_, n)| n).sum();
            assert!(
                held(status, class) >= promised,
                "robot {node} has {} of {promised} of class {class}",
                held(status, class)
            );
        }
    }
    for (before, after) in before.iter().zip(&after) {
        assert!(after.0 as f64 <= growth * before.0 as f64, "kilobytes: {before:?} -> {after:?}");
        assert!(after.1 <= before.1 + 16, "open files: {before:?} -> {after:?}");
    }
}
