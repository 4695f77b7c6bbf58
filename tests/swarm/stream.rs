//! Frames on Zenoh: at most one under way, stale ones dropped evenly, nonsense counted.

use std::io::Write;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant, SystemTime};

use gestalt_link::{Event, FrameArrival, FrameGate, Robot, boot_number};
use gestalt_peer::body::Body;
use gestalt_peer::center::Center;
use gestalt_peer::config::{CameraChoice, CameraSection, FilesSection, SourceSection, StreamSection};
use gestalt_peer::stream::{Feed, Sender, SenderConfig, StreamEvent};
use gestalt_protocol::{
    CameraState, ClassId, FrameHeader, FrameTaken, ImageEncoding, Keys, RobotId, Status, Topic,
};
use gestalt_tests::{Hands, center_config, config, sender_config, unique};
use gestalt_vision::model::RobotModel;
use gestalt_vision::source::{Frame, Scene, Source, SourceError};
use serde_json::json;
use tokio::sync::mpsc::{UnboundedReceiver, unbounded_channel};
use zenoh::qos::CongestionControl;

const PATIENCE: Duration = Duration::from_secs(30);

fn model(hands: &Hands) -> RobotModel {
    RobotModel::read(&hands.model()).unwrap()
}

/// A centre with one worker; `frames_per_look` as in its configuration.
pub async fn center_asking(
    swarm: &str,
    hands: &Hands,
    max_robots: usize,
    frames_per_look: Option<u32>,
) -> Center {
    let serve = json!({"workers": 1, "max_robots": max_robots});
    let orders = json!({
        "id": 100, "swarm": swarm, "link": {"listen": ["tcp/127.0.0.1:0"]}, "serve": serve,
    });
    let mut config = center_config(&orders);
    config.center.frames_per_look = frames_per_look;
    Center::start(&config, model(hands), boot_number(SystemTime::now())).await.unwrap()
}

async fn center(swarm: &str, hands: &Hands, max_robots: usize) -> Center {
    center_asking(swarm, hands, max_robots, Some(3)).await
}

/// A Parrot that streams to `locators` until it is aborted.
pub fn parrot(id: u32, swarm: &str, locators: &[String], pictures: &Path) -> Sender {
    let orders = json!({
        "id": id, "swarm": swarm, "link": {"connect": locators}, "stream": {"images": pictures},
    });
    let (config, feed) = sender_config(&orders);
    Sender::start(config, feed).unwrap()
}

