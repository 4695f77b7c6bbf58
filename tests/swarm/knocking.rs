//! A robot that was expelled links anew ten times a second, with the keys it had, from a process of its own: it is to change nothing
//! in any round, and to end no robot.

use std::io::{BufRead, Write};
use std::process::{Command, ExitCode};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use gestalt_link::{Bearer, Robot};
use gestalt_protocol::{Envelope, Keys, Message, RobotId, RoundId, Stamp, Topic, Vote};
use gestalt_strategies::Classify;
use gestalt_tests::{Fixed, Process, by_tls, credentials, key, sealed, unique, with_eve};
use gestalt_trust::{Membership, SwarmId, statement};
use serde_json::{Value, json};
use tokio::task::JoinSet;
use zenoh::qos::CongestionControl;

use crate::siege::REFRACTORY;
use crate::stranger::{enter, star};
use crate::wall::voters;

/// The robot that is expelled.
const THIEF: RobotId = RobotId(3);

/// How often it links anew.
const KNOCK: Duration = Duration::from_millis(100);

/// Names, in the environment, the swarm that this process is to knock at, its endpoints, and the robot that it was: the scenarios' own program
/// is the thief's.
const ORDERS: &str = "GESTALT_KNOCK";

/// The members when it was one, the last.
fn members_before(swarm: &str, thief: RobotId) -> Membership {
    with_eve(swarm, thief.0 + 1)
}

/// The members without it.
fn members(swarm: &str) -> Membership {
    let mut members = members_before(swarm, THIEF);
    members.epoch = 2;
    members.expelled = [(THIEF, members.robots.remove(&THIEF).unwrap())].into();
    members
}

/// Votes in the name of the robot that was expelled, under its own signature and with ever newer stamps.
struct Spoils {
    thief: RobotId,
    swarm: SwarmId,
    keys: Keys,
    said: AtomicU32,
}

impl Spoils {
    fn new(swarm: &str, thief: RobotId) -> Self {
        let roster = members_before(swarm, thief).sign(&key(1000)).unwrap();
        Self { thief, swarm: roster.swarm_id(), keys: Keys::new(swarm).unwrap(), said: AtomicU32::new(1) }
    }

    fn vote(&self, round: RoundId) -> Vec<u8> {
        let evidence = vec![-1.0, 5.0, -1.0, -1.0, -1.0, -1.0];
        let vocabulary = Fixed::default().vocabulary().id();
        let vote = Vote { round, vocabulary, evidence, looks: 16.0, unknown: None, named: vec![] };
        let stamp = Stamp { boot: u32::MAX, sequence: self.said.fetch_add(1, Ordering::Relaxed) };
        let unsigned = Envelope { author: self.thief, stamp, message: Message::Vote(vote), signature: None };
        let signature = Some(statement::sign(&key(self.thief.0), &self.swarm, &unsigned.statement()));
        Envelope { signature, ..unsigned }.encode()
    }

    /// Says one in that round, and one in a round that would be the next but one.
    async fn say(&self, session: &zenoh::Session, open: RoundId) {
        for round in [open, RoundId { counter: open.counter + 2, opener: self.thief, ..open }] {
            let put = session.put(self.keys.key(&Topic::Vote(self.thief)), self.vote(round));
            // The link may be ended at any moment.
            let _ = put.congestion_control(CongestionControl::Drop).await;
        }
    }
}

