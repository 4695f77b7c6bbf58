//! What is said again when a recording is played.

use gestalt_protocol::{RobotId, Topic};
use serde_json::Value;

use crate::kind::Kind;
use crate::reader::Recorded;
use crate::view::{Alive, wire};

/// One thing to be said again.
#[derive(Clone, Debug, PartialEq)]
pub enum Line {
    /// These bytes, under the key of that topic.
    Say(Topic, Vec<u8>),
    /// A robot comes, or leaves.
    Present(RobotId, bool),
}

impl Line {
    /// What a recorded message says; `None` for what is the recorder's own, and for pictures, which wait for nobody's answer.
    #[must_use]
    pub fn of(recorded: &Recorded<'_>) -> Option<Self> {
        if recorded.kind.is_recorders() || matches!(recorded.kind, Kind::Frame | Kind::Unreadable) {
            return None;
        }
        let topic = recorded.keys()?.parse(recorded.channel.strip_prefix('/')?)?;
        let view: Value = serde_json::from_slice(recorded.data).ok()?;
        match topic {
            Topic::Alive(robot) => {
                let Alive { alive, .. } = serde_json::from_value(view).ok()?;
                Some(Self::Present(robot, alive))
            }
            topic => Some(Self::Say(topic.clone(), wire(&topic, &view)?)),
        }
    }
}
