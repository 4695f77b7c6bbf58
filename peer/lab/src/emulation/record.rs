//! What came of a run, gathered while it runs.

use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{ClassId, Decision, Gesture, Instruction};

/// So many different decisions are compared with each that a robot comes to hold.
const DIFFERENT: usize = 16;

/// One gesture shown.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Showing {
    pub at: Duration,
    pub shown: ClassId,
    /// The counter of its round; none when no robot opened one.
    pub counter: Option<u32>,
    /// Whether the instructor said of it that it was the gesture shown.
    pub named_rightly: bool,
    pub announcements: u32,
    /// Whether the gesture shown, and whether another, was announced as final.
    pub finally_right: bool,
    pub finally_wrong: bool,
    /// Whether liars made a decision for another gesture that robots believe.
    pub forged: bool,
    /// When a robot first held a class for it.
    pub first_held: Option<Duration>,
    /// When the last robot came to hold what it holds.
    pub last_held: Option<Duration>,
    pub outcome: Option<Outcome>,
}

/// How a showing stands when the next one begins.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Outcome {
    /// The greatest decision held for it by any robot that is up.
    pub decision: Option<Decision>,
    /// Whether two robots hold different classes for it.
    pub conflict: bool,
    /// Whether all robots that are up hold the same for it.
    pub unanimous: bool,
}

/// Everything a report is made from.
#[derive(Clone, Debug)]
pub(super) struct Record {
    /// Who does not lie.
    pub honest: Vec<bool>,
    pub showings: Vec<Showing>,
    /// The newest decision each robot holds.
    pub holds: Vec<Option<Arc<Decision>>>,
    /// The latest of them that differ: most robots come to hold the same.
    latest: Vec<Arc<Decision>>,
    /// First frames of a robot of a showing, judged before the instructor said what they show: afterwards robots have learned these very ones.
    pub frames: u64,
    pub frames_right: u64,
    /// Whether what is being shown has been said.
    told: bool,
    /// For how long robots had a round open, all added up.
    pub open: Duration,
    opened: Vec<Option<Duration>>,
}

impl Record {
    pub fn new(honest: Vec<bool>) -> Self {
        let robots = honest.len();
        Self {
            honest,
            showings: Vec::new(),
            holds: vec![None; robots],
            latest: Vec::new(),
            frames: 0,
            frames_right: 0,
            told: false,
            open: Duration::ZERO,
            opened: vec![None; robots],
        }
    }

    pub fn show(&mut self, at: Duration, shown: ClassId, counter: Option<u32>) {
        self.told = false;
        self.showings.push(Showing {
            at,
            shown,
            counter,
            named_rightly: false,
            announcements: 0,
            finally_right: false,
            finally_wrong: false,
            forged: false,
            first_held: None,
            last_held: None,
            outcome: None,
        });
    }

    /// Notes how the newest showing stands at the robots that are up.
    pub fn end_showing(&mut self, now: Duration, up: &[usize]) {
        for robot in 0..self.opened.len() {
            if self.opened[robot].is_some() {
                self.close(now, robot);
                self.opened[robot] = Some(now);
            }
        }
        let Some(showing) = self.showings.last_mut() else { return };
        let held = up.iter().map(|robot| {
            self.holds[*robot].as_deref().filter(|held| Some(held.round.counter) == showing.counter)
        });
        let decisions: Vec<&Decision> = held.clone().flatten().collect();
        let conflict = decisions.windows(2).any(|pair| pair[0].class != pair[1].class);
        showing.outcome = Some(Outcome {
            decision: decisions.iter().max_by_key(|decision| decision.rank()).map(|d| (*d).clone()),
            conflict,
            unanimous: !conflict && !up.is_empty() && decisions.len() == up.len(),
        });
    }

    /// The instructor said that.
    pub fn tell(&mut self, instruction: &Instruction) {
        self.told = true;
        if let Instruction::Was { round, class: Gesture::Class(named) }
        | Instruction::Right { round, of: Gesture::Class(named) } = instruction
            && let Some(showing) = self.showing(round.counter)
        {
            showing.named_rightly |= *named == showing.shown;
        }
    }

    pub fn frame(&mut self, probabilities: &[f64], shown: ClassId) {
        if self.told {
            return;
        }
        let top = probabilities.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).map(|(k, _)| k);
        self.frames += 1;
        self.frames_right += u64::from(top == Some(shown.index()));
    }

    pub fn hold(&mut self, now: Duration, robot: usize, decision: &Decision) {
        if let Some(showing) = self.showing(decision.round.counter) {
            if decision.class.is_some() {
                showing.first_held.get_or_insert(now);
            }
            showing.last_held = Some(now);
        }
        let held = self.latest.iter().find(|held| ***held == *decision).cloned().unwrap_or_else(|| {
            let held = Arc::new(decision.clone());
            if self.latest.len() == DIFFERENT {
                self.latest.remove(0);
            }
            self.latest.push(held.clone());
            held
        });
        self.holds[robot] = Some(held);
    }

    pub fn announce(&mut self, decision: &Decision) {
        if let Some(showing) = self.showing(decision.round.counter) {
            showing.announcements += 1;
            if decision.is_final && decision.class.is_some() {
                let right = decision.class == Some(showing.shown);
                showing.finally_right |= right;
                showing.finally_wrong |= !right;
            }
        }
    }

    /// Liars made a decision that robots believe.
    pub fn forge(&mut self, decision: &Decision) {
        if let Some(showing) = self.showing(decision.round.counter) {
            showing.forged |= decision.class != Some(showing.shown);
        }
    }

    pub fn open(&mut self, now: Duration, robot: usize) {
        self.opened[robot] = Some(now);
    }

    pub fn close(&mut self, now: Duration, robot: usize) {
        if let Some(since) = self.opened[robot].take() {
            self.open += now.saturating_sub(since);
        }
    }

    /// A robot has lost all it knew.
    pub fn forget(&mut self, robot: usize) {
        self.holds[robot] = None;
        self.opened[robot] = None;
    }

    fn showing(&mut self, counter: u32) -> Option<&mut Showing> {
        self.showings.iter_mut().rev().find(|showing| showing.counter == Some(counter))
    }
}
