//! What a robot tells of itself.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::{RobotId, RoundId};

/// A robot's account of itself, JSON: the reply to a query on `robot/<id>/status`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// Which robot.
    pub robot: RobotId,
    /// Its name for people.
    pub name: String,
    /// How often it has started.
    pub boot: u32,
    /// Its camera, in words: `rendered`, `video hand.mp4`, `none`, or what is wrong with it.
    pub camera: String,
    /// Its classifier, in words; `none` when it has none.
    pub model: String,
    /// The labels of the gestures it can tell, by class.
    pub vocabulary: Vec<String>,
    /// The robots it is directly linked to.
    pub neighbours: Vec<RobotId>,
    /// The robots it knows to be alive, itself included.
    pub alive: Vec<RobotId>,
    /// The newest round it knows.
    pub round: Option<RoundId>,
    /// Whether that round is open.
    pub open: bool,
    /// Counters since its start, by name: messages, bytes, frames, and everything refused, by cause.
    pub counters: BTreeMap<String, u64>,
    /// The latest errors, newest last, at most sixteen.
    pub errors: Vec<Reported>,
}

/// An error as the status reports it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Reported {
    /// Milliseconds since the robot's start.
    pub at_ms: u64,
    /// Cause and mend.
    pub what: String,
}
