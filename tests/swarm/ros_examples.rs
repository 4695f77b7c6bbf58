//! The examples for ROS 1 and for ROS 2 over DDS, each beside a node of theirs that asks for a round and hears what came of it.

use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use gestalt_desk::Word;
use gestalt_protocol::{ClassId, RobotId, RoundId};
use gestalt_tests::{Process, Watched, config, start, unique};
use gestalt_trials::{Need, python};
use serde_json::{Value, json};

const PATIENCE: Duration = Duration::from_secs(60);

/// Prints what it hears as a line of JSON each, and says `open` until it has heard a decision; before it what is no word.
const ECHO_ROS1: &str = r#"
import json, rospy
from std_msgs.msg import String
rospy.init_node("echo")
heard = []
def hears(topic):
    def on(message):
        heard.append(topic)
        # Each topic has a thread: one write a line, so that no line breaks into another.
        print(json.dumps({"topic": topic, "data": message.data}) + "\n", end="", flush=True)
    rospy.Subscriber("/gestalt/" + topic, String, on)
hears("decision")
hears("gesture")
say = rospy.Publisher("/gestalt/say", String, queue_size=10)
while not rospy.is_shutdown():
    if "decision" not in heard:
        for word in ["", "was", "right", "open"]:
            say.publish(word)
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
def ask():
    if "decision" not in heard:
        for word in ["", "was", "right", "open"]:
            say.publish(String(data=word))
node.create_timer(2.0, ask)
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

/// Prints what each word comes to, as a line of JSON each: a message, or why it is none. Its arguments are the examples' folder and the words.
const READ: &str = r#"
import json, sys
sys.path.insert(0, sys.argv[1])
from ros_words import instruction
for case in json.loads(sys.argv[2]):
    try:
        print(json.dumps(instruction(*case)))
    except ValueError as refused:
        print(json.dumps(str(refused)))
"#;

/// What the examples make of words, each of a text, the last decision, and the round last spoken of.
fn read(cases: &Value) -> Vec<Value> {
    run_python(READ, cases)
}

/// What a script prints, a line of JSON each; its arguments are the examples' folder and those cases.
fn run_python(script: &str, cases: &Value) -> Vec<Value> {
    let python = python(&["json"]).expect("a Python");
    let ran = Command::new(python)
        .args(["-B", "-c", script])
        .arg(example(""))
        .arg(cases.to_string())
        .output()
        .unwrap();
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    String::from_utf8(ran.stdout).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

pub fn words_of_ros_mean_what_they_mean_to_the_program() {
    let [before, last] = [4, 5].map(|counter| RoundId { counter, opener: RobotId(2), life: 1_067_057_607 });
    let decided = |class: Option<u32>| json!({"round": last, "class": class, "label": null});
    let texts = [
        "open",
        " was  three ",
        "was big circle",
        "was circle (ana)",
        "was 3",
        "right",
        "wrong",
        "undo",
        "retract",
        "",
        "  ",
        "was",
        "right now",
        "undo it",
        "dance",
    ];
    let cases: Vec<Value> = texts.iter().map(|text| json!([text, decided(Some(3)), null])).collect();
    for (text, came_to) in texts.iter().zip(read(&json!(cases))) {
        let words: Vec<&str> = text.split_whitespace().collect();
        let meant = Word::read(&words).ok().map(|word| match word {
            Word::Open => json!({"say": "open"}),
            word => json!(word.about(last, Some(ClassId(3))).unwrap().expect("a word about a round")),
        });
        let is_refusal = came_to.as_str().is_some_and(|why| why.contains("say open, was GESTURE, right"));
        assert!(
            meant.as_ref().map_or(is_refusal, |meant| *meant == came_to),
            "'{text}': {came_to}, not {meant:?}"
        );
    }

    let cases = json!([
        ["open", null, null],
        ["was three", null, null],
        ["undo", null, null],
        ["right", decided(None), null],
        ["wrong", decided(None), null],
        ["undo", decided(None), before],
        ["was three", decided(None), before],
    ]);
    let [open, early, nothing, right, wrong, undo, was] = &read(&cases)[..] else { panic!("one line each") };
    assert_eq!(*open, json!({"say": "open"}));
    for refused in [early, nothing] {
        assert!(refused.as_str().is_some_and(|why| why.contains("say 'open'")), "{refused}");
    }
    for refused in [right, wrong] {
        assert!(refused.as_str().is_some_and(|why| why.contains("say 'was GESTURE'")), "{refused}");
    }
    assert_eq!(*undo, json!({"say": "retract", "round": before}), "of what was said last");
    assert_eq!(*was, json!({"say": "was", "round": last, "class": "three"}));
}

/// Prints whether each decision's gesture is news, and of which count the last one is.
const HEAR: &str = r#"
import json, sys
sys.path.insert(0, sys.argv[1])
from ros_words import Last
last = Last()
for decision in json.loads(sys.argv[2]):
    print(json.dumps([last.hear(decision), last.decision["round"]["counter"]]))
"#;

pub fn examples_for_ros_take_no_late_decision_for_the_last() {
    let said = |counter: u32, life: u32, label: &str, is_final: bool| json!({"round": {"counter": counter, "opener": 1, "life": life}, "class": 1, "label": label, "final": is_final});
    let steps = [
        (said(5, 7, "five", false), json!([true, 5])),
        (said(5, 7, "five", true), json!([false, 5])),
        (said(5, 7, "four", false), json!([false, 5])),
        (said(6, 7, "five", true), json!([true, 6])),
        (said(5, 7, "four", true), json!([false, 6])),
        // Started again, and the old ones once more.
        (said(1, 8, "one", true), json!([true, 1])),
        (said(1, 8, "one", true), json!([false, 1])),
        (said(2, 8, "two", true), json!([true, 2])),
        // And again, under the same count.
        (said(2, 9, "two", true), json!([true, 2])),
    ];
    let said: Vec<&Value> = steps.iter().map(|(said, _)| said).collect();
    let ran = run_python(HEAR, &json!(said));
    for ((said, expected), came_to) in steps.iter().zip(ran) {
        assert_eq!(came_to, *expected, "{said}");
    }
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
        command.env("ROS_IP", "127.0.0.1").env("ROS_HOME", home.path()).env("PYTHONDONTWRITEBYTECODE", "1");
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
        command.env("PYTHONDONTWRITEBYTECODE", "1");
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
