//! The cameras: clips of rendered hands, encoded beforehand, which a process of its own plays as thin clients would.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use gestalt_link::{Client, LinkConfig, fresh_nonce};
use gestalt_peer::stream::Credit;
use gestalt_protocol::{FrameHeader, ImageEncoding, RobotId};
use gestalt_vision::camera_model::CameraModel;
use gestalt_vision::human::{Human, Schedule};
use gestalt_vision::pose::Pose;
use gestalt_vision::source::{Glove, RenderedSource, Scene, ScheduledSource, Source, encode_jpeg};
use serde::{Deserialize, Serialize};
use tokio::sync::mpsc;

/// What the process that plays cameras is told in its environment.
const ORDERS: &str = "GESTALT_BENCH_CAMERAS";

pub const FPS: f64 = 30.0;
pub const SCHEDULE: Schedule =
    Schedule { period: Duration::from_secs(6), still: Duration::from_millis(2500) };

/// So many gestures are rendered, and shown again and again.
const SHOWINGS: u32 = 4;

/// From how many places.
const BEARINGS: [f64; 2] = [-20.0, 15.0];

const HUMAN: u64 = 7;
const QUALITY: i32 = 80;

#[derive(Serialize, Deserialize)]
struct Orders {
    swarm: String,
    locators: Vec<String>,
    parrots: u32,
    clips: PathBuf,
}

/// Frames as they are sent, one after the other.
type Clip = Vec<Vec<u8>>;

pub fn clock() -> Duration {
    SystemTime::now().duration_since(UNIX_EPOCH).expect("the clock is right")
}

/// The time within the clips.
fn turn(clock: Duration) -> Duration {
    let turn = SCHEDULE.period * SHOWINGS;
    Duration::from_nanos((clock.as_nanos() % turn.as_nanos()) as u64)
}

/// The showing at that time, and the gesture of a round that opens then.
pub fn shown(clock: Duration) -> (u64, Option<u8>) {
    (SCHEDULE.divide(clock).0, Human::new(HUMAN).last_shown(turn(clock), &SCHEDULE))
}

/// Renders what the cameras see.
pub fn render(folder: &Path) -> Vec<Clip> {
    let frames = (FPS * (SCHEDULE.period * SHOWINGS).as_secs_f64()) as u32;
    let mut clips = Vec::new();
    for (number, bearing_deg) in BEARINGS.into_iter().enumerate() {
        let pose = Pose { bearing_deg, elevation_deg: 0.0, distance_m: 0.9 };
        let camera = RenderedSource::new(CameraModel::parrot(), pose, Glove::default(), number as u64);
        let camera = camera.expect("the preset is a valid camera");
        let mut camera = ScheduledSource::new(camera, Human::new(HUMAN), SCHEDULE, Duration::ZERO);
        let clip: Clip = (0..frames)
            .map(|k| {
                let at = Duration::from_secs_f64(f64::from(k) / FPS);
                let frame = camera.next_frame(at, &Scene::default()).expect("a hand can be drawn");
                encode_jpeg(&frame.image, QUALITY).expect("a picture")
            })
            .collect();
        let encoded = postcard::to_stdvec(&clip).expect("memory");
        std::fs::write(folder.join(format!("{number}.clip")), encoded).expect("a clip is written");
        clips.push(clip);
    }
    clips
}

/// A process that plays cameras until it is dropped.
pub struct Cameras(Child);

impl Cameras {
    pub fn start(swarm: &str, locators: &[String], parrots: u32, clips: &Path) -> Self {
        let (swarm, locators) = (swarm.to_owned(), locators.to_vec());
        let orders = Orders { swarm, locators, parrots, clips: clips.to_owned() };
        let orders = serde_json::to_string(&orders).expect("orders");
        let program = std::env::current_exe().expect("this program");
        let child = Command::new(program).env(ORDERS, orders).stdin(Stdio::null()).spawn();
        Self(child.expect("a process for the cameras"))
    }
}

impl Drop for Cameras {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Plays cameras if this is the process for it; says whether it was.
pub fn play() -> bool {
    let Ok(orders) = std::env::var(ORDERS) else { return false };
    let orders: Orders = serde_json::from_str(&orders).expect("orders");
    let clips: Vec<Arc<Clip>> = (0..BEARINGS.len())
        .map(|number| {
            let bytes = std::fs::read(orders.clips.join(format!("{number}.clip"))).expect("a clip");
            Arc::new(postcard::from_bytes(&bytes).expect("a clip"))
        })
        .collect();
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().expect("a runtime");
    runtime.block_on(async {
        let link = LinkConfig { connect: orders.locators, ..LinkConfig::default() };
        let mut playing = tokio::task::JoinSet::new();
        for (id, clip) in (1..=orders.parrots).zip(clips.iter().cycle()) {
            let client = Client::open(&orders.swarm, &link).await.expect("the centre is there");
            playing.spawn(camera(RobotId(id), client, clip.clone()));
        }
        while playing.join_next().await.is_some() {}
    });
    true
}

/// One camera: as a thin client it sends the newest frame it has not sent, when it may.
async fn camera(id: RobotId, client: Client, clip: Arc<Clip>) {
    let (acknowledge, mut acknowledged) = mpsc::channel(16);
    let heard = move |taken| drop(acknowledge.try_send(taken));
    let sender = client.stream(id, None, heard).await.expect("the session is open");
    let nonce = fresh_nonce();
    let mut credit = Credit::new(nonce);
    // Cameras do not take their pictures all at the same moment.
    let phase = Duration::from_millis(u64::from(id.0) * 7);
    let taken_by = |clock: Duration| ((clock.saturating_sub(phase)).as_secs_f64() * FPS) as u64;
    let at = |frame: u64| phase + Duration::from_secs_f64(frame as f64 / FPS);
    let mut last = 0;
    loop {
        while let Some(until) = credit.waits_until() {
            tokio::select! {
                Some(Ok(taken)) = acknowledged.recv() => drop(credit.taken(&taken)),
                () = tokio::time::sleep_until(until.into()) => break,
            }
        }
        if taken_by(clock()) <= last {
            tokio::time::sleep(at(last + 1).saturating_sub(clock())).await;
        }
        last = taken_by(clock()).max(last + 1);
        let picture = &clip[(turn(at(last)).as_secs_f64() * FPS) as usize % clip.len()];
        let header = FrameHeader {
            nonce,
            sequence: credit.sent(std::time::Instant::now()),
            age_us: u32::try_from(clock().saturating_sub(at(last)).as_micros()).unwrap_or(u32::MAX),
            encoding: ImageEncoding::Jpeg,
            fps: FPS as f32,
            camera: "parrot".to_owned(),
        };
        if sender.send(&header, picture.clone()).await.is_err() {
            return;
        }
    }
}
