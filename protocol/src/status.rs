//! What a robot tells of itself.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::bounded;
use crate::id::{ClassId, RobotId, RoundId};
use crate::limits::{MAX_CLASSES, PROTOCOL_VERSION};

/// A robot's account of itself, JSON: the reply to a query on `robot/<id>/status`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// Which robot.
    pub robot: RobotId,
    /// Its name for people.
    pub name: String,
    /// How often it has started.
    pub boot: u32,
    /// What it sees with, and how that goes.
    pub camera: Camera,
    /// Its classifier, in words; `none` when it has none.
    pub model: String,
    /// Whether it signs what it says and believes members of the swarm alone.
    pub sealed: bool,
    /// The labels of the gestures it can tell, by class.
    #[serde(deserialize_with = "bounded::vec::<_, _, MAX_CLASSES>")]
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
    pub learning: Option<LearningStatus>,
    /// Counters since its start, by name: messages, bytes, frames, and everything refused, by cause.
    pub counters: BTreeMap<String, u64>,
    /// The latest errors, newest last, at most sixteen.
    pub errors: Vec<Reported>,
    /// The version of the wire that it speaks; 0 from a release that did not say.
    #[serde(default)]
    pub protocol: u8,
    /// Its Zenoh session, hexadecimal: tells two robots of one id apart. Empty from a release that did not say.
    #[serde(default)]
    pub session: String,
    /// Its clock when it answered, in milliseconds since 1970.
    #[serde(default)]
    pub clock_ms: Option<u64>,
    /// How it takes part in rounds: the section `rounds` of its configuration, key by key, as a configuration file writes it.
    /// The same at all robots of a swarm, but for `decorrelation` and `discount_repeats`, which are a camera's own.
    #[serde(default)]
    pub rounds: BTreeMap<String, Value>,
}

impl Status {
    /// Of a robot that has just started: no camera, no classifier, nobody known.
    #[must_use]
    pub fn new(robot: RobotId, name: String, boot: u32) -> Self {
        Self {
            robot,
            name,
            boot,
            camera: Camera { source: "none".to_owned(), ..Camera::default() },
            model: "none".to_owned(),
            sealed: false,
            vocabulary: Vec::new(),
            neighbours: Vec::new(),
            alive: Vec::new(),
            round: None,
            open: false,
            learning: None,
            counters: BTreeMap::new(),
            errors: Vec::new(),
            protocol: PROTOCOL_VERSION,
            session: String::new(),
            clock_ms: None,
            rounds: BTreeMap::new(),
        }
    }
}

/// What a robot sees with, and how that goes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// What it is, in words: `rendered`, `video hand.mp4`, `none`.
    pub source: String,
    /// How it goes.
    pub state: CameraState,
    /// What is wrong with it, and the mend; empty when nothing is.
    pub trouble: String,
    /// Width and height of the frames it delivers, in pixels; zero before the first.
    pub size: [u32; 2],
    /// Frames per second it delivered lately.
    pub fps: f32,
    /// Milliseconds from a frame's being taken to its being judged, lately.
    pub delay_ms: f32,
    /// What moves before it; absent when motion is not watched.
    pub motion: Option<Motion>,
    /// What its last frame with a hand showed, in its own opinion.
    pub opinion: Option<Opinion>,
}

/// How a camera goes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CameraState {
    /// There is none.
    #[default]
    None,
    /// It was opened and has not delivered a frame yet.
    Opening,
    /// It delivers.
    Live,
    /// It delivers nothing any more, or the same picture over and over.
    Frozen,
    /// It delivers what is no picture, or nothing but errors; it is tried again.
    Failing,
    /// It has come to its end.
    Ended,
}

/// What moves before a camera.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    /// What it sees now.
    pub state: MotionState,
    /// How late a change of state is noticed at the camera's rate, in milliseconds.
    pub delay_ms: f32,
}

/// What a motion detector sees.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MotionState {
    /// Nobody is there.
    #[default]
    Empty,
    /// Somebody moves.
    Moving,
    /// Somebody is there and holds still.
    Still,
}

/// What one robot takes a gesture for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Opinion {
    /// Its label.
    pub gesture: String,
    /// Its probability, `0.0..=1.0`.
    pub probability: f32,
    /// When, in milliseconds since the robot's start.
    pub at_ms: u64,
}

/// What a robot has learned from.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LearningStatus {
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
    /// The gestures that were named since the swarm was made, and are in use.
    #[serde(default)]
    pub named: Vec<NamedGesture>,
    /// Where it keeps all this: a path, `none`, or what is wrong with it.
    pub memory: String,
    /// How often it has trained.
    pub trainings: u64,
    /// Other robots whose samples it does not all train on, for they contradict what it and others saw, or are too many.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub doubted: Vec<Heeded>,
}

/// How much a robot makes of the samples of another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Heeded {
    /// Whose samples.
    pub robot: RobotId,
    /// How many of them it holds.
    pub held: usize,
    /// How many of these it trains on.
    pub trained: usize,
}

/// A gesture that an instructor named.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct NamedGesture {
    /// Its number.
    pub class: ClassId,
    /// What it is called: its label, with who named it where another has the same.
    pub label: String,
    /// The samples that show it.
    pub samples: usize,
}

/// An error as the status reports it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Reported {
    /// Milliseconds since the robot's start.
    pub at_ms: u64,
    /// Cause and mend.
    pub what: String,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decode::decode_json;

    #[test]
    fn a_status_of_an_older_release_is_read_and_does_not_say_what_it_did_not_know() {
        let mut json = serde_json::to_value(Status::new(RobotId(3), "three".to_owned(), 1)).unwrap();
        for newer in ["protocol", "session", "clock_ms", "rounds"] {
            json.as_object_mut().unwrap().remove(newer).expect(newer);
        }
        let read: Status = decode_json(&serde_json::to_vec(&json).unwrap()).unwrap();
        assert_eq!((read.protocol, read.session.as_str(), read.clock_ms), (0, "", None));
        assert!(read.rounds.is_empty());
    }
}
