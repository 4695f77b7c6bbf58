//! What can go wrong when a robot is linked to others.

use gestalt_protocol::SwarmNameError;
use gestalt_strategies::mind::MindConfigError;
use gestalt_strategies::{LearnError, LearningError};
use thiserror::Error;

use crate::memory::StoreError;
use crate::seal::SealError;

/// A robot that could not be linked. Nothing is left running.
#[derive(Debug, Error)]
pub enum LinkError {
    /// The configuration holds something that Zenoh or a swarm cannot take.
    #[error("{key}: {cause}")]
    Config {
        /// The key, dotted, as the user wrote it.
        key: String,
        /// What is wrong with it, and the mend.
        cause: String,
    },
    /// The parameters of the mind do not fit together.
    #[error(transparent)]
    Mind(#[from] MindConfigError),
    /// The robot cannot learn as it is told to.
    #[error("learning: {0}")]
    Learning(#[from] LearningError),
    /// The classifier to learn on is none to build on.
    #[error("learning: {0}")]
    Learner(#[from] LearnError),
    /// The robot's memory is damaged, not its own, another program's file, or in use. A disk that fails is no error here.
    #[error(transparent)]
    Memory(#[from] StoreError),
    /// The machine has no room for another thread.
    #[error("cannot start a thread: {0}")]
    Thread(#[from] std::io::Error),
    /// The name of the swarm cannot stand in a key.
    #[error(transparent)]
    Swarm(#[from] SwarmNameError),
    /// Zenoh cannot run on a runtime with one thread.
    #[error(
        "Zenoh needs Tokio's multi-thread runtime: start the robot from #[tokio::main] or a multi_thread test"
    )]
    Runtime,
    /// The session could not start: most often an endpoint that another process holds.
    #[error(
        "cannot listen on {listen}: {cause}: free the port, choose another, or take port 0 for a free one"
    )]
    Start {
        /// The endpoints it should have listened on.
        listen: String,
        /// Zenoh's reason.
        cause: String,
    },
    /// The seal does not fit the robot.
    #[error(transparent)]
    Seal(#[from] SealError),
    /// A robot that is there already cannot be a guest.
    #[error("robot {0} is here already: give each robot an id of its own")]
    Guest(gestalt_protocol::RobotId),
    /// A client reached no robot. Zenoh itself says no more than that time has passed.
    #[error(
        "no robot of the swarm \"{swarm}\" was reached ({cause}): start one; or name one that runs: -e tcp/ITS-ADDRESS:7447, or tls/… and \
         --keys where the swarm is sealed; 'gestalt doctor' says what is in the way"
    )]
    Unreached {
        /// Its name.
        swarm: String,
        /// What is known of why.
        cause: String,
    },
    /// Zenoh refused to build the session or one of its subscriptions.
    #[error("cannot open the Zenoh session: {0}")]
    Open(String),
}

/// What Zenoh says, without the places in its source that it says it at.
pub(super) fn reason(cause: &(dyn std::error::Error + Send + Sync)) -> String {
    let mut said = cause.to_string();
    // Endpoints come as their kind, written for programmers.
    while let Some(kind) = said.find("Single(") {
        said.replace_range(kind..kind + "Single(".len(), "");
        if let Some(end) = said[kind..].find(')') {
            said.remove(kind + end);
        }
    }
    let words = said.split(' ').collect::<Vec<_>>();
    let place = |i: usize| words.get(i).is_some_and(|word| word.contains(".rs:"));
    let is_left_out = |i: usize| place(i) || words[i] == "at" && place(i + 1);
    let mut kept = String::new();
    for (i, word) in words.iter().enumerate() {
        if !is_left_out(i) {
            kept += if kept.is_empty() { "" } else { " " };
            kept += word;
        } else if word.ends_with(']') {
            // It closes what is kept.
            kept.push(']');
        }
    }
    kept
}

impl LinkError {
    pub(super) fn config(path: &str, cause: &(dyn std::error::Error + Send + Sync)) -> Self {
        Self::Config {
            key: format!("zenoh.{}", path.replace('/', ".")),
            cause: format!(
                "{}: see Zenoh's DEFAULT_CONFIG.json5 for the keys and their values",
                reason(cause)
            ),
        }
    }

    pub(super) fn open(cause: &(dyn std::error::Error + Send + Sync)) -> Self {
        Self::Open(reason(cause))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zenohs_reason_comes_without_the_places_in_its_source() {
        let zenoh = std::io::Error::other("no route at /home/a/zenoh-1/src/lib.rs:62. at all at b/tcp.rs:3.");
        assert_eq!(reason(&zenoh), "no route at all");
        let bound = std::io::Error::other("no port: [127.0.0.1:1: in use (os error 98) at /a/tcp.rs:140.]");
        assert_eq!(reason(&bound), "no port: [127.0.0.1:1: in use (os error 98)]");
        let dialled = std::io::Error::other("none of [Single(tcp/a:1), Single(tcp/b:1)]. Timeout!");
        assert_eq!(reason(&dialled), "none of [tcp/a:1, tcp/b:1]. Timeout!");
    }
}
