//! Cameras that are missing, hang, or go away and come back: the robot says so, and stays a member of the swarm.

use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use gestalt_link::Event;
use gestalt_peer::body::Body;
use gestalt_peer::config::{
    CameraChoice, CameraSection, Config, DeviceSection, FilesSection, ModelSection, MotionConfig,
    RenderedSection, SourceSection,
};
use gestalt_peer::picture::write_png;
use gestalt_peer::stream::{Feed, Sender, SenderConfig, StreamEvent};
use gestalt_peer::swarm::Members;
use gestalt_protocol::{Camera, CameraState, Decision, RobotId, Status};
use gestalt_tests::{Hands, model, unique};
use gestalt_vision::config::DeviceSettings;
use gestalt_vision::pose::Pose;
use gestalt_vision::source::{Frame, Glove, RenderedSource, Scene, Source, SourceError};
use serde_json::json;

use crate::stream::{center_asking, wait_for};

const PATIENCE: Duration = Duration::from_secs(15);

fn config(id: u32, swarm: &str, source: SourceSection) -> Config {
    let mut config = Config::default();
    config.robot.id = RobotId(id);
    config.swarm.0 = swarm.to_owned();
    config.camera = CameraSection { model: CameraChoice::Laptop, source, ..CameraSection::default() };
    config.model = ModelSection::Rendered;
    config.links.scouting.enabled = false;
    config.zenoh.insert("listen".to_owned(), json!({"endpoints": ["tcp/127.0.0.1:0"]}));
    config
}

fn rendered() -> SourceSection {
    SourceSection::Rendered(RenderedSection { seed: 4, ..RenderedSection::default() })
}

fn device(path: &Path) -> SourceSection {
    SourceSection::Device(DeviceSection { path: path.into(), v4l2: DeviceSettings::default() })
}

