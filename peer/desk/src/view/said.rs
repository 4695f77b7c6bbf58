//! What instructors said of rounds, and what became of it.

use std::collections::VecDeque;

use gestalt_protocol::{Answer, ClassId, Gesture, Instruction, InstructorId, Outcome, RobotId, RoundId};
use serde::Serialize;

use super::text::clipped;

/// How many words of instructors are remembered.
pub const MAX_SAID: usize = 32;

/// One word of an instructor and the swarm's answer.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SaidView {
    /// Who said it.
    pub instructor: InstructorId,
    /// Of which round.
    pub round: RoundId,
    /// What: `was`, `right`, `wrong`, `retract`.
    pub word: &'static str,
    /// Of which gesture, as it was named.
    pub gesture: Option<String>,
    /// What became of it.
    pub outcome: Outcome,
    /// The same in words.
    pub words: &'static str,
    /// Who answered.
    pub robot: RobotId,
    /// How many samples of that round it learns from.
    pub samples: u32,
}

/// The latest words, as they were heard.
#[derive(Clone, Debug, Default)]
pub(super) struct Said(VecDeque<Noted>);

#[derive(Clone, Debug)]
struct Noted {
    at: u64,
    /// The gesture, where it was named by its number.
    class: Option<ClassId>,
    view: SaidView,
}

impl Said {
    /// Notes a word and its answer. Says whether it is new: robots answer each word once, but where one dies its successor
    /// may repeat it, and the smaller id then stands. A word is known by its author and its time, whatever its clock says.
    pub fn note(&mut self, by: &InstructorId, round: RoundId, answer: &Answer) -> bool {
        let (view, class) = SaidView::new(by, round, answer);
        let known = self.0.iter_mut().find(|it| it.at == answer.at && it.view.instructor == *by);
        if let Some(Noted { view: known, .. }) = known {
            if (view.robot, view.samples) < (known.robot, known.samples) {
                *known = view;
            }
            return false;
        }
        if self.0.len() == MAX_SAID {
            self.0.pop_front();
        }
        self.0.push_back(Noted { at: answer.at, class, view });
        true
    }

    /// Latest first; `name` knows the names of a round's gestures.
    pub fn views(&self, name: impl Fn(RoundId, ClassId) -> String) -> Vec<SaidView> {
        let view = |Noted { class, view, .. }: &Noted| {
            let named = class.map(|class| name(view.round, class));
            SaidView { gesture: named.or_else(|| view.gesture.clone()), ..view.clone() }
        };
        self.0.iter().rev().map(view).collect()
    }
}

impl SaidView {
    /// A word as it was said, and the gesture's number if it has no name yet.
    fn new(by: &InstructorId, round: RoundId, answer: &Answer) -> (Self, Option<ClassId>) {
        let (word, gesture) = match &answer.to {
            Instruction::Open => ("open", None),
            Instruction::Was { class, .. } => ("was", Some(class)),
            Instruction::Right { of, .. } => ("right", Some(of)),
            Instruction::Wrong { of, .. } => ("wrong", Some(of)),
            Instruction::Retract { .. } => ("retract", None),
            Instruction::New { .. } => ("new", None),
            Instruction::Same { class, .. } => ("same", Some(class)),
            Instruction::Retire { class } => ("retire", Some(class)),
            Instruction::Restore { class } => ("restore", Some(class)),
        };
        let (gesture, class) = match gesture {
            Some(Gesture::Label(label)) => (Some(clipped(label)), None),
            Some(Gesture::Class(class)) => (None, Some(*class)),
            None => match &answer.to {
                Instruction::New { label, .. } => (Some(clipped(label)), None),
                _ => (None, None),
            },
        };
        let view = Self {
            instructor: by.clone(),
            round,
            word,
            gesture,
            outcome: answer.outcome,
            words: answer.outcome.describe(),
            robot: answer.robot,
            samples: answer.samples,
        };
        (view, class)
    }
}
