//! What the world tells the machine.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{Announcement, Envelope, RobotId};

use crate::classify::Classify;
use crate::observation::Observation;

/// What the world tells [`Rounds`](crate::Rounds).
#[derive(Clone, Debug)]
pub enum Input {
    /// Time has passed; the host owes one at [`Rounds::next_wake`](crate::Rounds::next_wake), more do no harm.
    Tick,
    /// The robot's host, or an instructor, says: a gesture is being shown.
    Open,
    /// The robot's own motion detector says: a hand moved from that time on, and now holds still. Opens a round, unless
    /// the newest one was opened after the hand had begun to move: that one is about this gesture.
    Shown(Duration),
    /// The robot's own motion detector says: the hand that held still is moving again, or gone. What was shown can be seen
    /// no more, so this robot's round ends early.
    Left,
    /// Whether the robot's camera shows anything at all. One that is blind takes part, and says that it need not be waited
    /// for. Until told otherwise, a robot sees.
    Blind(bool),
    /// A frame showed a hand.
    Observed(Observation),
    /// A robot's message arrived, by whichever way. One that is not about rounds changes nothing.
    Received(Envelope),
    /// This was announced for the swarm (`decision`).
    Announced(Announcement),
    /// The robots alive now, by liveliness; whether it includes this robot makes no difference.
    Alive(Arc<BTreeSet<RobotId>>),
    /// The robots that see and vote through this robot's host, and leave deciding and announcing to this one.
    Guests(BTreeSet<RobotId>),
    /// The robots this one is directly linked to now.
    Neighbours(BTreeSet<RobotId>),
    /// These robots belong to the swarm no more, or were given another key: nothing that they said counts in the round that is open.
    Expelled(BTreeSet<RobotId>),
    /// A new classifier takes the place of the old one.
    Learned(Arc<dyn Classify>),
}
