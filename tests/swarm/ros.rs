//! A ROS 2 system beside the swarm. The tests speak `rmw_zenoh`'s wire by hand, at a Zenoh router, which is what `rmw_zenohd` is.

use std::net::TcpListener;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::time::{Duration, Instant};

use gestalt_link::{Event, RobotConfig};
use gestalt_peer::body::Body;
use gestalt_peer::config::{CameraChoice, CameraSection, Config, RosNodeSection, RosSection, SourceSection};
use gestalt_protocol::{CameraState, ClassId, RobotId};
use gestalt_ros::RosMessage;
use gestalt_ros::message::{CompressedImage, Header};
use gestalt_strategies::MindConfig;
use gestalt_tests::{Process, config, learning, model, short_rounds, start_learning, unique};
use gestalt_vision::camera_model::CameraModel;
use gestalt_vision::pose::Pose;
use gestalt_vision::source::{Glove, RenderedSource, Scene, Source, encode_jpeg};
use opencv::prelude::*;
use serde_json::{Value, json};
use tokio::time::timeout;
use zenoh::Session;
use zenoh::handlers::FifoChannelHandler;
use zenoh::pubsub::Subscriber;
use zenoh::query::ReplyKeyExpr;
use zenoh::sample::Sample;

const PATIENCE: Duration = Duration::from_secs(30);

/// The domain of the tests: no ROS system on this machine is likely to be in it.
const DOMAIN: u32 = 97;

const STRING: &str =
    "std_msgs::msg::dds_::String_/RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18";

async fn session(mode: &str, key: &str, endpoint: &str) -> Session {
    let mut config = zenoh::Config::default();
    for (key, value) in [
        ("mode", json!(mode)),
        (key, json!([endpoint])),
        ("scouting/multicast/enabled", json!(false)),
        ("timestamping/enabled", json!(true)),
    ] {
        config.insert_json5(key, &value.to_string()).unwrap();
    }
    zenoh::open(config).await.unwrap()
}

/// A router as `rmw_zenohd` is one, and a session of somebody in that ROS system.
async fn ros() -> (Session, Session, String) {
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let endpoint = format!("tcp/127.0.0.1:{port}");
    let router = session("router", "listen/endpoints", &endpoint).await;
    let node = session("client", "connect/endpoints", &endpoint).await;
    (router, node, endpoint)
}

/// A text as Fast CDR writes it.
fn text(text: &str) -> Vec<u8> {
    let length = u32::try_from(text.len() + 1).unwrap().to_le_bytes();
    [&[0, 1, 0, 0], &length[..], text.as_bytes(), &[0]].concat()
}

fn read(sample: &Sample) -> String {
    let bytes = sample.payload().to_bytes();
    let (&[0, 1, 0, 0], rest) = bytes.split_first_chunk().unwrap() else { panic!("{bytes:?}") };
    let (length, rest) = rest.split_first_chunk().unwrap();
    let (&end, text) = rest.split_last().unwrap();
    assert_eq!((u32::from_le_bytes(*length) as usize, end), (rest.len(), 0));
    assert_eq!(sample.attachment().unwrap().len(), 33);
    String::from_utf8(text.to_vec()).unwrap()
}

/// Waits for the first text on a topic for which `pick` has a value.
async fn next<T>(
    topic: &Subscriber<FifoChannelHandler<Sample>>,
    mut pick: impl FnMut(&str) -> Option<T>,
) -> T {
    let found = async {
        loop {
            let said = read(&topic.recv_async().await.unwrap());
            eprintln!("{}: {}", topic.key_expr(), said.chars().take(120).collect::<String>());
            if let Some(found) = pick(&said) {
                return found;
            }
        }
    };
    timeout(PATIENCE, found).await.expect("it comes in time")
}

async fn tokens(node: &Session) -> Vec<String> {
    let replies = node.liveliness().get(format!("@ros2_lv/{DOMAIN}/**")).await.unwrap();
    let mut tokens = Vec::new();
    while let Ok(reply) = replies.recv_async().await {
        tokens.push(reply.result().unwrap().key_expr().to_string());
    }
    tokens
}

