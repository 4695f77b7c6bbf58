//! What the world tells the mind.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{Announcement, Envelope, Instruction, InstructorId, Question, RobotId, SignedWord};
use gestalt_rounds::{Classify, Input as AboutRounds, Observation};

use crate::believe::Believe;

/// What the world tells the mind.
#[derive(Clone, Debug)]
pub enum Input {
    /// Time has passed; the host owes one at [`Mind::next_wake`](crate::Mind::next_wake), more do no harm.
    Tick,
    /// The robot's host says, by a schedule or for other reasons of its own: a gesture is being shown.
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
    /// A human says something.
    Instructed(Instructed),
    /// A human says something that they may not: it is answered, and changes nothing. One that nobody signed was said to this robot alone.
    Disallowed(Instructed),
    /// That robot has answered what that instructor said at that time.
    Answered(InstructorId, u64, RobotId),
    /// A frame showed a hand.
    Observed(Observation),
    /// A robot's message arrived, by whichever way.
    Received(Envelope),
    /// This decision was announced for the swarm (`decision`).
    Announced(Announcement),
    /// Another robot asked that in the name of the swarm (`question`).
    Asked(Question),
    /// The robots alive now, by liveliness; whether it includes this robot makes no difference.
    Alive(Arc<BTreeSet<RobotId>>),
    /// The robots that see and vote through this robot's host, and leave deciding and announcing to this mind.
    Guests(BTreeSet<RobotId>),
    /// The robots this one is directly linked to now.
    Neighbours(BTreeSet<RobotId>),
    /// These robots belong to the swarm no more, or were given another key: nothing that they said counts in the round that is open.
    Expelled(BTreeSet<RobotId>),
    /// The swarm is sealed, and this one knows who may teach: at the start, and whenever that changes.
    Believe(Arc<dyn Believe>),
    /// A new classifier takes the place of the old one.
    Learned(Arc<dyn Classify>),
    /// All that was to be remembered up to this revision is safe.
    Remembered(u64),
}

/// A human's word, as it reached the swarm.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Instructed {
    /// Who said it.
    pub by: InstructorId,
    /// When, as Zenoh counts it (in 2⁻³² s since 1970), by the clock of whose client says it; or in a sealed swarm the count that was signed with it. The same at
    /// every robot.
    pub at: u64,
    /// What was said.
    pub instruction: Instruction,
    /// In a sealed swarm the word as it was signed, to be passed on.
    pub said: Option<SignedWord>,
}

/// How much later a word may arrive than one that was said after it. What is older still may be of a clock that was set back.
const LATE: u64 = 60 << 32;

impl Instructed {
    /// Whether it comes late, in an open swarm: its instructor spoke of the same at that `later` time. Within two seconds nothing is said of the order: some
    /// clients say no time, and then that is all their words tell.
    pub(super) fn is_late(&self, later: u64) -> bool {
        let span = |at: u64| at >> 33;
        self.said.is_none() && span(self.at) < span(later) && later - self.at < LATE
    }
}

/// What an input is about.
#[expect(clippy::large_enum_variant, reason = "it is taken apart at once, and never kept")]
pub(super) enum Concern {
    Rounds(AboutRounds),
    Word(Instructed),
    Disallowed(Instructed),
    Answered(InstructorId, u64, RobotId),
    Remembered(u64),
    Asked(Question),
    Believe(Arc<dyn Believe>),
}

impl Input {
    pub(super) fn concern(self) -> Concern {
        Concern::Rounds(match self {
            Self::Instructed(Instructed { instruction: Instruction::Open, .. }) | Self::Open => {
                AboutRounds::Open
            }
            Self::Instructed(word) => return Concern::Word(word),
            Self::Disallowed(word) => return Concern::Disallowed(word),
            Self::Answered(by, at, robot) => return Concern::Answered(by, at, robot),
            Self::Asked(question) => return Concern::Asked(question),
            Self::Remembered(revision) => return Concern::Remembered(revision),
            Self::Believe(believer) => return Concern::Believe(believer),
            Self::Tick => AboutRounds::Tick,
            Self::Shown(began) => AboutRounds::Shown(began),
            Self::Left => AboutRounds::Left,
            Self::Blind(blind) => AboutRounds::Blind(blind),
            Self::Observed(observation) => AboutRounds::Observed(observation),
            Self::Received(envelope) => AboutRounds::Received(envelope),
            Self::Announced(announcement) => AboutRounds::Announced(announcement),
            Self::Alive(robots) => AboutRounds::Alive(robots),
            Self::Guests(robots) => AboutRounds::Guests(robots),
            Self::Neighbours(robots) => AboutRounds::Neighbours(robots),
            Self::Expelled(robots) => AboutRounds::Expelled(robots),
            Self::Learned(classifier) => AboutRounds::Learned(classifier),
        })
    }
}
