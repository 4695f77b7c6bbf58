//! The robot's mind: a state machine that turns what a robot sees and hears into votes and decisions.

mod config;

use std::collections::BTreeSet;
use std::sync::Arc;

use gestalt_protocol::{Decision, Envelope, Instruction, RobotId, RoundId};

pub use config::MindConfig;

use crate::{Classify, Observation};

/// What the world tells the mind.
#[derive(Clone, Debug)]
pub enum Input {
    /// Time has passed; the host owes one at [`Mind::next_wake`], more do no harm.
    Tick,
    /// The robot's own motion detector (or its host's schedule) says: a gesture is being shown.
    Open,
    /// A human says so.
    Instructed(Instruction),
    /// A frame showed a hand.
    Observed(Observation),
    /// A robot's message arrived, by whichever way.
    Received(Envelope),
    /// That robot says it holds this decision (`robot/<id>/decision`).
    Heard(RobotId, Decision),
    /// This decision was announced for the swarm (`decision`).
    Announced(Decision),
    /// The robots alive now, by liveliness; whether it includes this robot makes no difference.
    Alive(BTreeSet<RobotId>),
    /// The robots this one is directly linked to now.
    Neighbours(BTreeSet<RobotId>),
    /// A new classifier takes the place of the old one.
    Learned(Arc<dyn Classify>),
}

/// What the mind wants done. The host carries out all of them, in order.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// Say this to all robots (`robot/<me>/vote`): the fast way.
    Broadcast(Envelope),
    /// Say this to one neighbour (`robot/<id>/repair`): the sure way.
    Tell(RobotId, Envelope),
    /// This robot now holds that decision: publish it (`robot/<me>/decision`).
    Hold(Decision),
    /// As the spokesrobot: announce the swarm's decision (`decision`).
    Announce(Decision),
    /// This robot takes part in that round from now on: look.
    Opened(RoundId),
    /// That round is over for this robot: no further looking.
    Closed(RoundId),
}
