//! `gestalt ros`: a swarm as a node of a ROS 2 system.

use std::collections::BTreeMap;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use gestalt_desk::Word;
use gestalt_link::{Client, Heard};
use gestalt_protocol::{
    Announcement, CameraState, Instruction, InstructorId, MAX_ROBOTS, RobotId, RoundId, Status,
};
use gestalt_ros::message::{Diagnostic, Diagnostics, Header, Level, Text};
use gestalt_ros::{Node, NodeConfig, NodeName, Publisher, Qos, Received, RosError, Subscription};
use tokio::sync::mpsc;
use tokio::time::MissedTickBehavior;

use super::config_args::ConfigArgs;
use super::show::{self, clean};
use super::{Failure, interrupted};

/// Show a swarm to a ROS 2 system that runs rmw_zenoh, and take an instructor's words from it
///
/// Publishes `~/gesture` (std_msgs/String: the last gesture decided, latched), `~/decision` (std_msgs/String: each decision as
/// JSON), `~/answer` (std_msgs/String: what became of a word) and `/diagnostics` (diagnostic_msgs/DiagnosticArray: each robot).
/// Listens to `~/say` (std_msgs/String: `open`, `was three`, `right`, `wrong`, `undo`, as `gestalt teach`). Needs no ROS
/// installation.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt ros
  gestalt ros -e tcp/192.168.1.5:7448 --router tcp/192.168.1.2:7447 --domain 7")]
pub struct Args {
    #[command(flatten)]
    config: ConfigArgs,

    /// Zenoh router of the ROS system (rmw_zenohd)
    #[arg(long, value_name = "ENDPOINT", default_value = "tcp/localhost:7447")]
    router: String,

    /// ROS domain [default: ROS_DOMAIN_ID, or else 0]
    #[arg(long, value_name = "N")]
    domain: Option<u32>,

    /// Node name
    #[arg(long, value_name = "NAME", default_value = "gestalt")]
    node: String,

    /// Node namespace
    #[arg(long, value_name = "NAMESPACE", default_value = "/")]
    namespace: String,

    /// Write no type hashes, as ROS 2 Humble does
    #[arg(long)]
    humble: bool,

    /// Instructor name under which words from ROS are said
    #[arg(long, default_value = "ros")]
    instructor: InstructorId,
}

/// How often robots are asked how they are.
const DIAGNOSED_EVERY: Duration = Duration::from_secs(1);

/// How many words wait for the swarm's answer to an earlier one.
const MAX_WORDS: usize = 16;

/// No word is longer, in bytes.
const MAX_WORD: usize = 256;

/// How long the swarm may take to say that somebody may open no round: nothing else answers that.
const REFUSED_WITHIN: Duration = Duration::from_millis(500);

/// How long the swarm may take to answer a word.
const ANSWERED_WITHIN: Duration = Duration::from_secs(15);

/// Runs the verb.
///
/// # Errors
/// When no robot is reached, no ROS router answers, or a session breaks.
pub fn run(args: &Args) -> Result<(), Failure> {
    let (swarm, link) = args.config.client()?;
    let name = NodeName::new(&args.namespace, &args.node)?;
    let domain = match args.domain {
        Some(domain) => domain,
        None => domain_of_environment()?,
    };
    let config = NodeConfig {
        router: Some(args.router.clone()),
        type_hashes: !args.humble,
        ..NodeConfig::new(name, domain)
    };
    super::runtime()?.block_on(async {
        let node = tokio::task::spawn_blocking(move || Node::open(config)).await??;
        let client = Client::open(&swarm, &link).await?;
        let (mut bridge, words) = Bridge::open(&node, client, args.instructor.clone())?;
        super::say(&format!("the swarm {swarm} is {} in ROS domain {}\n", node.name(), domain))?;
        tokio::select! {
            () = interrupted() => Ok(()),
            ended = bridge.run(words) => ended,
        }
    })
}

/// As ROS's own nodes take it.
fn domain_of_environment() -> Result<u32, Failure> {
    match std::env::var("ROS_DOMAIN_ID") {
        Ok(number) if !number.is_empty() => Ok(number.parse().map_err(|_| {
            format!("ROS_DOMAIN_ID is '{}': set it to a number, or give --domain", clean(&number))
        })?),
        _ => Ok(0),
    }
}

/// The two ends, and what goes between them.
struct Bridge {
    client: Client,
    instructor: InstructorId,
    gesture: Publisher<Text>,
    decision: Publisher<Text>,
    answer: Publisher<Text>,
    diagnostics: Publisher<Diagnostics>,
    _say: Subscription,
    /// The robots that have answered, with their names: who does not any more is stale.
    robots: BTreeMap<RobotId, String>,
}

