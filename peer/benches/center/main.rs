//! How many Parrots (640×360 JPEG, 30 frames a second offered) a fusion centre serves on this machine, over real Zenoh on the loopback
//! interface. Hands come, rest and go before all of them, and rounds are opened by what they see move; then a round stays open all the
//! while, so that every hand at rest is looked at for as long as it is.
//!
//! `cargo bench -p gestalt-peer --bench center`; `GESTALT_PARROTS=50,100` serves so many and no others, and `GESTALT_LONG=1` does so, or keeps
//! the overload up, for ten minutes. The cameras are a process of their own and send what was encoded before: what is said of processor time and memory is
//! the centre's alone, though both share the machine.

#[path = "../../vision/benches/bare/mod.rs"]
mod bare;
mod cameras;
mod work;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use cameras::{Cameras, FPS, SCHEDULE, clock, shown};
use gestalt_link::{Event, boot_number};
use gestalt_peer::center::Center;
use gestalt_peer::config::{CameraChoice, Config};
use gestalt_protocol::{ClassId, RobotId, Status};
use gestalt_strategies::Quorum;
use gestalt_vision::config::MotionConfig;
use gestalt_vision::model::RobotModel;

const SWARM: &str = "bench-center";

/// The longest time from a frame to its vote, of 99 in 100 frames, and the least part of the most looks that any camera gets.
const DELAY: Duration = Duration::from_millis(100);
const EVEN: f64 = 0.8;

fn main() {
    if cameras::play() {
        return;
    }
    opencv::core::set_num_threads(1).expect("OpenCV takes one thread");
    let folder = tempfile::tempdir().expect("a folder for the clips");
    work::report(&cameras::render(folder.path()));
    let model = RobotModel::rendered().expect("a model");
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().expect("a runtime");
    let serve = |parrots: u32, time: Duration| {
        [Rounds::ByMotion, Rounds::One].into_iter().all(|rounds| {
            let seen = runtime.block_on(run(parrots, rounds, &model, folder.path(), time));
            println!("{parrots} Parrots: {seen}{}", if seen.is_good() { "" } else { " — too many" });
            seen.is_good()
        })
    };
    let time = 3 * SCHEDULE.period;
    let long = std::env::var_os("GESTALT_LONG").map_or(time, |_| Duration::from_secs(600));
    if let Ok(list) = std::env::var("GESTALT_PARROTS") {
        for parrots in list.split(',') {
            serve(parrots.trim().parse().expect("GESTALT_PARROTS: numbers with commas between them"), long);
        }
        return;
    }
    // Up by doubling, then between what is known to go and what is not, to a twelfth.
    let (mut served, mut too_many, mut n) = (0, None, 12);
    while too_many.is_none_or(|too_many: u32| too_many - served > 1 + served / 12) && n <= 256 {
        if serve(n, time) {
            served = n;
        } else {
            too_many = Some(n);
        }
        n = too_many.map_or(2 * n, |too_many| served.midpoint(too_many));
    }
    println!("served: {served} Parrots = {:.0} frames/s offered", f64::from(served) * FPS);
    serve((2 * served).min(256), long);
}

/// Which rounds there are.
#[derive(Clone, Copy, PartialEq)]
enum Rounds {
    /// Those that what moves opens.
    ByMotion,
    /// One that nobody ends.
    One,
}

/// How a centre did.
struct Seen {
    rounds: Rounds,
    /// Frames that came in, and those in which a hand was looked for, a second, of each robot.
    frames: Vec<f64>,
    looks: Vec<f64>,
    /// From a frame's being taken to its vote: the median robot's median, and the worst robot's 99th percentile.
    p50: Duration,
    p99: Duration,
    /// The centre's processor time, in cores.
    cores: f64,
    /// Memory resident at the beginning, and at the end, in MB.
    memory: (f64, f64),
    /// Showings, those in which a round was decided, and those rightly.
    showings: (u64, usize, usize),
}

fn span(rates: &[f64]) -> (f64, f64) {
    rates.iter().fold((f64::INFINITY, 0.0_f64), |(least, most), r| (least.min(*r), most.max(*r)))
}

impl Seen {
    fn is_good(&self) -> bool {
        let even = |rates| {
            let (least, most) = span(rates);
            least >= EVEN * most && most > 0.0
        };
        // Of rounds that end with the first or second look of each there are too few to compare.
        self.p99 < DELAY && even(&self.frames) && (self.rounds == Rounds::ByMotion || even(&self.looks))
    }
}

impl std::fmt::Display for Seen {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (frames, looks) = (span(&self.frames), span(&self.looks));
        write!(
            f,
            "{:.1} to {:.1} frames/s and {:.2} to {:.2} looks/s each, delay p50 {:.0} ms, p99 {:.0} ms, {:.2} cores, {:.0} → {:.0} MB, ",
            frames.0,
            frames.1,
            looks.0,
            looks.1,
            self.p50.as_secs_f64() * 1e3,
            self.p99.as_secs_f64() * 1e3,
            self.cores,
            self.memory.0,
            self.memory.1
        )?;
        let (showings, decided, right) = self.showings;
        match self.rounds {
            Rounds::ByMotion => write!(f, "{decided} of {showings} showings decided, {right} rightly"),
            Rounds::One => write!(f, "in one round"),
        }
    }
}