pub async fn wait_for<T>(what: &str, mut pick: impl FnMut() -> Option<T>) -> T {
    let deadline = Instant::now() + PATIENCE;
    loop {
        if let Some(found) = pick() {
            return found;
        }
        assert!(Instant::now() < deadline, "no {what} within {PATIENCE:?}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

/// Has a robot receive frames, and answer none: the headers of those that are to be looked at.
async fn frames_at(robot: &Robot) -> (FrameGate, UnboundedReceiver<FrameHeader>) {
    let (sender, headers) = unbounded_channel();
    let on_frame = move |frame: FrameArrival| {
        let _ = sender.send(frame.header);
    };
    (robot.receive_frames(None, on_frame).await.unwrap(), headers)
}

pub async fn one_frame_is_under_way_and_who_is_not_answered_asks_once_a_second() {
    let hands = Hands::new(2);
    let swarm = unique("credit");
    let robot = Robot::start(config(1, &swarm, &[])).await.unwrap();
    let (gate, mut headers) = frames_at(&robot).await;
    let streaming = tokio::spawn(parrot(7, &swarm, robot.locators(), &hands.images()).run(|_| {}));
    let began = Instant::now();
    for _ in 0..3 {
        headers.recv().await.unwrap();
    }
    // The first comes at once, and each later one a second after the one before, never sooner.
    assert!(
        began.elapsed() >= Duration::from_millis(1500),
        "three frames, none answered: {:?}",
        began.elapsed()
    );
    // Every answer brings one more, at once.
    let answered = tokio::time::timeout(PATIENCE, async {
        while let Ok(header) = headers.try_recv() {
            drop(header);
        }
        for _ in 0..40 {
            let FrameHeader { nonce, sequence, .. } = headers.recv().await.unwrap();
            assert!(headers.is_empty(), "another frame before the answer to this one");
            gate.taken(RobotId(7), &FrameTaken { nonce, sequence, round: None });
        }
    });
    assert!(answered.await.is_ok(), "answers bring frames at the camera's rate");
    streaming.abort();
    robot.stop().await;
}

pub async fn of_two_cameras_that_stream_as_one_robot_the_later_is_looked_at() {
    let hands = Hands::new(2);
    let swarm = unique("two");
    let robot = Robot::start(config(1, &swarm, &[])).await.unwrap();
    let (_gate, mut headers) = frames_at(&robot).await;
    // Nobody answers: each sends a frame a second.
    let stream = || tokio::spawn(parrot(7, &swarm, robot.locators(), &hands.images()).run(|_| {}));
    let earlier = stream();
    let first = headers.recv().await.unwrap().nonce;
    let later = stream();
    let latest = loop {
        let nonce = headers.recv().await.unwrap().nonce;
        if nonce != first {
            break nonce;
        }
    };
    let refused = || robot.status().counters.get("refused_frame_two_senders").copied().unwrap_or(0);
    wait_for("refusal", || (refused() >= 2).then_some(())).await;
    let heard: Vec<u64> = std::iter::from_fn(|| Some(headers.try_recv().ok()?.nonce)).collect();
    assert!(!heard.is_empty() && heard.iter().all(|nonce| *nonce == latest), "{heard:?} after {latest}");
    earlier.abort();
    later.abort();
    robot.stop().await;
}

pub async fn a_peer_looks_through_a_camera_that_is_elsewhere() {
    let hands = Hands::new(4);
    let swarm = unique("elsewhere");
    let orders = json!({"id": 7, "swarm": swarm, "link": {"listen": ["tcp/127.0.0.1:0"]}, "serve": {}});
    let mut config = center_config(&orders);
    config.camera.source = SourceSection::Stream(StreamSection { robot: None });
    let body = Body::start(&config, Some(model(&hands)), 1).await.unwrap();
    let mut events = body.robot().events();
    let streaming = tokio::spawn(parrot(7, &swarm, body.robot().locators(), &hands.images()).run(|_| {}));
    body.robot().open_round();
    let decided = tokio::time::timeout(PATIENCE, async {
        loop {
            if let Event::Held(decision) = events.recv().await.unwrap() {
                return decision;
            }
        }
    });
    assert_eq!(decided.await.expect("a decision").class, Some(ClassId(4)));
    streaming.abort();
    body.stop().await;
}

pub async fn nonsense_on_the_keys_of_frames_is_counted_and_nothing_breaks() {
    let hands = Hands::new(1);
    let swarm = unique("nonsense");
    let center = center(&swarm, &hands, 64).await;
    let mut zenoh = zenoh::Config::default();
    zenoh.insert_json5("mode", "\"client\"").unwrap();
    zenoh.insert_json5("connect/endpoints", &json!(center.robot().locators()).to_string()).unwrap();
    zenoh.insert_json5("scouting/multicast/enabled", "false").unwrap();
    let vandal = zenoh::open(zenoh).await.unwrap();
    let keys = Keys::new(&swarm).unwrap();
    let failed = Arc::new(AtomicU64::new(0));
    let counted = failed.clone();
    let sender = parrot(7, &swarm, center.robot().locators(), &hands.encoded());
    let streaming = tokio::spawn(sender.run(move |event| {
        if let StreamEvent::Failed { .. } = event {
            counted.fetch_add(1, Ordering::Relaxed);
        }
    }));
    let live = |center: &Center| center.served().iter().any(|s| s.camera.state == CameraState::Live);
    wait_for("served robot", || live(&center).then_some(())).await;
    let header = FrameHeader {
        nonce: 1,
        sequence: 1,
        age_us: u32::MAX,
        encoding: ImageEncoding::Jpeg,
        fps: 30.0,
        camera: "vandal".to_owned(),
    };
    // No header, a bad one, an empty picture, and one that is too large.
    for robot in [7, 8] {
        let key = keys.key(&Topic::Frame(RobotId(robot)));
        vandal.put(&key, vec![1; 100]).await.unwrap();
        vandal.put(&key, vec![1; 100]).attachment(vec![9; 400]).await.unwrap();
        vandal.put(&key, Vec::<u8>::new()).attachment(header.encode()).await.unwrap();
        let large = vandal.put(&key, vec![1; 5_000_000]).attachment(header.encode());
        large.congestion_control(CongestionControl::Block).await.unwrap();
        vandal.put(keys.key(&Topic::Taken(RobotId(robot))), vec![3; 77]).await.unwrap();
    }
    // Pictures that are none, in the name of a robot that is served, and of one that is not.
    let mut bomb = vec![0xff, 0xd8, 0xff, 0xc0, 0, 11, 8, 0xff, 0xff, 0xff, 0xff, 1, 1, 0x11, 0];
    bomb.extend([0xff, 0xd9]);
    for picture in [vec![1; 100], bomb] {
        for robot in [7, 8] {
            let key = keys.key(&Topic::Frame(RobotId(robot)));
            vandal.put(&key, picture.clone()).attachment(header.encode()).await.unwrap();
            tokio::time::sleep(Duration::from_millis(300)).await;
        }
    }
    let refused = || -> u64 {
        let counters = center.robot().status().counters;
        let of_vandal =
            |name: &str| name.starts_with("refused_frame_") && name != "refused_frame_two_senders";
        counters.iter().filter(|(name, _)| of_vandal(name)).map(|(_, count)| count).sum()
    };
    wait_for("refusals", || (refused() >= 8).then_some(())).await;
    tokio::time::sleep(Duration::from_millis(300)).await;
    assert_eq!(refused(), 8, "{:?}", center.robot().status().counters);
    assert_eq!(failed.load(Ordering::Relaxed), 1, "one of the acknowledgements was for the Parrot");
    let of = |id: u32| -> Status {
        center.served().into_iter().find(|status| status.robot == RobotId(id)).expect("it is served")
    };
    wait_for("failing camera", || (of(8).camera.state == CameraState::Failing).then_some(())).await;
    assert!(of(8).camera.trouble.contains("65535×65535"), "{:?}", of(8).camera);
    assert!(of(7).counters["frames_failed"] >= 1, "{:?}", of(7).counters);
    // The Parrot is served as ever, and the vandal's robot is let go.
    wait_for("live camera", || (of(7).camera.state == CameraState::Live).then_some(())).await;
    wait_for("leave of the vandal's robot", || (center.served().len() == 1).then_some(())).await;
    vandal.close().await.unwrap();
    streaming.abort();
    center.stop().await;
}

pub async fn who_is_there_already_and_who_comes_too_many_is_refused_and_counted() {
    let hands = Hands::new(5);
    let swarm = unique("crowd");
    let center = center(&swarm, &hands, 1).await;
    let on_board = Robot::start(config(9, &swarm, center.robot().locators())).await.unwrap();
    let alive = |id: u32| center.robot().status().alive.contains(&RobotId(id)).then_some(());
    wait_for("on-board robot", || alive(9)).await;
    let stream =
        |id: u32| tokio::spawn(parrot(id, &swarm, center.robot().locators(), &hands.encoded()).run(|_| {}));
    let refused = |cause: &str| {
        let status = center.robot().status();
        let count = status.counters.get(&format!("refused_frame_{cause}")).copied().unwrap_or_default();
        (count > 0 && status.errors.iter().any(|error| error.what.contains("streams, but"))).then_some(())
    };
    let twin = stream(9);
    wait_for("refusal of who runs elsewhere", || refused("elsewhere")).await;
    assert!(center.served().is_empty());
    let first = stream(1);
    wait_for("guest", || alive(1)).await;
    let second = stream(2);
    wait_for("refusal of one too many", || refused("too_many")).await;
    assert_eq!(center.served().len(), 1);
    // When the first has gone, there is room.
    first.abort();
    wait_for("second guest", || alive(2)).await;
    assert!(alive(1).is_none(), "{:?}", center.robot().status().alive);
    twin.abort();
    second.abort();
    on_board.stop().await;
    center.stop().await;
}

/// A thin client's messages, and a robot that takes its frames.
struct Taken {
    robot: Robot,
    _gate: Arc<std::sync::OnceLock<FrameGate>>,
    frames: Arc<AtomicU64>,
    failures: Arc<std::sync::Mutex<Vec<(String, u64)>>>,
    sending: tokio::task::JoinHandle<()>,
    began: Instant,
}

impl Taken {
    async fn from(feed: Feed, swarm: &str) -> Self {
        let robot = Robot::start(config(1, swarm, &[])).await.unwrap();
        let gate = Arc::new(std::sync::OnceLock::<FrameGate>::new());
        let (frames, failures) = (Arc::<AtomicU64>::default(), Arc::<std::sync::Mutex<Vec<_>>>::default());
        let (of_gate, counted) = (gate.clone(), frames.clone());
        let opened = robot
            .receive_frames(None, move |frame| {
                counted.fetch_add(1, Ordering::Relaxed);
                let FrameHeader { nonce, sequence, .. } = frame.header;
                if let Some(gate) = of_gate.get() {
                    gate.taken(frame.robot, &FrameTaken { nonce, sequence, round: None });
                }
            })
            .await
            .unwrap();
        assert!(gate.set(opened).is_ok());
        let link = serde_json::from_value(json!({"connect": robot.locators()})).unwrap();
        let swarm = swarm.to_owned();
        let of_camera = SenderConfig {
            swarm,
            link,
            robot: RobotId(7),
            camera: "parrot".to_owned(),
            quality: 80,
            signer: None,
        };
        let sender = Sender::start(of_camera, feed).unwrap();
        let (said, began) = (failures.clone(), Instant::now());
        let sending = tokio::spawn(async move {
            let tell = |event| {
                if let StreamEvent::Failed { cause, times } = event {
                    said.lock().unwrap().push((cause, times));
                }
            };
            sender.run(tell).await.unwrap();
        });
        Self { robot, _gate: gate, frames, failures, sending, began }
    }

    /// Waits until so many more frames have arrived.
    async fn more(&self, frames: u64) {
        let wanted = self.frames.load(Ordering::Relaxed) + frames;
        wait_for("frames", || (self.frames.load(Ordering::Relaxed) >= wanted).then_some(())).await;
    }

    /// Waits until that was said, from the message of that number on.
    async fn said(&self, what: &str, from: usize) {
        wait_for(what, || {
            let said = self.failures.lock().unwrap();
            said.iter().skip(from).any(|(cause, _)| cause.contains(what)).then_some(())
        })
        .await;
    }

    fn messages(&self) -> usize {
        self.failures.lock().unwrap().len()
    }

    async fn stop(self) {
        let (messages, seconds) = (self.messages(), self.began.elapsed().as_secs_f64());
        assert!(messages as f64 <= seconds + 1.0, "{messages} messages in {seconds:.1} s");
        assert!(!self.sending.is_finished());
        self.sending.abort();
        self.robot.stop().await;
    }
}

/// A camera that delivers while it is plugged in, and fails at once, again and again, while it is not.
struct Plug(Arc<AtomicBool>);

impl Source for Plug {
    fn describe(&self) -> String {
        "a camera in a test".to_owned()
    }
    fn period(&self) -> Duration {
        Duration::from_millis(5)
    }
    fn next_frame(&mut self, now: Duration, _: &Scene) -> Result<Frame, SourceError> {
        match self.0.load(Ordering::Relaxed) {
            true => Frame::from_bgr(32, 24, &[90; 32 * 24 * 3], now),
            false => Err(SourceError::NoFrame("/dev/plug".into())),
        }
    }
}

pub async fn a_camera_that_is_missing_vanishes_and_returns_is_streamed_when_it_is_there() {
    let plugged = Arc::new(AtomicBool::new(false));
    let of_feed = plugged.clone();
    let feed = Feed::with(
        "a camera in a test",
        Box::new(move || match of_feed.load(Ordering::Relaxed) {
            true => Ok(Box::new(Plug(of_feed.clone()))),
            false => Err(SourceError::Missing("/dev/plug".into())),
        }),
    );
    let taken = Taken::from(feed, &unique("vanishing")).await;
    taken.said("/dev/plug does not exist", 0).await;
    for _ in 0..2 {
        plugged.store(true, Ordering::Relaxed);
        taken.more(20).await;
        let before = taken.messages();
        plugged.store(false, Ordering::Relaxed);
        // It fails two hundred times a second until it is closed; then it cannot be opened.
        taken.said("does not exist", before).await;
    }
    taken.stop().await;
}

pub async fn pictures_that_appear_late_and_bad_ones_among_them_are_streamed() {
    let hands = Hands::new(2);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("late");
    let camera = CameraSection {
        model: CameraChoice::Parrot,
        source: SourceSection::Images(FilesSection { path: path.clone(), repeat: true }),
        ..CameraSection::default()
    };
    let feed = Feed::new(&camera, RobotId(7), Duration::ZERO).unwrap();
    assert!(feed.describe().contains("late"));
    let taken = Taken::from(feed, &unique("late")).await;
    taken.said("does not exist", 0).await;
    // Twelve bad ones in front, at thirty pictures a second.
    let filling = folder.path().join("filling");
    std::fs::create_dir(&filling).unwrap();
    for k in 0..12 {
        std::fs::write(filling.join(format!("0{k:02}.jpg")), "a shopping list").unwrap();
    }
    for entry in std::fs::read_dir(hands.encoded()).unwrap() {
        let entry = entry.unwrap();
        std::fs::copy(entry.path(), filling.join(format!("9{}", entry.file_name().display()))).unwrap();
    }
    std::fs::rename(&filling, &path).unwrap();
    taken.more(30).await;
    taken.said("no image that can be decoded", 0).await;
    taken.stop().await;
}

/// Writes JPEG pictures to a pipe, one after the other, as slowly as a camera would, until nobody reads or wants more.
fn play(pictures: &[Vec<u8>], pipe: &Path, wanted: &AtomicBool) {
    let mut writer = std::fs::OpenOptions::new().write(true).open(pipe).unwrap();
    for picture in pictures.iter().cycle() {
        if !wanted.load(Ordering::Relaxed) || writer.write_all(picture).is_err() {
            return;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

pub async fn a_pipe_whose_writers_come_and_go_is_streamed_while_there_is_one() {
    let (hands, folder) = (Hands::new(2), tempfile::tempdir().unwrap());
    let pipe = folder.path().join("camera");
    let entries = std::fs::read_dir(hands.encoded()).unwrap();
    let pictures: Arc<Vec<_>> =
        Arc::new(entries.map(|e| std::fs::read(e.unwrap().path()).unwrap()).collect());
    let camera = CameraSection {
        model: CameraChoice::Parrot,
        source: SourceSection::Video(FilesSection { path: pipe.clone(), repeat: false }),
        ..CameraSection::default()
    };
    let taken = Taken::from(Feed::new(&camera, RobotId(7), Duration::ZERO).unwrap(), &unique("pipe")).await;
    taken.said("does not exist", 0).await;
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    for _ in 0..3 {
        let (said, wanted) = (taken.messages(), Arc::new(AtomicBool::new(true)));
        let (pictures, pipe, of_writer) = (pictures.clone(), pipe.clone(), wanted.clone());
        let writing = tokio::task::spawn_blocking(move || play(&pictures, &pipe, &of_writer));
        taken.more(20).await;
        wanted.store(false, Ordering::Relaxed);
        writing.await.unwrap();
        taken.said("nobody writes to the pipe", said).await;
    }
    taken.stop().await;
}
