//! The robots of a swarm on this machine: all in this process, or each in one of its own.

use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::{Duration, SystemTime};

use gestalt_protocol::RobotId;
use serde::Deserialize;
use serde_json::Value;
use thiserror::Error;
use tokio::io::{AsyncBufReadExt, BufReader, Lines};
use tokio::process::{Child, ChildStdout, Command};

use crate::body::{Body, BodyError};
use crate::config::Config;
use gestalt_vision::model::RobotModel;

/// How long a process may take until it listens.
const START: Duration = Duration::from_secs(30);

/// Why a robot of the swarm did not start.
#[derive(Debug, Error)]
pub enum MembersError {
    /// In this process.
    #[error("{name}: {cause}")]
    Body {
        /// Which robot.
        name: String,
        /// Why.
        cause: BodyError,
    },
    /// Its files or its process.
    #[error("{name}: {cause}")]
    Process {
        /// Which robot.
        name: String,
        /// Why.
        cause: std::io::Error,
    },
    /// Its process ended, or said nothing, before it listened.
    #[error("{0} did not start; its error message is above")]
    Silent(String),
}

/// The running robots of a swarm.
#[derive(Debug)]
pub enum Members {
    /// In this process.
    Here(Vec<Body>),
    /// Each in a process of its own; the folder holds their configurations.
    Processes(Vec<Child>, PathBuf),
}

impl Members {
    /// Starts robots in this process, each linked to those of `links` (pairs of positions) that come before it; also gives the endpoints
    /// that clients attach to.
    ///
    /// # Errors
    /// [`MembersError::Body`]; those started so far leave again.
    pub async fn here(
        configs: &[Config],
        links: &[(usize, usize)],
        model: &RobotModel,
        mut started: impl FnMut(usize),
    ) -> Result<(Self, Vec<String>), MembersError> {
        let mut bodies: Vec<Body> = Vec::new();
        let (mut endpoints, mut clients) = (Vec::<String>::new(), Vec::new());
        for (i, config) in configs.iter().enumerate() {
            let config = linked(config, i, links, &endpoints);
            let body = Body::start(
                &config,
                Some(model.clone()),
                config.trust.boot(config.robot.id, SystemTime::now()),
            )
            .await
            .map_err(|cause| MembersError::Body { name: config.name(), cause })?;
            endpoints.push(body.robot().for_robots().unwrap_or_default().to_owned());
            clients.push(body.robot().for_clients().unwrap_or_default().to_owned());
            bodies.push(body);
            started(i + 1);
        }
        Ok((Self::Here(bodies), clients))
    }

    /// Starts robots as processes of this very program, linked in the same way. `folder` receives their
    /// configurations and is removed at the end.
    ///
    /// # Errors
    /// [`MembersError::Process`], [`MembersError::Silent`]; those started so far are killed.
    pub async fn processes(
        configs: &[Config],
        links: &[(usize, usize)],
        folder: &Path,
        mut started: impl FnMut(usize),
    ) -> Result<(Self, Vec<String>), MembersError> {
        let mut children = Vec::new();
        let (mut endpoints, mut clients) = (Vec::<String>::new(), Vec::new());
        for (i, config) in configs.iter().enumerate() {
            let config = linked(config, i, links, &endpoints);
            let name = config.name();
            let (child, locators) = spawn(&config, folder)
                .await
                .map_err(|cause| MembersError::Process { name: name.clone(), cause })?
                .ok_or(MembersError::Silent(name))?;
            children.push(child);
            let at =
                |protocol: &str| locators.iter().find(|it| it.starts_with(protocol)).or(locators.first());
            endpoints.push(at("tls/").cloned().unwrap_or_default());
            clients.push(at("tcp/").cloned().unwrap_or_default());
            started(i + 1);
        }
        Ok((Self::Processes(children, folder.to_owned()), clients))
    }

    /// The robots of this process; none when each has its own.
    #[must_use]
    pub fn bodies(&self) -> &[Body] {
        match self {
            Self::Here(bodies) => bodies,
            Self::Processes(..) => &[],
        }
    }

    /// Ends all robots and waits for them.
    pub async fn stop(self) {
        match self {
            Self::Here(bodies) => {
                for body in bodies {
                    body.stop().await;
                }
            }
            Self::Processes(children, folder) => {
                for mut child in children {
                    // One that has ended already is what is wanted.
                    let _ = child.kill().await;
                }
                if let Err(error) = std::fs::remove_dir_all(&folder) {
                    tracing::warn!("cannot remove {}: {error}", folder.display());
                }
            }
        }
    }
}

/// The configuration of the robot at position `i`, told to connect to the robots before it that it is linked to.
fn linked(config: &Config, i: usize, links: &[(usize, usize)], endpoints: &[String]) -> Config {
    let neighbours =
        links.iter().filter_map(|&(a, b)| if a.max(b) == i { endpoints.get(a.min(b)) } else { None });
    let mut config = config.clone();
    let endpoints: Vec<Value> = neighbours.map(|endpoint| Value::String(endpoint.clone())).collect();
    config.zenoh.insert("connect".to_owned(), serde_json::json!({ "endpoints": endpoints }));
    config
}

/// The first line that `gestalt peer --json` prints.
#[derive(Deserialize)]
struct Started {
    locators: Vec<String>,
}

/// Starts a process and waits until it says where it listens; `None` when it does not.
async fn spawn(config: &Config, folder: &Path) -> std::io::Result<Option<(Child, Vec<String>)>> {
    let RobotId(id) = config.robot.id;
    let file = folder.join(format!("robot-{id}.json5"));
    std::fs::write(&file, serde_json::to_vec_pretty(config)?)?;
    let mut child = Command::new(std::env::current_exe()?)
        .arg("peer")
        .arg("--json")
        .arg("--config")
        .arg(&file)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .kill_on_drop(true)
        .spawn()?;
    let Some(stdout) = child.stdout.take() else { return Ok(None) };
    let mut lines = BufReader::new(stdout).lines();
    let Ok(first) = tokio::time::timeout(START, lines.next_line()).await else { return Ok(None) };
    let Some(started) = first?.and_then(|line| serde_json::from_str::<Started>(&line).ok()) else {
        return Ok(None);
    };
    tokio::spawn(drain(lines));
    Ok(Some((child, started.locators)))
}

/// Reads on, so that the process never waits for room in its pipe.
async fn drain(mut lines: Lines<BufReader<ChildStdout>>) {
    while let Ok(Some(_)) = lines.next_line().await {}
}