/// Waits until the camera is as it should be.
async fn camera(body: &Body, is: impl Fn(&Camera) -> bool) -> Camera {
    let deadline = Instant::now() + PATIENCE;
    loop {
        let camera = body.robot().status().camera;
        if is(&camera) {
            return camera;
        }
        assert!(Instant::now() < deadline, "{camera:?}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

async fn decision(events: &mut tokio::sync::broadcast::Receiver<Event>) -> Decision {
    let held = async {
        loop {
            if let Event::Held(decision) = events.recv().await.unwrap() {
                return decision;
            }
        }
    };
    tokio::time::timeout(PATIENCE, held).await.expect("a decision")
}

pub async fn a_robot_whose_camera_is_missing_relays_and_agrees() {
    let swarm = unique("cameras");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("video7");
    let sources = [rendered(), device(&path), rendered()];
    let configs: Vec<Config> = (1..).zip(sources).map(|(id, source)| config(id, &swarm, source)).collect();
    let (members, _) = Members::here(&configs, &[(0, 1), (1, 2)], &model(), |_| ()).await.unwrap();
    let bodies = members.bodies();
    let blind = camera(&bodies[1], |camera| camera.state == CameraState::Failing).await;
    assert!(blind.trouble.contains("video7") && blind.trouble.contains("does not exist"), "{blind:?}");
    for body in bodies {
        let deadline = Instant::now() + PATIENCE;
        while body.robot().status().alive.len() < 3 && Instant::now() < deadline {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }
    let mut events: Vec<_> = bodies.iter().map(|body| body.robot().events()).collect();
    bodies[0].robot().open_round();
    let mut held = Vec::new();
    for events in &mut events {
        held.push(decision(events).await);
    }
    // What the first saw, the last knows through the one without eyes, who counts its robots' votes like any other.
    assert!(held.iter().all(|decision| decision.class == held[0].class), "{held:?}");
    assert!(held[0].class.is_some() && held[0].certificate.votes.iter().all(|vote| vote.robot != RobotId(2)));
    // Something is plugged in, and is no camera: the words change, the robot goes on trying.
    std::fs::write(&path, "no camera").unwrap();
    camera(&bodies[1], |camera| camera.trouble.contains("no camera that V4L2 can open")).await;
    members.stop().await;
}

pub async fn a_camera_that_hangs_keeps_nobody() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film");
    // Opening a pipe that nobody writes to never returns.
    assert!(Command::new("mkfifo").arg(&path).status().unwrap().success());
    let pipe = SourceSection::Video(FilesSection { path, repeat: false });
    let (config, model) = (config(1, &unique("cameras"), pipe), Some(model()));
    // On a thread of its own: one that waits for its camera would keep the test.
    let starting = tokio::spawn(async move { Body::start(&config, model, 1).await.unwrap() });
    let body = tokio::time::timeout(PATIENCE, starting).await.expect("it starts").unwrap();
    let hung = camera(&body, |camera| camera.state == CameraState::Frozen).await;
    assert!(hung.trouble.contains("no frame for"), "{hung:?}");
    body.robot().open_round();
    tokio::time::timeout(PATIENCE, body.stop()).await.expect("it stops though its camera hangs");
}

/// A camera that hangs while it is told to: it delivers its last picture again and again.
struct Hanging(Arc<AtomicBool>, u8);

impl Source for Hanging {
    fn describe(&self) -> String {
        "a camera in a test".to_owned()
    }
    fn period(&self) -> Duration {
        Duration::from_millis(50)
    }
    fn is_live(&self) -> bool {
        true
    }
    fn next_frame(&mut self, now: Duration, _: &Scene) -> Result<Frame, SourceError> {
        std::thread::sleep(self.period());
        if !self.0.load(Ordering::Relaxed) {
            self.1 = self.1.wrapping_add(1);
        }
        Frame::from_bgr(32, 24, &[self.1; 32 * 24 * 3], now)
    }
}

pub async fn a_streamed_camera_that_hangs_is_not_looked_at_until_it_goes_on() {
    let (swarm, hands) = (unique("hanging"), Hands::new(2));
    let center = center_asking(&swarm, &hands, 1, Some(3)).await;
    let hangs = Arc::new(AtomicBool::new(false));
    let of_feed = hangs.clone();
    let feed = Feed::with("a camera in a test", Box::new(move || Ok(Box::new(Hanging(of_feed.clone(), 0)))));
    let config = SenderConfig {
        link: serde_json::from_value(json!({"connect": center.robot().locators()})).unwrap(),
        swarm,
        robot: RobotId(7),
        camera: "parrot".to_owned(),
        quality: 80,
        signer: None,
    };
    let said = Arc::<Mutex<Vec<String>>>::default();
    let of_sender = said.clone();
    let sending = tokio::spawn(Sender::start(config, feed).unwrap().run(move |event| {
        if let StreamEvent::Failed { cause, .. } = event {
            of_sender.lock().unwrap().push(cause);
        }
    }));
    let is = async |state| {
        let of = |status: &Status| status.camera.state == state;
        wait_for("that state", || center.served().iter().any(of).then_some(())).await;
    };
    is(CameraState::Live).await;
    hangs.store(true, Ordering::Relaxed);
    is(CameraState::Frozen).await;
    assert!(said.lock().unwrap().iter().any(|cause| cause.contains("identical pictures")), "{said:?}");
    hangs.store(false, Ordering::Relaxed);
    is(CameraState::Live).await;
    sending.abort();
    center.stop().await;
}

pub async fn pictures_that_vanish_and_come_back_are_taken_up_again() {
    let folder = tempfile::tempdir().unwrap();
    let shown = folder.path().join("shown");
    std::fs::create_dir(&shown).unwrap();
    // Taken by another camera than camera.model says.
    let footbot = CameraChoice::Footbot.properties();
    let mut source = RenderedSource::new(footbot, Pose::FRONTAL, Glove::default(), 1).unwrap();
    for number in 0..4 {
        let scene = Scene { gesture: Some(2), seed: 1 };
        let image = source.next_frame(Duration::ZERO, &scene).unwrap().image;
        write_png(&shown.join(format!("{number}.png")), &image).unwrap();
    }
    let mut config = config(
        1,
        &unique("cameras"),
        SourceSection::Images(FilesSection { path: shown.clone(), repeat: true }),
    );
    config.camera.motion = MotionConfig::watching();
    let body = Body::start(&config, Some(model()), 1).await.unwrap();
    let live = camera(&body, |camera| camera.state == CameraState::Live && camera.fps > 0.0).await;
    assert_eq!(live.size, [384, 288]);
    assert!(live.motion.is_some(), "{live:?}");
    let said = body.robot().status().errors;
    assert_eq!(said.iter().filter(|error| error.what.contains("384×288")).count(), 1, "{said:?}");
    let away = folder.path().join("away");
    std::fs::rename(&shown, &away).unwrap();
    let failing = camera(&body, |camera| camera.state == CameraState::Failing).await;
    assert!(failing.trouble.contains("does not exist"), "{failing:?}");
    std::fs::rename(&away, &shown).unwrap();
    camera(&body, |camera| camera.state == CameraState::Live).await;
    body.stop().await;
}
