//! What the machine wants done.

use gestalt_protocol::{Announcement, Decision, Envelope, RobotId, RoundId};

/// What [`Rounds`](crate::Rounds) wants done. The host carries out all of them, in order.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// Say this to all robots (a vote on `robot/<me>/vote`, what it holds on `robot/<me>/decision`): the fast way.
    Broadcast(Envelope),
    /// Say this to one neighbour (`robot/<id>/repair`): the sure way.
    Tell(RobotId, Envelope),
    /// This robot now holds that decision. Where it is another gesture, it tells all: that is a [`Broadcast`](Self::Broadcast).
    Hold(Decision),
    /// As the spokesrobot: announce the swarm's decision (`decision`).
    Announce(Announcement),
    /// This robot takes part in that round from now on: look.
    Opened(RoundId),
    /// That round is over for this robot: no further looking.
    Closed(RoundId),
}