impl Bridge {
    fn open(
        node: &Node,
        client: Client,
        instructor: InstructorId,
    ) -> Result<(Self, mpsc::Receiver<String>), RosError> {
        let (words, said) = mpsc::channel(MAX_WORDS);
        let say = node.subscription("~/say", Qos::reliable(10), move |heard: Received<Text>| match heard
            .message
        {
            Ok(Text(word)) if word.len() > MAX_WORD => {
                tracing::warn!("a word of {} bytes came from ROS: at most {MAX_WORD} are read", word.len());
            }
            Ok(Text(word)) => {
                if words.try_send(word).is_err() {
                    tracing::warn!("a word from ROS is lost: {MAX_WORDS} are waiting for answers");
                }
            }
            Err(error) => tracing::warn!("what came from ROS is no text: {error}"),
        })?;
        let bridge = Self {
            client,
            instructor,
            gesture: node.publisher("~/gesture", Qos::latched())?,
            decision: node.publisher("~/decision", Qos::reliable(10))?,
            answer: node.publisher("~/answer", Qos::reliable(10))?,
            diagnostics: node.publisher("/diagnostics", Qos::reliable(10))?,
            _say: say,
            robots: BTreeMap::new(),
        };
        Ok((bridge, said))
    }

    /// Carries news to ROS and words to the swarm, until a session ends.
    async fn run(&mut self, mut words: mpsc::Receiver<String>) -> Result<(), Failure> {
        let Self { client, instructor, gesture, decision, answer, diagnostics, robots, _say } = self;
        let client = &*client;
        let mut news = client.news().await?;
        let (newest, last) = tokio::sync::watch::channel(client.last_decision(super::ANSWER).await?);
        let publish = |announced: &Announcement| -> Result<(), Failure> {
            Ok(decision.publish(&Text(serde_json::to_string(announced)?), clock())?)
        };
        let call = |announced: &Announcement| -> Result<(), Failure> {
            let mut label = announced.label.iter();
            Ok(label.try_for_each(|label| gesture.publish(&Text(label.clone()), clock()))?)
        };
        // Whoever subscribes now gets what was decided last.
        let known = last.borrow().clone();
        known.iter().for_each(|last| news.know(last.decision.round));
        known.iter().try_for_each(|last| publish(last).and_then(|()| call(last)))?;
        let decisions = async {
            while let Some(heard) = news.next().await {
                let Heard::Decided(announced) = heard else { continue };
                publish(&announced)?;
                if !news.is_newest(announced.decision.round) {
                    continue;
                }
                let of_this =
                    |known: &Announcement| known.decision.round.may_merge(&announced.decision.round);
                let known = newest.borrow().clone().filter(of_this);
                match known {
                    // The same again, less sure.
                    Some(known) if known.decision.is_final && !announced.decision.is_final => continue,
                    Some(known) if known.label == announced.label => {}
                    _ => call(&announced)?,
                }
                newest.send_replace(Some(announced));
            }
            Err::<(), Failure>("the swarm's Zenoh session was closed".into())
        };
        let taught = async {
            let mut spoken = None;
            while let Some(word) = words.recv().await {
                let last = last.borrow().clone();
                let words = match said(client, instructor, &word, last, &mut spoken).await {
                    Ok(words) => words,
                    Err(error) => error.to_string(),
                };
                answer.publish(&Text(clean(&words)), clock())?;
            }
            Ok::<(), Failure>(())
        };
        tokio::try_join!(decisions, taught, diagnose(client, diagnostics, robots)).map(drop)
    }
}

/// Says how all robots do, again and again.
async fn diagnose(
    client: &Client,
    to: &Publisher<Diagnostics>,
    robots: &mut BTreeMap<RobotId, String>,
) -> Result<(), Failure> {
    let mut ticks = tokio::time::interval(DIAGNOSED_EVERY);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        ticks.tick().await;
        let status = report(&client.statuses(super::ANSWER).await?, robots);
        let clock = clock();
        to.publish(&Diagnostics { header: header(clock), status }, clock)?;
    }
}

/// Says a word to the swarm, and what became of it. What is withdrawn is what was said last, of `spoken`.
async fn said(
    client: &Client,
    instructor: &InstructorId,
    word: &str,
    last: Option<Announcement>,
    spoken: &mut Option<RoundId>,
) -> Result<String, Failure> {
    let words: Vec<&str> = word.split_whitespace().collect();
    let word = Word::read(&words)?;
    if word == Word::Open {
        let answer = client.teach(instructor, &Instruction::Open, REFUSED_WITHIN).await?;
        let refused = answer.filter(|answer| answer.outcome.is_refusal());
        return Ok(
            refused.map_or("asked for a round".to_owned(), |answer| answer.outcome.describe().to_owned())
        );
    }
    let instruction = match word.of_names(None) {
        Some(instruction) => instruction,
        None => {
            let last = last.map(|last| (last.decision.round, last.decision.class));
            let spoken = spoken.filter(|_| word == Word::Undo).map(|round| (round, None));
            let (round, decided) = spoken.or(last).ok_or("no round has been decided yet: say 'open'")?;
            word.about(round, decided)?.ok_or(
                "this is a word for a keyboard: use open, was GESTURE, class NUMBER, right, wrong, undo or new LABEL",
            )?
        }
    };
    *spoken = instruction.round().or(*spoken);
    let answer = client.teach(instructor, &instruction, ANSWERED_WITHIN).await?;
    let answer = answer.ok_or_else(|| super::teach::unanswered("answer", ANSWERED_WITHIN))?;
    Ok(show::answer(&answer, &show::Names::default()))
}