pub async fn a_ros_system_hears_what_a_swarm_decides_and_teaches_it() {
    let (_router, node, endpoint) = ros().await;
    let (swarm, shown) = (unique("ros"), Arc::new(AtomicU8::new(3)));
    let mut robots = Vec::new();
    let mut connect = Vec::new();
    for id in 1..=2 {
        let config = RobotConfig {
            // Two robots that were shown each gesture once are not sure.
            mind: MindConfig { alpha: Some(0.4), ..short_rounds() },
            learning: Some(learning(8, 1.0, None)),
            ..config(id, &swarm, &connect)
        };
        robots.push(start_learning(config, shown.clone()).await);
        connect = robots[0].robot.locators().to_vec();
    }
    assert!(robots[0].sees_alive(1, PATIENCE).await);

    // Nothing of ROS is to be heard in the swarm, nor of the swarm in ROS.
    let inside = session("client", "connect/endpoints", &connect[0]).await;
    let leaked_in = inside.declare_subscriber(format!("{DOMAIN}/**")).await.unwrap();
    let leaked_out = node.declare_subscriber(format!("gestalt/{swarm}/**")).await.unwrap();

    let topic = |name: &str| format!("{DOMAIN}/gestalt/{name}/{STRING}");
    let decisions = node.declare_subscriber(topic("decision")).await.unwrap();
    let answers = node.declare_subscriber(topic("answer")).await.unwrap();
    let diagnostics = node.declare_subscriber(format!("{DOMAIN}/diagnostics/**")).await.unwrap();
    let domain = DOMAIN.to_string();
    let mut gestalt = Command::new(env!("CARGO_BIN_EXE_test-gestalt"));
    gestalt.args(["ros", "-e", &connect[0], "--swarm", &swarm, "--no-multicast-scouting"]);
    let bridge = Process::run(gestalt.args(["--router", &endpoint, "--domain", &domain]));
    let began = Instant::now();
    while !tokens(&node).await.iter().any(|token| token.contains("/MS/") && token.contains("%gestalt%say")) {
        assert!(began.elapsed() < PATIENCE, "the node is there");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    let say = async |word: &str| {
        let attachment = [&7_i64.to_le_bytes()[..], &9_i64.to_le_bytes(), &[16], &[3; 16]].concat();
        node.put(topic("say"), text(word)).attachment(attachment).await.unwrap();
    };
    let decided = |said: &str| Some(serde_json::from_str::<Value>(said).expect("a decision in JSON"));

    // From nothing: the first rounds decide nothing, and are told what they showed. As long as a gesture of the list was not, any may be that one.
    for class in [4, 1, 5, 0, 2, 3] {
        shown.store(class, Ordering::Relaxed);
        say("open").await;
        next(&decisions, decided).await;
        tokio::time::sleep(Duration::from_millis(700)).await;
        say(&format!("was {class}")).await;
        next(&answers, |said| said.contains("learned; robot").then_some(())).await;
    }
    let of_three = async {
        for _ in 0..10 {
            shown.store(3, Ordering::Relaxed);
            tokio::time::sleep(Duration::from_millis(700)).await;
            say("open").await;
            if next(&decisions, decided).await["label"] == "3" {
                return true;
            }
        }
        false
    };
    assert!(of_three.await, "what was taught is decided");
    say("was nonsense").await;
    next(&answers, |said| said.contains("no such gesture").then_some(())).await;
    say("dance").await;
    next(&answers, |said| said.contains("unknown command 'dance'").then_some(())).await;
    node.put(topic("say"), vec![0_u8; 3]).await.unwrap();

    // Whoever subscribes late to the latched topic asks the publisher's cache, as zenoh-ext's subscriber does.
    let late = node.get(format!("{}/@adv/**?_max=1", topic("gesture")));
    let late = late.accept_replies(ReplyKeyExpr::Any).await.unwrap();
    let latched = late.recv_async().await.expect("the last gesture is kept");
    assert_eq!(read(latched.result().unwrap()), "3");

    let known = tokens(&node).await;
    for part in
        ["/NN/%/%/gestalt", "%gestalt%gesture/", "%gestalt%decision/", "%diagnostics/", "%gestalt%say/"]
    {
        assert!(known.iter().any(|token| token.contains(part)), "{part}: {known:#?}");
    }
    let report = timeout(PATIENCE, diagnostics.recv_async()).await.unwrap().unwrap();
    let report = gestalt_ros::message::Diagnostics::decode(&report.payload().to_bytes()).unwrap();
    assert_eq!(report.status.len(), 2, "{report:?}");
    assert_eq!((leaked_in.len(), leaked_out.len()), (0, 0));

    // A bridge that is killed is gone from ROS's graph.
    drop(bridge);
    let began = Instant::now();
    while !tokens(&node).await.is_empty() {
        assert!(began.elapsed() < PATIENCE, "its tokens go with it");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    for robot in robots {
        robot.stop().await;
    }
}

/// A camera driver that publishes what its camera sees, until it is told to stop.
fn drive(node: Session, topic: String, shown: Arc<AtomicU8>, stop: Arc<AtomicBool>) {
    let mut camera = RenderedSource::new(CameraModel::laptop(), Pose::FRONTAL, Glove::default(), 5).unwrap();
    let publisher = zenoh::Wait::wait(node.declare_publisher(topic)).unwrap();
    let began = Instant::now();
    while !stop.load(Ordering::Relaxed) {
        let gesture = shown.load(Ordering::Relaxed);
        let scene = Scene { gesture: Some(gesture), seed: u64::from(gesture) };
        let frame = camera.next_frame(began.elapsed(), &scene).unwrap();
        let data = encode_jpeg(&frame.image, 90).unwrap();
        let message = CompressedImage { header: Header::default(), format: "jpeg".to_owned(), data };
        zenoh::Wait::wait(publisher.put(message.encode())).unwrap();
        std::thread::sleep(Duration::from_millis(60));
    }
}

pub async fn a_robot_sees_through_a_camera_that_a_ros_driver_owns() {
    let (_router, node, endpoint) = ros().await;
    let topic = "/camera/image_raw/compressed";
    let source = RosSection { topic: topic.to_owned(), router: Some(endpoint.clone()), domain: DOMAIN };
    let mut config = Config::default();
    config.robot.id = RobotId(1);
    config.swarm.0 = unique("driver");
    config.camera = CameraSection {
        model: CameraChoice::Laptop,
        source: SourceSection::Ros(source),
        ..CameraSection::default()
    };
    config.ros = RosNodeSection {
        enabled: true,
        router: Some(endpoint),
        domain: DOMAIN,
        views_per_second: 5.0,
        ..RosNodeSection::default()
    };
    config.rounds.refractory = Duration::ZERO;
    config.learning.enabled = false;
    config.links.scouting.enabled = false;
    config.zenoh.insert("listen".to_owned(), json!({"endpoints": ["tcp/127.0.0.1:0"]}));
    let viewer = node.clone();
    let body = Body::start(&config, Some(model()), 1).await.unwrap();
    let mut events = body.robot().events();

    // Before the driver runs, the robot says what is missing.
    let began = Instant::now();
    while !body.robot().status().camera.trouble.contains("ros2 topic hz /camera/image_raw/compressed") {
        assert!(began.elapsed() < PATIENCE, "{:?}", body.robot().status().camera);
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    let (shown, stop) = (Arc::new(AtomicU8::new(0)), Arc::new(AtomicBool::new(false)));
    let key = format!("{DOMAIN}{topic}/{}/{}", CompressedImage::dds_type(), CompressedImage::HASH);
    let driver = {
        let (shown, stop) = (shown.clone(), stop.clone());
        std::thread::spawn(move || drive(node, key, shown, stop))
    };
    while body.robot().status().camera.state != CameraState::Live {
        assert!(began.elapsed() < 2 * PATIENCE, "{:?}", body.robot().status().camera);
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    let mut right = 0;
    for round in 0..10 {
        let gesture = round % 6;
        shown.store(gesture, Ordering::Relaxed);
        // What was under way when the gesture changed.
        tokio::time::sleep(Duration::from_millis(300)).await;
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
        let decision = timeout(PATIENCE, decided).await.expect("it decides");
        eprintln!("{gesture}: {:?} ({:.3})", decision.class, decision.confidence);
        right += u32::from(decision.class == Some(ClassId(gesture.into())));
    }
    the_view_is_drawn_for_who_subscribes_alone(&viewer, &body).await;
    stop.store(true, Ordering::Relaxed);
    driver.join().unwrap();
    body.stop().await;
    assert_eq!(right, 10, "of ten gestures");
}

/// What the robot of id 1 shows of what it sees: it holds a hand of five fingers in view.
async fn the_view_is_drawn_for_who_subscribes_alone(viewer: &Session, body: &Body) {
    let shown = || body.robot().status().counters.get("views_shown").copied().unwrap_or(0);
    assert_eq!(shown(), 0, "ten rounds, and nobody asked to see them");
    let known = tokens(viewer).await;
    let hash = CompressedImage::HASH;
    // Reliable, volatile, the last one: as rmw_zenoh writes it.
    let announced = format!(
        "/MP/%/%gestalt/robot_1/%gestalt%robot_1%view%compressed/sensor_msgs::msg::dds_::CompressedImage_/{hash}/::,1:,:,:,,"
    );
    assert!(known.iter().any(|token| token.ends_with(&announced)), "{announced}: {known:#?}");

    let topic =
        format!("{DOMAIN}/gestalt/robot_1/view/compressed/sensor_msgs::msg::dds_::CompressedImage_/{hash}");
    let views = viewer.declare_subscriber(topic).await.unwrap();
    let view = async || {
        let sample = timeout(PATIENCE, views.recv_async()).await.expect("a view comes").unwrap();
        assert_eq!(sample.attachment().unwrap().len(), 33);
        let message = CompressedImage::decode(&sample.payload().to_bytes()).unwrap();
        assert_eq!((message.format.as_str(), message.header.frame.as_str()), ("jpeg", "gestalt_camera_1"));
        let mut picture = opencv::core::Mat::default();
        gestalt_vision::source::decode(&message.data, 2.0, &mut picture).unwrap();
        (message.header, picture)
    };
    // Between rounds a robot that watches no motion looks at nothing, and shows what its camera sees.
    let (first, picture) = view().await;
    assert_eq!((picture.cols(), picture.rows()), (640, 480 + 44), "the frame, and a line of words below");
    assert!(marked(&picture) < 50, "nothing is marked: {}", marked(&picture));
    let clock = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap();
    let age = clock.as_secs_f64() - f64::from(first.seconds) - f64::from(first.nanoseconds) / 1e9;
    assert!((0.0..5.0).contains(&age), "it was taken {age} s ago");
    let began = Instant::now();
    loop {
        // A round may be over before the next picture is due.
        body.robot().open_round();
        let (_, picture) = view().await;
        if marked(&picture) > 300 {
            break;
        }
        assert!(began.elapsed() < PATIENCE, "the hand is marked");
    }
    // At most five a second.
    while views.try_recv().unwrap().is_some() {}
    let (before, began) = (shown(), Instant::now());
    tokio::time::sleep(Duration::from_secs(3)).await;
    let (more, seconds) = (shown() - before, began.elapsed().as_secs_f64());
    eprintln!("{more} views in {seconds:.1} s");
    assert!(more >= 2 && more as f64 <= 5.0 * seconds + 1.0, "{more} in {seconds} s");
    // And none once nobody subscribes any more.
    views.undeclare().await.unwrap();
    tokio::time::sleep(Duration::from_secs(1)).await;
    let before = shown();
    tokio::time::sleep(Duration::from_secs(1)).await;
    assert_eq!(shown(), before);
}

/// Pixels of the colour in which a hand is marked, or nearly so: JPEG blurs lines.
fn marked(picture: &opencv::core::Mat) -> usize {
    let words = opencv::core::Rect::new(0, 0, picture.cols(), picture.rows() - 44);
    let frame = opencv::core::Mat::roi(picture, words).unwrap().try_clone().unwrap();
    let near = |pixel: &&opencv::core::Vec3b| {
        let [blue, green, red] = [pixel[0], pixel[1], pixel[2]].map(i32::from);
        (blue - 0x7f).abs() < 24 && (green - 0xb9).abs() < 24 && (red - 0x3f).abs() < 24
    };
    frame.data_typed::<opencv::core::Vec3b>().unwrap().iter().filter(near).count()
}
