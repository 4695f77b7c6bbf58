//! What a robot lets the program around it know.

use std::collections::BTreeSet;

use gestalt_protocol::{
    Announcement, Answer, Decision, Holding, InstructorId, Question, RobotId, RoundId, SampleId,
};

use crate::failure::Part;

/// How many observations and instructions of the program may wait for the robot's task.
pub(crate) const MAX_COMMANDS: usize = 1024;

/// How many events a receiver may lag behind before it misses some.
pub(crate) const MAX_EVENTS: usize = 1024;

/// What a robot lets the program around it know.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Event {
    /// It takes part in that round: show it frames.
    Opened(RoundId),
    /// That round is over for it.
    Closed(RoundId),
    /// It now holds that decision.
    Held(Decision),
    /// It told the others that it holds that, and whether it held another gesture of that round before.
    Holding(Holding),
    /// That decision was announced for the swarm, by this robot, or by another and this one found nothing against it.
    Announced(Announcement),
    /// That was asked in the name of the swarm, by this robot or another.
    Asked(Question),
    /// The robots it is linked to now.
    Neighbours(BTreeSet<RobotId>),
    /// The robots alive now, itself aside.
    Alive(BTreeSet<RobotId>),
    /// It shared these samples.
    Shared(Vec<SampleId>),
    /// It answered that instructor.
    Answered(InstructorId, Answer),
    /// All that it knew at that revision of its memory is on the disk.
    Remembered(u64),
    /// A part of it failed. [`Part`] says what becomes of the robot; where it ends, [`Robot::ended`](crate::Robot::ended)
    /// returns.
    Failed {
        /// Which part.
        part: Part,
        /// What it said, most often in a panic.
        cause: String,
    },
}
