//! How many Parrots (640×360, 30 frames a second) a fusion centre serves on this machine, over real Zenoh on the loopback
//! interface, with the thin clients in the same process.
//!
//! `cargo bench --bench center`; `GESTALT_LONG=1` keeps the overload up for ten minutes. The bound: as many threads as the
//! centre has workers decode and look in a loop, without Zenoh, and beside that, with plain OpenCV calls in the place of
//! Gestalt's perception. A round is open all the time, so that every frame is judged and every robot votes.

#[path = "../vision/benches/bare/mod.rs"]
mod bare;

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use bare::Bare;
use gestalt_link::boot_number;
use gestalt_link::{Client, LinkConfig};
use gestalt_peer::center::Center;
use gestalt_peer::config::{CameraChoice, CameraSection, Config, FilesSection, SourceSection};
use gestalt_peer::stream::{Feed, Sender, SenderConfig};
use gestalt_protocol::{RobotId, Status};
use gestalt_strategies::Quorum;
use gestalt_vision::camera_model::CameraModel;
use gestalt_vision::config::{LayerConfig, MotionConfig};
use gestalt_vision::model::RobotModel;
use gestalt_vision::perception::FeatureSet;
use gestalt_vision::pose::Pose;
use gestalt_vision::sight::{Sight, SightConfig};
use gestalt_vision::source::{
    Frame, Glove, MAX_MEGAPIXELS, RenderedSource, Scene, Source, decode, encode_jpeg,
};
use opencv::core::Mat;

const FPS: f64 = 30.0;
const SWARM: &str = "bench-center";

/// From then on it counts, for so long.
const WARM_UP: Duration = Duration::from_secs(4);
const MEASURED: Duration = Duration::from_secs(10);

/// How long each measurement of the bound takes.
const BOUND: Duration = Duration::from_secs(2);

fn main() {
    opencv::core::set_num_threads(1).expect("OpenCV takes one thread");
    let folder = tempfile::tempdir().expect("a folder for the pictures");
    let pictures = pictures(folder.path());
    let threads = std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get);
    let model = RobotModel::rendered().expect("a model");
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().expect("a runtime");

    let mut most = Bound::default();
    most.measure(&pictures, threads);
    // Up in steps of a quarter, then the middle of what is known to go and what is not.
    let (mut served, mut too_many) = (0, None);
    let mut n = ((most.looking / FPS * 0.6) as u32).max(1);
    while too_many.is_none_or(|too_many| too_many - served > 1) {
        let seen = runtime.block_on(run(n, &model, folder.path(), MEASURED));
        let good = seen.part() >= 0.95 && seen.p99 < Duration::from_millis(100);
        println!("{n} Parrots: {seen}{}", if good { "" } else { " — too many" });
        if good {
            served = n;
        } else {
            too_many = Some(n);
        }
        n = too_many.map_or(n + n.div_ceil(4), |too_many| served.midpoint(too_many));
        most.measure(&pictures, threads);
    }
    let frames = f64::from(served) * FPS;
    println!("{threads} threads, decode + look: {:.0} frames/s at best", most.looking);
    println!("{threads} threads, decode + plain OpenCV calls: {:.0} frames/s at best", most.plain);
    println!(
        "served: {served} Parrots = {frames:.0} frames/s = {:.0} % of the bound with Gestalt's perception, {:.0} % of that with plain calls",
        100.0 * frames / most.looking,
        100.0 * frames / most.plain
    );
    let long = std::env::var_os("GESTALT_LONG").is_some();
    let time = if long { Duration::from_secs(600) } else { Duration::from_secs(20) };
    let seen = runtime.block_on(run(2 * served, &model, folder.path(), time));
    println!("{} Parrots: {seen}", 2 * served);
}

/// A few frames of hands, as JPEG files.
fn pictures(folder: &Path) -> Vec<Vec<u8>> {
    let mut source = RenderedSource::new(CameraModel::parrot(), Pose::FRONTAL, Glove::Cyan, 1)
        .expect("the preset is a valid camera");
    (0..6)
        .map(|k| {
            // One hand that holds still, in the noise of the camera: what moves is no evidence, and would not be judged.
            let scene = Scene { gesture: Some(4), seed: 3 };
            let frame = source.next_frame(Duration::ZERO, &scene).expect("a hand can be drawn");
            let path = folder.join(format!("{k}.jpg"));
            let jpeg = encode_jpeg(&frame.image, 80).expect("a picture");
            std::fs::write(path, &jpeg).expect("a picture is written");
            jpeg
        })
        .collect()
}

/// The most frames a second that a bare loop was seen to reach: other programs may take part of the machine meanwhile.
#[derive(Default)]
struct Bound {
    looking: f64,
    plain: f64,
}

impl Bound {
    fn measure(&mut self, pictures: &[Vec<u8>], threads: usize) {
        let parrot = SightConfig {
            camera: CameraModel::parrot(),
            layer: LayerConfig::ALL,
            motion: MotionConfig::default(),
        };
        let looking = timed(threads, || {
            let mut sight = Sight::new(parrot.clone(), FeatureSet::Shape).expect("the defaults are valid");
            let mut frame = Frame { image: Mat::default(), at: Duration::ZERO };
            let mut pictures = pictures.iter().cycle();
            move || {
                let picture = pictures.next().expect("the pictures go round");
                decode(picture, MAX_MEGAPIXELS, &mut frame.image).expect("a whole picture");
                frame.at += Duration::from_millis(33);
                drop(sight.take(&frame, true));
            }
        });
        let plain = timed(threads, || {
            let mut bare = Bare::new().expect("the sizes of the descriptor divide each other");
            let mut image = Mat::default();
            let mut pictures = pictures.iter().cycle();
            move || {
                let picture = pictures.next().expect("the pictures go round");
                decode(picture, MAX_MEGAPIXELS, &mut image).expect("a whole picture");
                bare.hand(&image).expect("the frame shows a hand");
                bare.shape().expect("there is a hand to describe");
            }
        });
        (self.looking, self.plain) = (self.looking.max(looking), self.plain.max(plain));
    }
}

