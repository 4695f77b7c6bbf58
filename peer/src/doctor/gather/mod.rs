//! Gathers what the rules are about: on this machine, and from the robots that answer.

#[cfg(feature = "opencv")]
mod eye;
mod files;
mod network;
mod statuses;

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use gestalt_link::rounds_in_words;
use gestalt_protocol::{Camera, RobotId, Status};
use gestalt_trust::Roster;
use tokio::task::spawn_blocking;

use super::robot::{RobotFacts, has};
use super::swarm::{RosterFacts, SwarmFacts};
use crate::config::{Config, ROSTER_FILE};

/// What is to be looked at.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The file that describes the robot; `None` when only the way to a swarm is described.
    pub file: Option<String>,
    /// Why it cannot be read at all.
    pub unreadable: Option<String>,
    /// What it says, as far as it can be understood.
    pub config: Option<Config>,
    /// What cannot be understood.
    pub problems: Vec<String>,
}

/// Looks at the robot that is described, and at its swarm, at the same time. Takes some three seconds; what hangs is given up.
pub async fn gather(subject: &Subject) -> (RobotFacts, Option<SwarmFacts>) {
    let Some(config) = &subject.config else {
        let facts = RobotFacts {
            described: subject.file.clone(),
            unreadable: subject.unreadable.clone(),
            problems: subject.problems.clone(),
            ..RobotFacts::new(RobotId(0), since_1970())
        };
        return (facts, None);
    };
    let ports = network::ports(config);
    let (home, seeing) = statuses::home(config, &ports).await.unzip();
    let running = home.is_some();
    let camera = camera(subject, config, seeing.flatten());
    let swarm = statuses::ask_around(config, home);
    // A slow disk holds nobody up.
    let (files, described) = (subject.clone(), config.clone());
    let files = spawn_blocking(move || files::look(&files, &described, running));
    let (camera, mut swarm, files) = tokio::join!(camera, swarm, files);
    let (mut robot, mine) = files.unwrap_or_else(|error| {
        let unreadable = Some(format!("looking at its files panicked, which is a bug: {error}"));
        let facts = RobotFacts::new(config.robot.id, since_1970());
        (RobotFacts { described: subject.file.clone(), unreadable, ..facts }, account(config))
    });
    robot.camera = camera;
    robot.connects = !network::endpoints(config, "connect").is_empty();
    let answer = swarm.parts.iter().flatten().find(|answer| answer.status.robot == robot.id);
    // One that holds its memory and answers is the one whose memory it is, wherever it listens.
    let held = robot.memory.as_ref().is_some_and(|memory| memory.held);
    robot.running = running || held && answer.is_some();
    if let (Some(camera), Some(answer)) = (&mut robot.camera, answer.filter(|_| robot.running)) {
        camera.held |= has(&answer.status.camera, &camera.source);
    }
    if subject.file.is_some() {
        robot.ports = if robot.running { Vec::new() } else { ports };
        swarm.mine = Some(mine);
    }
    swarm.running = robot.running;
    swarm.roster = roster(config);
    // Whoever is heard is proof enough.
    if config.links.scouting.enabled && swarm.parts.is_empty() {
        robot.multicast = Some(network::multicast(&config.links.scouting));
    }
    (robot, Some(swarm))
}

fn since_1970() -> Duration {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()
}

/// What the robot would say of itself, but for its model.
fn account(config: &Config) -> Status {
    Status {
        sealed: config.trust.keys.is_some(),
        rounds: rounds_in_words(&config.rounds),
        ..Status::new(config.robot.id, config.name(), 0)
    }
}

fn roster(config: &Config) -> Option<RosterFacts> {
    let roster: Roster = Roster::read(&config.trust.keys.as_ref()?.join(ROSTER_FILE)).ok()?;
    let members = roster.members();
    Some(RosterFacts { epoch: members.epoch, robots: members.robots.keys().copied().collect() })
}

#[cfg(feature = "opencv")]
async fn camera(
    subject: &Subject,
    config: &Config,
    said: Option<Camera>,
) -> Option<super::robot::CameraFacts> {
    subject.file.as_ref()?;
    eye::look(config, said.as_ref()).await
}

/// Without OpenCV no robot has a camera.
#[cfg(not(feature = "opencv"))]
async fn camera(_: &Subject, _: &Config, _: Option<Camera>) -> Option<super::robot::CameraFacts> {
    None
}
