//! What goes wrong in a scenario.

use std::time::Duration;

use gestalt_protocol::RobotId;
use serde::{Deserialize, Serialize};

use crate::emulation::network::Presence;

/// One thing that happens to the swarm, if it can: a random network may lack the link.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fault {
    /// When.
    #[serde(with = "humantime_serde")]
    pub at: Duration,
    /// What.
    pub event: Event,
}

/// What can happen to a swarm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Event {
    /// The link between two robots falls silent.
    Cut(RobotId, RobotId),
    /// That link works again.
    Heal(RobotId, RobotId),
    /// A robot is gone, with all it knew.
    Kill(RobotId),
    /// It starts again, knowing nothing.
    Restart(RobotId),
    /// A robot stops in the midst of things; what is sent to it waits.
    Freeze(RobotId),
    /// It goes on.
    Thaw(RobotId),
}

/// Links that fail and heal at random, but for those that `faults` cut, as long as they are; at the end all that failed are healed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Churn {
    /// From when.
    #[serde(with = "humantime_serde")]
    pub from: Duration,
    /// Until when: before the end of the run.
    #[serde(with = "humantime_serde")]
    pub until: Duration,
    /// The time between two changes: each cuts a link or heals one, whichever link the chance falls on.
    #[serde(with = "humantime_serde")]
    pub period: Duration,
}

impl Event {
    /// The robots it names.
    pub(super) fn robots(self) -> Vec<RobotId> {
        match self {
            Self::Cut(a, b) | Self::Heal(a, b) => vec![a, b],
            Self::Kill(robot) | Self::Restart(robot) | Self::Freeze(robot) | Self::Thaw(robot) => vec![robot],
        }
    }

    /// The robot that it befalls, and how that is from then on; nothing where it befalls a link.
    pub(in crate::emulation) fn makes(self) -> Option<(RobotId, Presence)> {
        match self {
            Self::Cut(..) | Self::Heal(..) => None,
            Self::Kill(robot) => Some((robot, Presence::Down)),
            Self::Restart(robot) | Self::Thaw(robot) => Some((robot, Presence::Up)),
            Self::Freeze(robot) => Some((robot, Presence::Frozen)),
        }
    }

    /// Whether it can befall a robot that is so.
    pub(in crate::emulation) fn can_befall(self, presence: Presence) -> bool {
        match self {
            Self::Cut(..) | Self::Heal(..) => false,
            Self::Kill(_) => presence != Presence::Down,
            Self::Restart(_) => presence == Presence::Down,
            Self::Freeze(_) => presence == Presence::Up,
            Self::Thaw(_) => presence == Presence::Frozen,
        }
    }
}