/// The Zenoh configuration of that robot, as it was enrolled once.
fn stolen(swarm: &str, thief: RobotId, nonce: u64, endpoint: &str) -> zenoh::Config {
    let credentials = credentials(&members_before(swarm, thief), Bearer::Robot(thief), key(thief.0));
    // As robots name their sessions: nonce, swarm, robot.
    let id = format!("{:016x}{:08x}{:08x}", nonce | 1 << 63, crc32fast::hash(swarm.as_bytes()), thief.0);
    let mut zenoh = zenoh::Config::default();
    for (key, value) in [
        ("id", json!(id)),
        ("mode", json!("router")),
        ("connect/endpoints", json!([endpoint])),
        ("connect/timeout_ms", json!(1500)),
        ("connect/exit_on_failure", json!(false)),
        ("listen/endpoints", json!([])),
        // The next session knocks again, not this one.
        (
            "connect/retry",
            json!({"period_init_ms": 60_000, "period_max_ms": 60_000, "period_increase_factor": 1}),
        ),
        ("scouting/multicast/enabled", json!(false)),
        ("transport/link/tls", credentials.tls()),
    ] {
        zenoh.insert_json5(key, &value.to_string()).unwrap();
    }
    zenoh
}

/// What this process does when it is told to knock: until its input ends, of which each line is the round that is open.
pub fn knocks_instead() -> Option<ExitCode> {
    let orders: Value = serde_json::from_str(&std::env::var(ORDERS).ok()?).expect("its orders");
    let round = Arc::new(Mutex::new(None));
    let (told, ended) = (round.clone(), Arc::new(AtomicBool::new(false)));
    let over = ended.clone();
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines().map_while(Result::ok) {
            *told.lock().unwrap_or_else(PoisonError::into_inner) = serde_json::from_str(&line).ok();
        }
        over.store(true, Ordering::Relaxed);
    });
    gestalt_trials::block_on(knock(&orders, &round, &ended));
    Some(ExitCode::SUCCESS)
}

/// Opens ten sessions a second, at each of the endpoints in turn, and says votes while a link stands. Zenoh dials again at once
/// when it was hung up: a hundred links a second come of it.
async fn knock(orders: &Value, round: &Arc<Mutex<Option<RoundId>>>, ended: &AtomicBool) {
    let swarm = orders["swarm"].as_str().unwrap();
    let endpoints: Vec<String> = serde_json::from_value(orders["endpoints"].clone()).unwrap();
    let thief: RobotId = serde_json::from_value(orders["thief"].clone()).unwrap();
    let spoils = Arc::new(Spoils::new(swarm, thief));
    let mut knocks = JoinSet::new();
    let mut turns = tokio::time::interval(KNOCK);
    turns.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    let first = u64::from(std::process::id()) << 32;
    for number in 0.. {
        if ended.load(Ordering::Relaxed) {
            break;
        }
        turns.tick().await;
        let endpoint = &endpoints[number as usize % endpoints.len()];
        let (zenoh, spoils, round) =
            (stolen(swarm, thief, first | number, endpoint), spoils.clone(), round.clone());
        knocks.spawn(async move {
            let Ok(session) = zenoh::open(zenoh).await else { return };
            for _ in 0..5 {
                let open = *round.lock().unwrap_or_else(PoisonError::into_inner);
                if let Some(open) = open {
                    spoils.say(&session, open).await;
                }
                tokio::time::sleep(Duration::from_millis(50)).await;
            }
            let _ = session.close().await;
        });
        // Whoever reads it may have gone.
        let _ = writeln!(std::io::stdout(), "{}", json!({"event": "knocked", "number": number}));
        while knocks.try_join_next().is_some() {}
    }
}

/// The thief's process: Zenoh's threads are one pool for all sessions of a process, and the robots need theirs.
pub struct Thief(pub Process);

impl Thief {
    /// Starts it, in a network namespace if one is named.
    pub fn start(namespace: Option<&str>, orders: &Value) -> Self {
        let program = std::env::current_exe().unwrap();
        let mut command = match namespace {
            None => Command::new(program),
            Some(namespace) => {
                let mut command = Command::new("ip");
                command.args(["netns", "exec", namespace]).arg(program);
                command
            }
        };
        Self(Process::run(command.env(ORDERS, orders.to_string())))
    }

    pub fn is_told(&mut self, round: RoundId) {
        self.0.order(&serde_json::to_string(&round).unwrap());
    }
}

