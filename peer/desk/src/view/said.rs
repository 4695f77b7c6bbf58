//! What instructors said, and what became of it.

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
    /// When: see [`Answer::at`].
    pub at: u64,
    /// Of which round; `None` where the word names none.
    pub round: Option<RoundId>,
    /// What: `was`, `right`, `wrong`, `retract`, `new`, `same`, `retire`, `restore`, or `open` where it was refused.
    pub word: &'static str,
    /// Of which gesture, as it was named.
    pub gesture: Option<String>,
    /// Which other one that is, where the word is `same`.
    pub of: Option<String>,
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

/// A word whose gestures are named when it is shown: the names of numbers may come later.
#[derive(Clone, Debug)]
struct Noted {
    gesture: Option<Gesture>,
    of: Option<Gesture>,
    view: SaidView,
}

impl Said {
    /// Notes a word and its answer. Says whether it is new: robots answer each word once, but where one dies its successor
    /// may repeat it, and the smaller id then stands. A word is known by its author and its time, whatever its clock says.
    pub fn note(&mut self, by: &InstructorId, answer: &Answer) -> bool {
        let noted = Noted::new(by, answer);
        let known = self.0.iter_mut().find(|it| it.view.at == answer.at && it.view.instructor == *by);
        if let Some(known) = known {
            if (noted.view.robot, noted.view.samples) < (known.view.robot, known.view.samples) {
                *known = noted;
            }
            return false;
        }
        if self.0.len() == MAX_SAID {
            self.0.pop_front();
        }
        self.0.push_back(noted);
        true
    }

    /// Latest first; `name` knows the names of a round's gestures, and of those that words without a round are about.
    pub fn views(&self, name: impl Fn(Option<RoundId>, ClassId) -> String) -> Vec<SaidView> {
        let view = |Noted { gesture, of, view }: &Noted| {
            let named = |gesture: &Gesture| match gesture {
                Gesture::Class(class) => name(view.round, *class),
                Gesture::Label(label) => label.clone(),
            };
            SaidView { gesture: gesture.as_ref().map(named), of: of.as_ref().map(named), ..view.clone() }
        };
        self.0.iter().rev().map(view).collect()
    }
}

impl Noted {
    fn new(by: &InstructorId, answer: &Answer) -> Self {
        let short = |gesture: &Gesture| {
            Some(match gesture {
                Gesture::Class(class) => Gesture::Class(*class),
                Gesture::Label(label) => Gesture::Label(clipped(label)),
            })
        };
        let (word, gesture, of) = match &answer.to {
            Instruction::Open => ("open", None, None),
            Instruction::Was { class, .. } => ("was", short(class), None),
            Instruction::Right { of, .. } => ("right", short(of), None),
            Instruction::Wrong { of, .. } => ("wrong", short(of), None),
            Instruction::Retract { .. } => ("retract", None, None),
            Instruction::New { label, .. } => ("new", Some(Gesture::Label(clipped(label))), None),
            Instruction::Same { class, of } => ("same", short(class), short(of)),
            Instruction::Retire { class } => ("retire", short(class), None),
            Instruction::Restore { class } => ("restore", short(class), None),
        };
        let view = SaidView {
            instructor: by.clone(),
            at: answer.at,
            round: answer.to.round(),
            word,
            gesture: None,
            of: None,
            outcome: answer.outcome,
            words: answer.outcome.describe(),
            robot: answer.robot,
            samples: answer.samples,
        };
        Self { gesture, of, view }
    }
}
