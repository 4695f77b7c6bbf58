//! A camera of your own in a robot: frames from anywhere, here a picture that is computed.
//!
//! ```text
//! cargo run -p gestalt-examples --features eyes --example own_source
//! ```

use std::time::Duration;

use gestalt_peer::body::Body;
use gestalt_peer::config::Config;
use gestalt_protocol::{CameraState, RobotId};
use gestalt_vision::model::RobotModel;
use gestalt_vision::source::{Frame, Opener, Scene, Source, SourceError};
use serde_json::json;

const WIDTH: u32 = 64;
const HEIGHT: u32 = 48;

/// Your driver goes here: a bright square that wanders over a dark wall.
struct Square {
    frames: u32,
}

impl Square {
    fn open() -> Result<Self, SourceError> {
        Ok(Self { frames: 0 })
    }
}

impl Source for Square {
    fn describe(&self) -> String {
        "a wandering square".to_owned()
    }

    fn period(&self) -> Duration {
        Duration::from_millis(100)
    }

    /// It delivers by itself, as a camera does.
    fn is_live(&self) -> bool {
        true
    }

    /// Waits for the next picture. Who fails is opened again, and so is who panics; the robot's status says why.
    fn next_frame(&mut self, now: Duration, _: &Scene) -> Result<Frame, SourceError> {
        std::thread::sleep(self.period());
        self.frames += 1;
        if self.frames > 1_000_000 {
            return Err(SourceError::Own("the square is tired: buy another".to_owned()));
        }
        let left = self.frames % (WIDTH - 16);
        let mut pixels = Vec::new();
        for y in 0..HEIGHT {
            for x in 0..WIDTH {
                let inside = (left..left + 16).contains(&x) && (16..32).contains(&y);
                pixels.extend(if inside { [80, 200, 250] } else { [30, 30, 30] });
            }
        }
        Frame::from_bgr(WIDTH, HEIGHT, &pixels, now + self.period())
    }
}

async fn a_robot_looks_through_it() {
    let mut config = Config::default();
    config.robot.id = RobotId(1);
    config.swarm.0 = format!("example-{}", std::process::id());
    config.links.scouting.enabled = false;
    config.zenoh.insert("listen".to_owned(), json!({"endpoints": ["tcp/127.0.0.1:0"]}));
    let model = RobotModel::rendered().expect("the embedded model");
    let open: Opener = Box::new(|| Ok(Box::new(Square::open()?)));
    let body = Body::start_with(&config, model, 1, open).await.expect("a free port of this machine");
    let camera = loop {
        let camera = body.robot().status().camera;
        if camera.state == CameraState::Live && camera.fps > 0.0 {
            break camera;
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    };
    println!(
        "robot 1 looks at {}: {}×{} pixels, {:.1} fps",
        camera.source, camera.size[0], camera.size[1], camera.fps
    );
    assert_eq!((camera.source.as_str(), camera.size), ("a wandering square", [WIDTH, HEIGHT]));
    body.stop().await;
}

#[tokio::main]
async fn main() {
    a_robot_looks_through_it().await;
}

#[cfg(test)]
#[tokio::test(flavor = "multi_thread")]
async fn a_camera_of_your_own_is_live() {
    a_robot_looks_through_it().await;
}
