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
    /// What it has learned from; absent for a robot that does not learn.
    pub learning: Option<Learning>,
    /// Counters since its start, by name: messages, bytes, frames, and everything refused, by cause.
    pub counters: BTreeMap<String, u64>,
    /// The latest errors, newest last, at most sixteen.
    pub errors: Vec<Reported>,
}

/// What a robot has learned from.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Learning {
    /// The feature space of its samples, 16 hexadecimal digits.
    pub space: String,
    /// T: how many samples it may hold.
    pub capacity: usize,
    /// Its own samples that it has not shared, by class.
    pub personal: Vec<usize>,
    /// Its own samples that it has shared, by class.
    pub shared: Vec<usize>,
    /// The samples it has from others, by class.
    pub external: Vec<usize>,
    /// Samples kept aside, until it is known which gesture they show.
    pub aside: usize,
    /// A digest of the common knowledge it holds, shared and external, ids and classes, 16 hexadecimal digits:
    /// equal digests mean equal knowledge.
    pub common: String,
    /// Rounds of which it knows what an instructor said.
    pub lessons: usize,
    /// Where it keeps all this: a path, `none`, or what is wrong with it.
    pub memory: String,
    /// How often it has trained.
    pub trainings: u64,
}

/// An error as the status reports it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Reported {
    /// Milliseconds since the robot's start.
    pub at_ms: u64,
    /// Cause and mend.
    pub what: String,
}
