//! What the mind wants done.

use gestalt_protocol::{Announcement, Answer, Decision, Envelope, InstructorId, Question, RobotId, RoundId};
use gestalt_rounds::Output as OfRounds;

use crate::learning::{RecordChange, TrainingChange};

/// What the mind wants done. The host carries out all of them, in order.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// Say this to all robots (a vote on `robot/<me>/vote`, what it holds on `robot/<me>/decision`, samples on `robot/<me>/sample`): the fast
    /// way.
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
    /// As the spokesrobot: ask whoever instructs the swarm (`question`).
    Ask(Question),
    /// Answer that instructor (`instructor/<id>/answer`).
    Answer(InstructorId, Answer),
    /// Make the classifier follow these changes of its samples, beside the loop; then say
    /// [`Input::Learned`](crate::Input::Learned).
    Train(Vec<TrainingChange>),
    /// Write these changes where a kill at any moment leaves all or none of them; then say
    /// [`Input::Remembered`](crate::Input::Remembered).
    Remember {
        /// Counts up.
        revision: u64,
        /// What has changed since the one before.
        changes: Vec<RecordChange>,
    },
}

impl From<OfRounds> for Output {
    fn from(output: OfRounds) -> Self {
        match output {
            OfRounds::Broadcast(envelope) => Self::Broadcast(envelope),
            OfRounds::Tell(robot, envelope) => Self::Tell(robot, envelope),
            OfRounds::Hold(decision) => Self::Hold(decision),
            OfRounds::Announce(announcement) => Self::Announce(announcement),
            OfRounds::Opened(round) => Self::Opened(round),
            OfRounds::Closed(round) => Self::Closed(round),
        }
    }
}