/// How often a second so many threads do something, each with buffers of its own.
fn timed<W: FnMut()>(threads: usize, prepare: impl Fn() -> W + Sync) -> f64 {
    let done = AtomicU64::new(0);
    let until = Instant::now() + BOUND;
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                let mut work = prepare();
                while Instant::now() < until {
                    work();
                    done.fetch_add(1, Ordering::Relaxed);
                }
            });
        }
    });
    done.load(Ordering::Relaxed) as f64 / BOUND.as_secs_f64()
}

/// How a centre did.
struct Seen {
    /// Frames a second looked at, of each robot.
    rates: Vec<f64>,
    /// The part of them in which a hand was found.
    hands: f64,
    /// From a frame's being taken to its vote: the median robot's median, and the worst robot's 99th percentile.
    p50: Duration,
    p99: Duration,
    /// Memory resident at the beginning, and at the end, in MB.
    memory: (f64, f64),
}

impl Seen {
    fn part(&self) -> f64 {
        self.rates.iter().sum::<f64>() / (self.rates.len().max(1) as f64 * FPS)
    }
}

impl std::fmt::Display for Seen {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (least, most) = self
            .rates
            .iter()
            .fold((f64::INFINITY, 0.0_f64), |(least, most), r| (least.min(*r), most.max(*r)));
        write!(
            f,
            "{:.1} % of frames served, {:.0} % of those with a hand, {least:.1} to {most:.1} fps each, delay p50 {:.1} ms, p99 {:.1} ms, {:.0} → {:.0} MB",
            100.0 * self.part(),
            100.0 * self.hands,
            self.p50.as_secs_f64() * 1e3,
            self.p99.as_secs_f64() * 1e3,
            self.memory.0,
            self.memory.1
        )
    }
}

/// Serves so many Parrots for a while.
async fn run(parrots: u32, model: &RobotModel, pictures: &Path, time: Duration) -> Seen {
    let mut config = Config::default();
    config.robot.id = RobotId(1_000);
    config.swarm.0 = SWARM.to_owned();
    config.links.scouting.enabled = false;
    config.center.max_robots = 256;
    // A round that goes on as long as the measurement.
    config.rounds.quorum = Quorum::Evidence(4096);
    config.rounds.deadline = Duration::from_secs(3600);
    config.zenoh.insert("listen".to_owned(), serde_json::json!({"endpoints": ["tcp/127.0.0.1:0"]}));
    let boot = boot_number(std::time::SystemTime::now());
    let center = Center::start(&config, model.clone(), boot).await.expect("the centre starts");
    let link = LinkConfig { connect: center.robot().locators().to_vec(), ..LinkConfig::default() };
    let mut sending = tokio::task::JoinSet::new();
    for id in 1..=parrots {
        // Cameras do not take their pictures all at the same moment.
        tokio::time::sleep(Duration::from_millis(7)).await;
        let camera = CameraSection {
            model: CameraChoice::Parrot,
            source: SourceSection::Images(FilesSection { path: pictures.to_owned(), repeat: true }),
            ..CameraSection::default()
        };
        let feed = Feed::new(&camera, RobotId(id), Duration::ZERO).expect("a camera");
        let config = SenderConfig {
            swarm: SWARM.to_owned(),
            link: link.clone(),
            robot: RobotId(id),
            camera: "parrot".to_owned(),
            quality: 80,
        };
        sending.spawn(Sender::start(config, feed).expect("a camera's thread").run(|_| {}));
    }
    let client = Client::open(SWARM, &link).await.expect("a client");
    center.robot().open_round();
    tokio::time::sleep(WARM_UP).await;
    let (began, before, memory) = (Instant::now(), statuses(&client).await, resident());
    tokio::time::sleep(time).await;
    let (ended, after) = (Instant::now(), statuses(&client).await);
    let memory = (memory, resident());
    let served = |status: &Status| counter(status, "frames_received") - counter(status, "frames_overwritten");
    let seconds = ended.saturating_duration_since(began).as_secs_f64();
    let rates = after.iter().map(|status| {
        let then = before.iter().find(|then| then.robot == status.robot).map_or(0.0, served);
        (served(status) - then) / seconds
    });
    let micros = |status: &Status, name| Duration::from_secs_f64(counter(status, name) * 1e-6);
    let mut medians: Vec<_> = after.iter().map(|status| micros(status, "frame_delay_p50_us")).collect();
    medians.sort();
    let of_all = |name| -> f64 {
        let sum = |statuses: &[Status]| -> f64 { statuses.iter().map(|status| counter(status, name)).sum() };
        sum(&after) - sum(&before)
    };
    let hands = of_all("frames_with_a_hand") / (of_all("frames_received") - of_all("frames_overwritten"));
    let seen = Seen {
        rates: rates.collect(),
        hands,
        p50: medians.get(medians.len() / 2).copied().unwrap_or_default(),
        p99: after.iter().map(|status| micros(status, "frame_delay_p99_us")).max().unwrap_or_default(),
        memory,
    };
    assert_eq!(seen.rates.len(), parrots as usize, "every Parrot is served");
    sending.shutdown().await;
    client.close().await;
    center.stop().await;
    seen
}

async fn statuses(client: &Client) -> Vec<Status> {
    let mut statuses = client.statuses(Duration::from_secs(2)).await.expect("the session is open");
    statuses.retain(|status| status.camera.source == "stream");
    statuses
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
