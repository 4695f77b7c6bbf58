//! The examples for ROS 1 and for ROS 2 over DDS, each beside a node of theirs that asks for a round and hears what came of it.

use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use gestalt_protocol::ClassId;
use gestalt_tests::{Process, Watched, config, start, unique};
use gestalt_trials::{Need, python};
use serde_json::Value;

const PATIENCE: Duration = Duration::from_secs(60);

/// Prints what it hears as a line of JSON each, and says `open` until it has heard a decision.
const ECHO_ROS1: &str = r#"
import json, rospy
from std_msgs.msg import String
rospy.init_node("echo")
heard = []
def hears(topic):
    def on(message):
        heard.append(topic)
        print(json.dumps({"topic": topic, "data": message.data}), flush=True)
    rospy.Subscriber("/gestalt/" + topic, String, on)
hears("decision")
hears("gesture")
say = rospy.Publisher("/gestalt/say", String, queue_size=1)
while not rospy.is_shutdown():
    if "decision" not in heard:
        say.publish("open")
    rospy.sleep(2)
"#;

const ECHO_ROS2: &str = r#"
import json, rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
rclpy.init()
node = rclpy.create_node("echo")
heard = []
def hears(topic, qos):
    def on(message):
        heard.append(topic)
        print(json.dumps({"topic": topic, "data": message.data}), flush=True)
    node.create_subscription(String, "/gestalt/" + topic, on, qos)
hears("decision", 10)
hears("gesture", QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
say = node.create_publisher(String, "/gestalt/say", 10)
node.create_timer(2.0, lambda: "decision" in heard or say.publish(String(data="open")))
rclpy.spin(node)
"#;

fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples").join(name)
}

/// A program that ends with this test.
struct Program(Child);

impl Program {
    fn start(command: &mut Command) -> Self {
        let started = command.stdin(Stdio::null()).stdout(Stdio::null()).spawn();
        Self(started.unwrap_or_else(|error| panic!("{command:?}: {error}")))
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Two robots of whom one sees class 2.
async fn two_robots(swarm: &str) -> [Watched; 2] {
    let first = start(config(1, swarm, &[]), None).await;
    let second = start(config(2, swarm, first.robot.locators()), Some(ClassId(2))).await;
    assert!(first.sees_alive(1, PATIENCE).await);
    [first, second]
}

/// Waits for the decision and the gesture that the echo heard.
fn is_echoed(echo: &Process) {
    let of = |told: &[Value], topic: &str| {
        told.iter()
            .find(|said| said["topic"] == topic)
            .and_then(|said| said["data"].as_str().map(str::to_owned))
    };
    let both = |told: &[Value]| Some((of(told, "decision")?, of(told, "gesture")?));
    let (decision, gesture) = echo.wait(PATIENCE, both).expect("a decision and a gesture are heard");
    let decision: Value = serde_json::from_str(&decision).expect("a decision in JSON");
    assert_eq!((decision["label"].as_str(), gesture.as_str()), (Some("2"), "2"), "{decision}");
}

pub async fn rospy_echoes_a_decision() {
    let python = python(Need::ROSPY).expect("the trial needs it");
    let swarm = unique("rospy");
    let robots = two_robots(&swarm).await;
    let home = tempfile::tempdir().unwrap();
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let ros = |program: &str| {
        let mut command = Command::new(program);
        command.env("ROS_MASTER_URI", format!("http://127.0.0.1:{port}"));
        command.env("ROS_IP", "127.0.0.1").env("ROS_HOME", home.path());
        command
    };
    let _master = Program::start(ros("rosmaster").args(["--core", "-p", &port.to_string()]));
    // A node that asks for a parameter before there is a master ends.
    let began = Instant::now();
    while TcpStream::connect(("127.0.0.1", port)).is_err() {
        assert!(began.elapsed() < PATIENCE, "rosmaster listens");
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    let connect = format!("_connect:={}", robots[0].robot.locators()[0]);
    let _node =
        Program::start(ros(&python).arg(example("ros1.py")).args([connect, format!("_swarm:={swarm}")]));
    let echo = Process::run(ros(&python).args(["-c", ECHO_ROS1]));
    is_echoed(&echo);
    drop(echo);
    for robot in robots {
        robot.stop().await;
    }
}

pub async fn rclpy_over_dds_echoes_a_decision() {
    let python = python(Need::RCLPY).expect("the trial needs it");
    let swarm = unique("rclpy");
    let robots = two_robots(&swarm).await;
    let ros = || {
        let mut command = Command::new(&python);
        // No ROS system on this machine is likely to be in it.
        command.env("ROS_DOMAIN_ID", "97").env_remove("RMW_IMPLEMENTATION");
        command
    };
    let connect = robots[0].robot.locators()[0].clone();
    let _node = Program::start(ros().arg(example("ros2_dds.py")).args([
        "--connect",
        connect.as_str(),
        "--swarm",
        swarm.as_str(),
    ]));
    let echo = Process::run(ros().args(["-c", ECHO_ROS2]));
    is_echoed(&echo);
    drop(echo);
    for robot in robots {
        robot.stop().await;
    }
}
