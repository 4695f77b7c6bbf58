//! What came of a run, gathered while it runs.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{ClassId, Decision, Gesture, Instruction, RoundId};

/// So many different decisions are compared with each that a robot comes to hold.
const DIFFERENT: usize = 16;

/// One gesture shown.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Showing {
    pub at: Duration,
    pub shown: ClassId,
    /// Whether a robot opened a round for it.
    pub opened: bool,
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
    /// The showing during which each round was first opened, by anybody: the parts of a swarm that is cut count alike for different showings, and
    /// who opened one under a count that was used opens another.
    rounds: BTreeMap<RoundId, usize>,
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
            rounds: BTreeMap::new(),
            holds: vec![None; robots],
            latest: Vec::new(),
            frames: 0,
            frames_right: 0,
            told: false,
            open: Duration::ZERO,
            opened: vec![None; robots],
        }
    }

    pub fn show(&mut self, at: Duration, shown: ClassId) {
        self.told = false;
        self.showings.push(Showing {
            at,
            shown,
            opened: false,
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
        let Some(newest) = self.showings.len().checked_sub(1) else { return };
        let held = up.iter().filter_map(|robot| self.holds[*robot].as_deref());
        let decisions: Vec<&Decision> =
            held.filter(|held| self.rounds.get(&held.round) == Some(&newest)).collect();
        let classes: BTreeSet<Option<ClassId>> = decisions.iter().map(|decision| decision.class).collect();
        self.showings[newest].outcome = Some(Outcome {
            decision: decisions.iter().max_by_key(|decision| decision.rank()).map(|d| (*d).clone()),
            conflict: classes.iter().flatten().count() > 1,
            unanimous: classes.len() == 1 && decisions.len() == up.len(),
        });
    }

    /// The instructor said that.
    pub fn tell(&mut self, instruction: &Instruction) {
        self.told = true;
        if let Instruction::Was { round, class: Gesture::Class(named) }
        | Instruction::Right { round, of: Gesture::Class(named) } = instruction
            && let Some(showing) = self.showing(*round)
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
        if let Some(showing) = self.showing(decision.round) {
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
        if let Some(showing) = self.showing(decision.round) {
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
        if let Some(showing) = self.showing(decision.round) {
            showing.forged |= decision.class != Some(showing.shown);
        }
    }

    /// A robot takes part in a round.
    pub fn open(&mut self, now: Duration, robot: usize, round: RoundId) {
        self.opened[robot] = Some(now);
        if let Some(newest) = self.showings.len().checked_sub(1)
            && let Entry::Vacant(new) = self.rounds.entry(round)
        {
            new.insert(newest);
            self.showings[newest].opened = true;
        }
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

    /// The showing that a round was for: of two that robots took for one, that of the name under which they go on.
    fn showing(&mut self, round: RoundId) -> Option<&mut Showing> {
        self.rounds.get(&round).map(|showing| &mut self.showings[*showing])
    }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::{Certificate, FusionRule, RobotId, VocabularyId};
    use gestalt_strategies::MindConfig;

    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    fn round(counter: u32, opener: u32) -> RoundId {
        RoundId { counter, opener: RobotId(opener), life: 7 }
    }

    fn decision(round: RoundId, class: Option<u32>) -> Decision {
        Decision {
            round,
            class: class.map(ClassId),
            confidence: 0.9,
            author: RobotId(1),
            is_final: true,
            certificate: Certificate {
                vocabulary: VocabularyId::NONE,
                rule: FusionRule::LogPool,
                pool: None,
                probabilities: vec![],
                unknown: None,
                votes: vec![],
                others: vec![],
                robots: 2,
                quorum: 1,
                elapsed_ms: 0,
                named: vec![],
                terms: MindConfig::default().terms(),
            },
        }
    }

    /// Two robots that are apart count alike: the first opens a round for gesture 0, the second one for gesture 1.
    fn apart() -> Record {
        let mut record = Record::new(vec![true; 2]);
        record.show(SECOND, ClassId(0));
        record.open(SECOND, 0, round(2, 1));
        record.hold(SECOND, 0, &decision(round(2, 1), Some(0)));
        record.end_showing(2 * SECOND, &[0, 1]);
        record.show(2 * SECOND, ClassId(1));
        record.open(2 * SECOND, 1, round(2, 2));
        record
    }

    #[test]
    fn a_decision_is_of_the_showing_for_which_its_round_was_opened() {
        let mut record = apart();
        record.announce(&decision(round(2, 1), Some(0)));
        record.end_showing(3 * SECOND, &[0, 1]);
        let [first, second] = &record.showings[..] else { panic!("two were shown") };
        assert_eq!((first.announcements, first.finally_right, first.finally_wrong), (1, true, false));
        let none = Outcome { decision: None, conflict: false, unanimous: false };
        assert_eq!((second.announcements, second.outcome.as_ref()), (0, Some(&none)));
    }

    #[test]
    fn all_rounds_that_are_opened_for_a_showing_are_its_own() {
        let mut record = apart();
        // Who hears that the count was used opens another; who comes late to that of the first showing opens none for the second.
        record.open(2 * SECOND, 1, round(3, 2));
        record.open(2 * SECOND, 1, round(2, 1));
        (0..2).for_each(|robot| record.hold(3 * SECOND, robot, &decision(round(3, 2), Some(1))));
        record.end_showing(3 * SECOND, &[0, 1]);
        let outcome = record.showings[1].outcome.as_ref().unwrap();
        assert_eq!(outcome.decision.as_ref().and_then(|held| held.class), Some(ClassId(1)));
        assert!(outcome.unanimous && !outcome.conflict);
    }

    #[test]
    fn who_holds_that_nothing_was_decided_contradicts_nobody_and_is_not_of_one_mind_with_who_decided() {
        let mut record = apart();
        for (class, conflict) in [(None, false), (Some(1), false), (Some(2), true)] {
            record.hold(2 * SECOND, 0, &decision(round(2, 2), class));
            record.hold(2 * SECOND, 1, &decision(round(2, 2), Some(1)));
            record.end_showing(3 * SECOND, &[0, 1]);
            let outcome = record.showings[1].outcome.as_ref().unwrap();
            assert_eq!((outcome.conflict, outcome.unanimous), (conflict, class == Some(1)), "{class:?}");
        }
    }
}