/// The time since 1970; none of a machine that lives before.
fn clock() -> Duration {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()
}

fn header(clock: Duration) -> Header {
    let seconds = i32::try_from(clock.as_secs()).unwrap_or(i32::MAX);
    Header { seconds, nanoseconds: clock.subsec_nanos(), frame: String::new() }
}

/// How each robot does; `known` are those that have answered before, and is brought up to date.
fn report(statuses: &[Status], known: &mut BTreeMap<RobotId, String>) -> Vec<Diagnostic> {
    let mut parts: Vec<Diagnostic> = statuses.iter().map(diagnostic).collect();
    for (robot, name) in
        known.iter().filter(|(robot, _)| !statuses.iter().any(|status| status.robot == **robot))
    {
        parts.push(Diagnostic {
            level: Level::Stale,
            name: titled(name),
            message: "does not answer".to_owned(),
            hardware_id: format!("robot {robot}"),
            values: Vec::new(),
        });
    }
    for status in statuses {
        if known.len() < MAX_ROBOTS || known.contains_key(&status.robot) {
            known.insert(status.robot, status.name.clone());
        }
    }
    parts
}

fn titled(name: &str) -> String {
    format!("gestalt: {}", clean(name))
}

fn diagnostic(status: &Status) -> Diagnostic {
    let camera = &status.camera;
    let (level, message) = match camera.state {
        CameraState::Frozen | CameraState::Failing => (Level::Error, camera.trouble.clone()),
        CameraState::Ended => (Level::Warn, "its camera has come to its end".to_owned()),
        CameraState::Opening => (Level::Ok, "its camera is being opened".to_owned()),
        CameraState::None => (Level::Ok, "no camera".to_owned()),
        CameraState::Live => (Level::Ok, "sees".to_owned()),
    };
    let mut values = vec![
        ("camera", camera.source.clone()),
        ("frames per second", format!("{:.1}", camera.fps)),
        ("delay in ms", format!("{:.0}", camera.delay_ms)),
        ("model", status.model.clone()),
        ("round", status.round.map_or_else(String::new, |round| round.counter.to_string())),
        ("linked to", show::robots(&status.neighbours)),
        ("alive", status.alive.len().to_string()),
    ];
    if let Some(opinion) = &camera.opinion {
        values.push(("opinion", format!("{} ({:.2})", opinion.gesture, opinion.probability)));
    }
    if let Some(learning) = &status.learning {
        let held: usize =
            [&learning.personal, &learning.shared, &learning.external].into_iter().flatten().sum();
        values.push(("samples", held.to_string()));
    }
    if let Some(error) = status.errors.last() {
        values.push(("last error", error.what.clone()));
    }
    Diagnostic {
        level,
        name: titled(&status.name),
        message: clean(&message),
        hardware_id: format!("robot {}", status.robot),
        values: values.into_iter().map(|(name, value)| (name.to_owned(), clean(&value))).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(id: u32, state: CameraState) -> Status {
        let mut status = Status::new(RobotId(id), format!("robot-{id}"), 1);
        status.camera.state = state;
        status.camera.trouble = "frozen: check its cable".to_owned();
        status
    }

    #[test]
    fn a_frozen_camera_is_an_error_and_a_silent_robot_is_stale() {
        let mut known = BTreeMap::new();
        let both = [status(1, CameraState::Live), status(2, CameraState::Frozen)];
        let parts = report(&both, &mut known);
        assert_eq!(parts.iter().map(|part| part.level).collect::<Vec<_>>(), [Level::Ok, Level::Error]);
        assert_eq!(parts[1].message, "frozen: check its cable");
        let parts = report(&both[..1], &mut known);
        assert_eq!(parts.iter().map(|part| part.level).collect::<Vec<_>>(), [Level::Ok, Level::Stale]);
        assert_eq!((parts[1].name.as_str(), parts[1].hardware_id.as_str()), ("gestalt: robot-2", "robot 2"));
    }

    #[test]
    fn what_robots_say_of_themselves_stays_text() {
        let mut told = status(1, CameraState::Live);
        told.name = "a\x1b[2Jb".to_owned();
        assert_eq!(diagnostic(&told).name, "gestalt: a\\u{1b}[2Jb");
    }
}
