//! Whose words a robot of a sealed swarm believes, when a neighbour passes them on and when the roster changes.

use std::sync::Arc;

use gestalt_protocol::{
    ClassId, Fate, Gesture, Instruction, InstructorId, Lesson, Naming, RoundId, SignedWord, Word,
};
use gestalt_rounds::Vocabulary;

use super::memory::Item;
use super::state::Learning;
use crate::believe::{Believe, Standing};
use crate::names::NameBook;

impl Learning {
    /// From now on that one knows who may teach; what is remembered is asked about anew. What can be shown to nobody any more counts here as long as
    /// nobody else says anything.
    pub fn believe(&mut self, believer: Arc<dyn Believe>) {
        let mut names = self.names.clone();
        let proof = Proof { believer: &*believer, vocabulary: &self.vocabulary, names: &self.names };
        let rounds = self.lessons.judge_again(|lesson| proof.of_lesson(lesson));
        let gestures = names.judge_again(|naming| proof.of_naming(naming));
        self.believer = Some(believer);
        if !gestures.is_empty() {
            // There may be room for others now.
            self.rename(|before| *before = names);
        }
        self.dirty.extend(gestures.into_iter().map(Item::Naming));
        if !rounds.is_empty() {
            self.judged.doubt();
        }
        for round in rounds {
            self.dirty.insert(Item::Lessons(round));
            self.apply_to_round(round);
        }
    }

    /// Whether words count by whose key they are signed with.
    pub fn is_sealed(&self) -> bool {
        self.believer.is_some()
    }

    /// Whether a robot whose book is full may keep what was said of that round, however old, rather than of newer ones: where somebody with a key spoke of
    /// it, or where it lived through it, as this one did.
    pub fn keeps_before_others(&self, round: RoundId) -> bool {
        self.recent.contains(round) || self.is_sealed() && self.lessons.is_signed(round)
    }

    /// What was refused may be taken now. Under another key neighbours that gave up giving it find something else to be lacking.
    pub fn ask_again(&mut self) {
        self.heard = true;
    }

    /// The latest word of an instructor on a round, with its count and time.
    pub fn latest(&self, round: RoundId, instructor: &InstructorId) -> Option<(u64, u64, Word)> {
        self.lessons.latest(self.recent.names(round), instructor)
    }

    /// Whether what that instructor said of a round counts: not where somebody else's word goes before it.
    pub fn is_heeded(&self, round: RoundId, instructor: &InstructorId) -> bool {
        self.lessons.is_heeded(self.recent.names(round), instructor)
    }

    /// Whether what an instructor says now of a round comes after what somebody else said of it who goes before.
    pub fn is_preceded(&self, round: RoundId, by: &InstructorId, said: Option<&SignedWord>) -> bool {
        let Some(believer) = &self.believer else { return false };
        let standing = said.and_then(|said| believer.believe(by, said));
        let standing = standing.map_or(Standing::Unproven, |(_, standing)| standing);
        self.lessons.is_preceded(self.recent.names(round), by, standing)
    }

    /// The count of what is said next of a round, where instructors sign none.
    pub fn next_count(&self, round: RoundId) -> u64 {
        self.lessons.highest_count(self.recent.names(round)).saturating_add(1)
    }

    /// By which right a lesson counts; `None` in an open swarm, where nobody is asked.
    pub(super) fn standing_of_lesson(&self, lesson: &Lesson) -> Option<Standing> {
        Some(self.proof()?.of_lesson(lesson))
    }

    /// The same of what was said of a gesture that was named.
    pub(crate) fn standing_of_naming(&self, naming: &Naming) -> Option<Standing> {
        Some(self.proof()?.of_naming(naming))
    }

    fn proof(&self) -> Option<Proof<'_>> {
        let believer = self.believer.as_deref()?;
        Some(Proof { believer, vocabulary: &self.vocabulary, names: &self.names })
    }
}

/// Compares what is passed on with the word that it is said to be made of.
struct Proof<'a> {
    believer: &'a dyn Believe,
    vocabulary: &'a Vocabulary,
    names: &'a NameBook,
}

impl Proof<'_> {
    fn of_lesson(&self, lesson: &Lesson) -> Standing {
        let Lesson { round, instructor: by, count, at, word, said } = lesson;
        let says = |instruction: &Instruction| match (instruction, word) {
            (Instruction::Was { class, .. } | Instruction::Right { of: class, .. }, Word::Was(was)) => {
                self.can_mean(class, by, *was)
            }
            (Instruction::New { label, .. }, Word::Was(was)) => {
                *was == self.vocabulary.class(label).unwrap_or_else(|| ClassId::named(by, label))
            }
            (Instruction::Wrong { of, .. }, Word::Not(not)) => self.can_mean(of, by, *not),
            (Instruction::Retract { .. }, Word::Retracted) => true,
            _ => false,
        };
        self.of_word(by, (*count, *at), said.as_ref(), |instruction| {
            instruction.round() == Some(*round) && says(instruction)
        })
    }

    fn of_naming(&self, naming: &Naming) -> Standing {
        let Naming { by, label, count, at, said_by, fate, said } = naming;
        // What becomes of a gesture can be said of one that was named: whom a label leaves open, whoever passes the word on does not find.
        let is_it = |gesture: &Gesture| {
            self.names.is_named(naming)
                && match gesture {
                    Gesture::Class(class) => *class == naming.gesture(),
                    Gesture::Label(said) => said == label || *said == format!("{label} ({by})"),
                }
        };
        self.of_word(said_by, (*count, *at), said.as_ref(), |instruction| match (instruction, fate) {
            (Instruction::New { label: said, .. }, Fate::InUse) => said == label && by == said_by,
            (Instruction::Same { class, of }, Fate::Same(other)) => {
                is_it(class) && self.can_mean(of, said_by, *other)
            }
            (Instruction::Retire { class }, Fate::Retired) => is_it(class),
            (Instruction::Restore { class }, Fate::InUse) => is_it(class),
            _ => false,
        })
    }

    fn of_word(
        &self,
        by: &InstructorId,
        counts: (u64, u64),
        said: Option<&SignedWord>,
        says: impl Fn(&Instruction) -> bool,
    ) -> Standing {
        let believed = said
            .filter(|said| said.instruction().is_ok_and(|instruction| says(&instruction)))
            .and_then(|said| self.believer.believe(by, said))
            .filter(|(count, _)| counts == (*count, *count));
        believed.map_or(Standing::Unproven, |(_, standing)| standing)
    }

    /// Whether an instructor who names a gesture so can have meant that one. Which of several that bear one label was meant, the robot found that
    /// heard the word.
    fn can_mean(&self, gesture: &Gesture, by: &InstructorId, class: ClassId) -> bool {
        match gesture {
            Gesture::Class(meant) => *meant == class,
            Gesture::Label(label) => match self.vocabulary.class(label) {
                Some(listed) => listed == class,
                None => self.names.can_mean(label, by, class),
            },
        }
    }
}
