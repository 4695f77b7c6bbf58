//! What can go wrong between Gestalt and ROS.

use thiserror::Error;

/// Why a node does not run.
#[derive(Debug, Error)]
pub enum RosError {
    /// Nobody answers.
    #[error(
        "no ROS router answers at {at}: start `ros2 run rmw_zenoh_cpp rmw_zenohd`, or name another router ({cause})"
    )]
    Router {
        /// Where it was looked for.
        at: String,
        /// What Zenoh says.
        cause: String,
    },
    /// The node is closed, or Zenoh cannot take what it was given.
    #[error("the ROS node cannot {what}: {cause}")]
    Zenoh {
        /// What it was to do.
        what: String,
        /// What Zenoh says.
        cause: String,
    },
    /// A name that ROS does not allow.
    #[error(transparent)]
    Name(#[from] NameError),
}

impl RosError {
    pub(crate) fn zenoh(what: impl Into<String>, cause: impl ToString) -> Self {
        Self::Zenoh { what: what.into(), cause: cause.to_string() }
    }
}

/// A name that ROS does not allow.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error(
    "'{0}' is no name in ROS: parts between slashes begin with a letter or _, then letters, digits and _"
)]
pub struct NameError(pub String);