/// Serves so many Parrots for a while.
async fn run(parrots: u32, rounds: Rounds, model: &RobotModel, clips: &Path, time: Duration) -> Seen {
    let mut config = Config::default();
    config.robot.id = RobotId(1_000);
    config.swarm.0 = SWARM.to_owned();
    config.links.scouting.enabled = false;
    config.center.max_robots = 256;
    config.camera.model = CameraChoice::Parrot;
    config.camera.motion = MotionConfig::watching();
    if rounds == Rounds::One {
        config.rounds.quorum = Quorum::Evidence(4096);
        config.rounds.deadline = Duration::from_secs(3600);
    }
    config.zenoh.insert("listen".to_owned(), serde_json::json!({"endpoints": ["tcp/127.0.0.1:0"]}));
    let boot = boot_number(std::time::SystemTime::now());
    let center = Center::start(&config, model.clone(), boot).await.expect("the centre starts");
    let (mut events, heard) = (center.robot().events(), Arc::new(Mutex::new(Vec::new())));
    let hearing = heard.clone();
    tokio::spawn(async move {
        while let Ok(event) = events.recv().await {
            hearing.lock().expect("no panic").push((clock(), event));
        }
    });
    let cameras = Cameras::start(SWARM, center.robot().locators(), parrots, clips);
    let patience = Instant::now() + Duration::from_secs(60);
    while center.served().len() < parrots as usize {
        assert!(Instant::now() < patience, "{} of {parrots} are served", center.served().len());
        tokio::time::sleep(Duration::from_millis(200)).await;
    }
    if rounds == Rounds::One {
        center.robot().open_round();
    }
    // From the end of a showing on that all have seen.
    let start = SCHEDULE.period * u32::try_from(SCHEDULE.divide(clock()).0 + 2).expect("before 2700");
    tokio::time::sleep(start.saturating_sub(clock())).await;
    let (began, before, memory, spent) = (Instant::now(), center.served(), resident(), processor_time());
    tokio::time::sleep(time).await;
    let (seconds, after) = (began.elapsed().as_secs_f64(), center.served());
    let cores = (processor_time() - spent) / seconds;
    let first = SCHEDULE.divide(start).0;
    let showings = (time.as_secs() / SCHEDULE.period.as_secs()).max(1);
    let mut opened = BTreeMap::new();
    let mut decided: BTreeMap<u64, bool> = BTreeMap::new();
    for (at, event) in heard.lock().expect("no panic").iter() {
        match event {
            Event::Opened(round) => drop(opened.entry(*round).or_insert(shown(*at))),
            Event::Held(decision) => {
                let Some((showing, gesture)) = opened.get(&decision.round) else { continue };
                let right = decision.class == gesture.map(|fingers| ClassId(fingers.into()));
                decided.insert(*showing, right);
            }
            _ => {}
        }
    }
    decided.retain(|showing, _| (first..first + showings).contains(showing));
    let rates = |of: fn(&Status) -> f64| -> Vec<f64> {
        let rate = |status: &Status| {
            let then = before.iter().find(|then| then.robot == status.robot).map_or(0.0, of);
            (of(status) - then) / seconds
        };
        after.iter().map(rate).collect()
    };
    let micros = |status: &Status, name| Duration::from_secs_f64(counter(status, name) * 1e-6);
    let mut medians: Vec<_> = after.iter().map(|status| micros(status, "frame_delay_p50_us")).collect();
    medians.sort();
    let seen = Seen {
        rounds,
        frames: rates(|status| counter(status, "frames_received") - counter(status, "frames_overwritten")),
        looks: rates(|status| {
            counter(status, "frames_with_a_hand") + counter(status, "frames_without_a_hand")
        }),
        p50: medians.get(medians.len() / 2).copied().unwrap_or_default(),
        p99: after.iter().map(|status| micros(status, "frame_delay_p99_us")).max().unwrap_or_default(),
        cores,
        memory: (memory, resident()),
        showings: (showings, decided.len(), decided.values().filter(|right| **right).count()),
    };
    assert_eq!(seen.frames.len(), parrots as usize, "every Parrot is served");
    drop(cameras);
    center.stop().await;
    seen
}

fn counter(status: &Status, name: &str) -> f64 {
    status.counters.get(name).copied().unwrap_or_default() as f64
}

/// Memory resident, in MB; 0 where `/proc` is not.
fn resident() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    line.and_then(|line| line.split_whitespace().next()?.parse::<f64>().ok()).unwrap_or_default() / 1024.0
}

/// The time that all threads of this process have computed, in seconds; 0 where `/proc` is not.
fn processor_time() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after_name = stat.rsplit(')').next().unwrap_or_default();
    let ticks = after_name.split_whitespace().skip(11).take(2).filter_map(|ticks| ticks.parse::<f64>().ok());
    // A hundred to a second, on all of Linux.
    ticks.sum::<f64>() / 100.0
}