/// Watches that it is not alive to any of those; when it was. A link of it stands for a moment before it is ended.
async fn watch(robots: Vec<Arc<Robot>>, on: Arc<AtomicBool>) -> Vec<String> {
    let mut seen = Vec::new();
    while on.load(Ordering::Relaxed) {
        for robot in &robots {
            let status = robot.status();
            if status.alive.contains(&THIEF) {
                seen.push(format!("{status:?}"));
            }
        }
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    seen
}

/// With `GESTALT_LONG` it knocks for 60 s, otherwise for 10.
pub async fn who_was_expelled_and_links_ten_times_a_second_changes_nothing_and_is_kept_waiting() {
    let long = std::env::var_os("GESTALT_LONG").is_some();
    let siege = Duration::from_secs(if long { 60 } else { 10 });
    let swarm = unique("knocking");
    let members = members(&swarm);
    let (mut robots, locators) = star(3, |id, connect| sealed(id, &members, connect)).await;
    let endpoints: Vec<_> = robots.iter().map(|it| by_tls(it.robot.locators())[0].clone()).collect();
    let mut thief = Thief::start(None, &json!({"swarm": swarm, "endpoints": endpoints, "thief": THIEF}));
    let on = Arc::new(AtomicBool::new(true));
    let watching = tokio::spawn(watch(robots.iter().map(|it| it.robot.clone()).collect(), on.clone()));
    // A member that passes its votes on.
    let eve = enter(&members, &locators).await;
    let spoils = Spoils::new(&swarm, THIEF);
    let (began, mut rounds, mut whole, mut slowest) = (Instant::now(), 0, 0, Duration::ZERO);
    while began.elapsed() < siege {
        rounds += 1;
        let opened = Instant::now();
        robots[rounds as usize % 3].robot.open_round();
        if let Some(round) = robots[0].robot.status().round {
            thief.is_told(round);
            spoils.say(&eve, round).await;
        }
        let mut voted = voters(&mut robots, rounds).await;
        voted.iter_mut().for_each(|voted| voted.sort_unstable());
        assert!(!voted.iter().flatten().any(|robot| *robot == THIEF.0), "round {rounds}: {voted:?}");
        // On a busy machine a vote may come when the others have decided.
        whole += u32::from(voted == [[0, 1, 2]; 3]);
        slowest = slowest.max(opened.elapsed());
        // As long as no other may begin.
        tokio::time::sleep(REFRACTORY).await;
    }
    on.store(false, Ordering::Relaxed);
    let (knocks, ended) = (thief.0.told().len(), thief.0.ended());
    drop(thief);
    let seen = watching.await.unwrap();
    assert_eq!(ended, None, "its process ended by itself");
    assert!(2 * whole > rounds, "{whole} of {rounds} rounds of all three");
    assert!(seen.is_empty(), "it was there again: {:?}", seen.first());
    let of_each = |name: &str| -> Vec<u64> {
        let counters = robots.iter().map(|it| it.robot.status().counters);
        counters.map(|counters| counters.get(name).copied().unwrap_or_default()).collect()
    };
    let [turned_away, waited, waits] =
        ["refused_link_not_enrolled", "links_kept_waiting", "links_kept_waiting_ms"].map(of_each);
    let refused = of_each("refused_vote_expelled");
    eprintln!(
        "{rounds} rounds, {whole} of all three, the slowest {slowest:?}; {knocks} knocks, turned away {turned_away:?}, of them kept waiting {waited:?}, for \
         {waits:?} ms; votes refused {refused:?}"
    );
    // Few may wait at a time.
    for robot in 0..3 {
        assert!(turned_away[robot] >= 5 && waited[robot] >= 3 && waits[robot] >= 150, "robot {robot}");
        assert!(refused[robot] > 0, "eve passed its votes on to robot {robot}");
    }
    eve.close().await.unwrap();
    for robot in robots {
        robot.stop().await;
    }
}
