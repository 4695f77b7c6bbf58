//! Eyes that fall over: the robot says what happened, and its swarm does not wait for it.

use std::time::Duration;

use gestalt_link::Event;
use gestalt_peer::body::Body;
use gestalt_peer::config::{CameraChoice, CameraSection, Config, RenderedSection, SourceSection};
use gestalt_protocol::{Camera, CameraState, Decision, RobotId};
use gestalt_tests::{model, unique};
use gestalt_vision::camera_model::CameraModel;
use gestalt_vision::pose::Pose;
use gestalt_vision::source::{Frame, Glove, Opener, RenderedSource, Scene, Source, SourceError};
use serde_json::json;
use tokio::sync::broadcast::Receiver;
use tokio::time::{Instant, timeout};

/// A round that waits for a robot which says nothing lasts longer than that.
const PATIENCE: Duration = Duration::from_secs(20);

/// Panics on its fifth frame, every time it is opened.
struct Fragile {
    camera: RenderedSource,
    frames: u32,
}

impl Fragile {
    fn open() -> Result<Self, SourceError> {
        let camera = RenderedSource::new(CameraModel::laptop(), Pose::FRONTAL, Glove::default(), 2)?;
        Ok(Self { camera, frames: 0 })
    }
}

impl Source for Fragile {
    fn describe(&self) -> String {
        "a fragile camera".to_owned()
    }
    fn period(&self) -> Duration {
        self.camera.period()
    }
    fn is_live(&self) -> bool {
        true
    }
    fn next_frame(&mut self, now: Duration, scene: &Scene) -> Result<Frame, SourceError> {
        std::thread::sleep(self.period());
        self.frames += 1;
        assert!(self.frames < 5, "the fifth frame");
        self.camera.next_frame(now, scene)
    }
}

fn config(id: u32, swarm: &str, connect: &[String]) -> Config {
    let mut config = Config::default();
    config.robot.id = RobotId(id);
    config.swarm.0 = swarm.to_owned();
    config.camera = CameraSection {
        model: CameraChoice::Laptop,
        source: SourceSection::Rendered(RenderedSection { seed: 4, ..RenderedSection::default() }),
        ..CameraSection::default()
    };
    (config.rounds.patience, config.rounds.deadline) = (3 * PATIENCE, 3 * PATIENCE);
    // Rounds follow one upon the other.
    config.rounds.refractory = Duration::ZERO;
    config.learning.enabled = false;
    config.links.scouting.enabled = false;
    config.zenoh.insert("listen".to_owned(), json!({"endpoints": ["tcp/127.0.0.1:0"]}));
    config.zenoh.insert("connect".to_owned(), json!({"endpoints": connect}));
    config
}

async fn camera(body: &Body, is: impl Fn(&Camera) -> bool) -> Camera {
    let deadline = Instant::now() + PATIENCE;
    loop {
        let camera = body.robot().status().camera;
        if is(&camera) {
            return camera;
        }
        assert!(Instant::now() < deadline, "{camera:?}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

/// Opens a round at that robot, and waits until it is decided and over.
async fn decide(body: &Body, events: &mut Receiver<Event>) -> Decision {
    body.robot().open_round();
    let decided = async {
        let mut held = None;
        loop {
            match events.recv().await.unwrap() {
                Event::Held(decision) => held = Some(decision),
                Event::Closed(_) if held.is_some() => return held.take().unwrap(),
                _ => {}
            }
        }
    };
    timeout(PATIENCE, decided).await.expect("nobody waits for a robot that cannot see")
}

pub async fn nobody_waits_for_a_source_that_panics() {
    let swarm = unique("eyes");
    let first = Body::start(&config(1, &swarm, &[]), Some(model()), 1).await.unwrap();
    let connect = first.robot().locators().to_vec();
    let open: Opener = Box::new(|| Ok(Box::new(Fragile::open()?)));
    let began = Instant::now();
    let fragile = Body::start_with(&config(2, &swarm, &connect), model(), 1, open).await.unwrap();
    let third = Body::start(&config(3, &swarm, &connect), Some(model()), 1).await.unwrap();
    let failing = camera(&fragile, |camera| camera.state == CameraState::Failing).await;
    eprintln!("named after {:?}: {}", began.elapsed(), failing.trouble);
    assert_eq!(failing.source, "a fragile camera");
    assert!(failing.trouble.contains("panicked (the fifth frame)"), "{failing:?}");
    while first.robot().status().alive.len() < 3 {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    // While it is opened again and again, and when it is given up.
    let mut events = first.robot().events();
    for round in 0..4 {
        if round == 3 {
            let given_up = camera(&fragile, |camera| camera.trouble.contains("5 times in a row")).await;
            assert_eq!(given_up.state, CameraState::Failing);
        }
        let began = Instant::now();
        let decision = decide(&first, &mut events).await;
        eprintln!("round {round}: {:?}, {} votes", began.elapsed(), decision.certificate.votes.len());
        let voted = |robot: u32| decision.certificate.votes.iter().any(|vote| vote.robot == RobotId(robot));
        assert!(decision.class.is_some() && voted(1) && voted(3), "{decision:?}");
    }
    for body in [third, fragile, first] {
        body.stop().await;
    }
}
