//! The parameters of a robot's mind.

use std::time::Duration;

use gestalt_protocol::FusionRule;

/// How a robot takes part in rounds. All robots of a swarm should share these.
#[derive(Clone, Debug, PartialEq)]
pub struct MindConfig {
    /// How votes are fused.
    pub rule: FusionRule,
    /// α: decide once the fused probability of the top class reaches 1 − α. Range `0.0 < α < 0.5`.
    pub alpha: f64,
    /// q: how many robots must have contributed evidence. At least 1.
    pub quorum: u32,
    /// f: how many lying robots a decision must withstand; the margin top − second must exceed 2·f·c.
    pub liars: u32,
    /// c: the bound on a robot's log-evidence for or against any class, in nats.
    pub clip: f64,
    /// τ: how long until a view has changed enough to count as another look.
    pub decorrelation: Duration,
    /// How long a round waits for live robots that have not voted yet, before it decides without them.
    pub patience: Duration,
    /// When a round ends undecided, from its opening.
    pub deadline: Duration,
    /// The least time between two votes of one robot.
    pub vote_interval: Duration,
    /// A vote is said again after this long, while the round is open.
    pub vote_repeat: Duration,
    /// How long the spokesrobot lets decisions meet before it announces the greatest.
    pub settle: Duration,
    /// How much longer each next robot waits for the announcement before it makes it itself.
    pub takeover: Duration,
    /// The period of repair between neighbours while a round is open or the neighbourhood has just changed.
    pub repair_busy: Duration,
    /// The same when nothing happens.
    pub repair_idle: Duration,
}

impl Default for MindConfig {
    fn default() -> Self {
        Self {
            rule: FusionRule::LogPool,
            alpha: 0.05,
            quorum: 1,
            liars: 0,
            clip: 6.0,
            decorrelation: Duration::from_millis(500),
            patience: Duration::from_millis(1000),
            deadline: Duration::from_secs(5),
            vote_interval: Duration::from_millis(250),
            vote_repeat: Duration::from_secs(1),
            settle: Duration::from_millis(200),
            takeover: Duration::from_millis(400),
            repair_busy: Duration::from_millis(500),
            repair_idle: Duration::from_secs(2),
        }
    }
}
