//! How often the robots were right, each alone and all together.

use std::collections::BTreeMap;

use gestalt_protocol::{ClassId, Decision, RobotId};
use gestalt_strategies::Proportion;
use serde::Serialize;

/// Counts rounds and the opinions in them.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    rounds: u64,
    right: u64,
    undecided: u64,
    missed: u64,
    robots: BTreeMap<RobotId, u64>,
    history: Vec<Round>,
}

/// What came of one round.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Round {
    /// The part of the robots whose own vote was right.
    pub single: f64,
    /// Whether the swarm was.
    pub right: bool,
    /// Whether the swarm decided for another gesture. If it was neither, it was undecided.
    pub wrong: bool,
}

/// How often the robots were right.
#[derive(Clone, Debug, Serialize)]
pub struct Score {
    /// Rounds with a known gesture.
    pub rounds: u64,
    /// Rounds that ended without a decision; they count as wrong.
    pub undecided: u64,
    /// Gestures that were shown without a round being decided; they count for nothing else.
    pub missed: u64,
    /// The swarm's accuracy with its 95 % interval (Wilson).
    pub swarm: Option<Proportion>,
    /// The swarm's accuracy in those rounds that it decided.
    pub decided: Option<Proportion>,
    /// The accuracy of single robots, over all robots and rounds. A robot that saw no hand was not right.
    pub single: Option<Proportion>,
    /// The accuracy of each robot.
    pub robots: BTreeMap<RobotId, f64>,
}

impl Tally {
    /// For a swarm of these robots.
    pub fn new(robots: impl IntoIterator<Item = RobotId>) -> Self {
        Self { robots: robots.into_iter().map(|robot| (robot, 0)).collect(), ..Self::default() }
    }

    /// Takes a round into account: what was shown, and what was decided on which votes.
    pub fn record(&mut self, truth: ClassId, decision: &Decision) {
        self.rounds += 1;
        match decision.class {
            Some(class) if class == truth => self.right += 1,
            Some(_) => {}
            None => self.undecided += 1,
        }
        let mut alone = 0;
        for vote in decision.certificate.votes.iter().filter(|vote| vote.class == truth) {
            if let Some(right) = self.robots.get_mut(&vote.robot) {
                *right += 1;
                alone += 1;
            }
        }
        let single = f64::from(alone) / self.robots.len().max(1) as f64;
        let right = decision.class == Some(truth);
        self.history.push(Round { single, right, wrong: decision.class.is_some() && !right });
    }

    /// Takes a gesture into account that led to no round.
    pub fn miss(&mut self) {
        self.missed += 1;
    }

    /// Every round so far.
    #[must_use]
    pub fn history(&self) -> &[Round] {
        &self.history
    }

    /// The score so far.
    #[must_use]
    pub fn score(&self) -> Score {
        let opinions = self.rounds * self.robots.len() as u64;
        Score {
            rounds: self.rounds,
            undecided: self.undecided,
            missed: self.missed,
            swarm: Proportion::wilson(self.right, self.rounds),
            decided: Proportion::wilson(self.right, self.rounds - self.undecided),
            single: Proportion::wilson(self.robots.values().sum(), opinions),
            robots: self
                .robots
                .iter()
                .map(|(robot, right)| (*robot, *right as f64 / self.rounds.max(1) as f64))
                .collect(),
        }
    }
}
