//! Cameras whose frames are looked at elsewhere: pictures of drawn hands, and a classifier for them.

use std::path::PathBuf;
use std::sync::OnceLock;
use std::time::Duration;

use gestalt_link::LinkConfig;
use gestalt_peer::config::{CameraChoice, CameraSection, Config, FilesSection, SourceSection};
use gestalt_peer::picture::write_png;
use gestalt_peer::stream::{Feed, SenderConfig};
use gestalt_protocol::RobotId;
use gestalt_strategies::Quorum;
use gestalt_vision::camera_model::CameraModel;
use gestalt_vision::model::RobotModel;
use gestalt_vision::pose::Pose;
use gestalt_vision::source::{Glove, RenderedSource, Scene, Source, encode_jpeg};
use serde_json::{Value, json};

/// A classifier of drawn hands, learned once for all scenarios.
///
/// # Panics
/// When it cannot be trained.
#[must_use]
pub fn model() -> RobotModel {
    static MODEL: OnceLock<RobotModel> = OnceLock::new();
    MODEL.get_or_init(|| RobotModel::rendered().expect("it can be trained")).clone()
}

/// A folder of pictures of one gesture, and a file with the classifier that tells it.
pub struct Hands {
    folder: tempfile::TempDir,
}

impl Hands {
    /// Draws a hand that shows so many fingers, and writes the classifier, which takes some seconds the first time.
    ///
    /// # Panics
    /// When there is no room for files.
    #[must_use]
    pub fn new(fingers: u8) -> Self {
        let hands = Self { folder: tempfile::tempdir().expect("a folder for the pictures") };
        model().write(&hands.model()).expect("the model is written");
        std::fs::create_dir(hands.images()).expect("a folder for the pictures");
        std::fs::create_dir(hands.encoded()).expect("a folder for the pictures");
        let mut source = RenderedSource::new(CameraModel::parrot(), Pose::FRONTAL, Glove::Cyan, 1)
            .expect("the preset is a valid camera");
        for k in 0..4 {
            let scene = Scene { gesture: Some(fingers), seed: 3 };
            let frame = source.next_frame(Duration::ZERO, &scene).expect("a hand can be drawn");
            // PNG, so that the sender has something to encode.
            write_png(&hands.images().join(format!("{k}.png")), &frame.image)
                .expect("the picture is written");
            let jpeg = hands.encoded().join(format!("{k}.jpg"));
            let encoded = encode_jpeg(&frame.image, 80).expect("a picture");
            std::fs::write(jpeg, encoded).expect("the picture is written");
        }
        hands
    }

    /// The folder of the same pictures as JPEG files, which are sent as they are.
    #[must_use]
    pub fn encoded(&self) -> PathBuf {
        self.folder.path().join("encoded")
    }

    /// The folder of pictures.
    #[must_use]
    pub fn images(&self) -> PathBuf {
        self.folder.path().join("images")
    }

    /// The file with the classifier.
    #[must_use]
    pub fn model(&self) -> PathBuf {
        self.folder.path().join("hands.model")
    }
}

/// The configuration of a centre, from a process's orders: `{"id": 9, "swarm": "demo", "link": {…}, "serve": {"fuse":
/// "central", "workers": 1, "max_robots": 8}}`.
///
/// # Panics
/// When they are no orders.
#[must_use]
pub fn center_config(orders: &Value) -> Config {
    let mut config = Config::default();
    config.robot.id = serde_json::from_value(orders["id"].clone()).expect("\"id\": a number");
    orders["swarm"].as_str().expect("\"swarm\": a name").clone_into(&mut config.swarm.0);
    config.links.scouting.enabled = false;
    for key in ["listen", "connect"] {
        let endpoints = orders["link"].get(key).cloned().unwrap_or_else(|| json!([]));
        config.zenoh.insert(key.to_owned(), json!({ "endpoints": endpoints }));
    }
    config.trust.insecure = orders["link"]["insecure"].as_bool().unwrap_or_default();
    let serve = &orders["serve"];
    if !serve["fuse"].is_null() {
        config.center.fuse =
            serde_json::from_value(serve["fuse"].clone()).expect("\"fuse\": central or swarm");
    }
    config.center.workers = serve["workers"].as_u64().and_then(|workers| usize::try_from(workers).ok());
    if let Some(most) = serve["max_robots"].as_u64().and_then(|most| usize::try_from(most).ok()) {
        config.center.max_robots = most;
    }
    config.center.gone_after = Duration::from_secs(4);
    // Two of five go on when a centre takes three with it.
    config.rounds.quorum = Quorum::Evidence(1);
    config
}

/// A Parrot that sends the pictures of a folder, from a process's orders: `{"id": 3, "swarm": "demo", "link": {…}, "stream":
/// {"images": "DIR"}}`.
///
/// # Panics
/// When they are no orders.
#[must_use]
pub fn sender_config(orders: &Value) -> (SenderConfig, Feed) {
    let robot: RobotId = serde_json::from_value(orders["id"].clone()).expect("\"id\": a number");
    let link: LinkConfig = serde_json::from_value(orders["link"].clone()).expect("\"link\": a LinkConfig");
    let path = orders["stream"]["images"].as_str().expect("\"images\": a folder").into();
    let camera = CameraSection {
        model: CameraChoice::Parrot,
        source: SourceSection::Images(FilesSection { path, repeat: true }),
        ..CameraSection::default()
    };
    let feed = Feed::new(&camera, robot, Duration::ZERO).expect("a camera");
    let swarm = orders["swarm"].as_str().expect("\"swarm\": a name").to_owned();
    (SenderConfig { swarm, link, robot, camera: "parrot".to_owned(), quality: 80, signer: None }, feed)
}
