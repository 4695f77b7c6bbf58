//! What instructors say, and what they are answered: one answer for each word, from the first robot that can give it.

use std::time::Duration;

use gestalt_protocol::{Answer, Gesture, Instruction, InstructorId, Lesson, Outcome, RobotId, Word};

use super::{Mind, Output};
use crate::{Heard, Verdict};

/// The most answers that wait.
const MAX_WAITING: usize = 64;

/// How much longer a robot waits that saw nothing of the round: another may have.
const SAW_NOTHING: Duration = Duration::from_millis(500);

/// How much longer one waits that has nothing but "no" to say.
const KNOWS_NOTHING: Duration = Duration::from_secs(1);

/// A human's word, as it reached the swarm.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Instructed {
    /// Who said it.
    pub by: InstructorId,
    /// When, in the swarm's own time: the same at every robot.
    pub at: u64,
    /// What was said.
    pub instruction: Instruction,
}

/// An answer that waits for its turn, and until what it says is remembered.
#[derive(Clone, Debug)]
pub(super) struct Waiting {
    pub due: Duration,
    revision: u64,
    by: InstructorId,
    answer: Answer,
}

impl Mind {
    pub(super) fn on_instructed(&mut self, instructed: Instructed, out: &mut Vec<Output>) {
        if instructed.instruction == Instruction::Open {
            return self.on_open(out);
        }
        let outcome = self.learn_from(&instructed);
        self.share();
        self.prepare_answer(instructed, outcome);
    }

    fn learn_from(&mut self, instructed: &Instructed) -> Outcome {
        let Some(learning) = &mut self.learning else { return Outcome::NotLearning };
        let Some(round) = instructed.instruction.round() else { return Outcome::UnknownRound };
        if !learning.knows(round) {
            return Outcome::UnknownRound;
        }
        let word = match &instructed.instruction {
            Instruction::Open => return Outcome::UnknownRound,
            Instruction::Retract { .. } => Word::Retracted,
            Instruction::Right { .. } | Instruction::Wrong { .. } => {
                let Some(decided) = learning.decision(round) else { return Outcome::NoDecision };
                let right = matches!(instructed.instruction, Instruction::Right { .. });
                if right { Word::Was(decided) } else { Word::Not(decided) }
            }
            Instruction::Was { class, .. } => {
                let class = match class {
                    Gesture::Class(class) => Some(*class),
                    Gesture::Label(label) => learning.vocabulary().class(label),
                };
                let classes = learning.vocabulary().classes();
                match class.filter(|class| class.index() < classes) {
                    Some(class) => Word::Was(class),
                    None => return Outcome::UnknownGesture,
                }
            }
        };
        let again = learning.lessons().word(round, &instructed.by) == Some(word);
        let lesson = Lesson { round, instructor: instructed.by.clone(), at: instructed.at, word };
        match learning.hear(&lesson) {
            Heard::New if again => Outcome::Known,
            Heard::New if word != Word::Retracted && learning.held_of(round) == 0 => Outcome::NothingSeen,
            Heard::New => Outcome::Learned,
            Heard::Known => Outcome::Known,
            Heard::Full => Outcome::UnknownRound,
        }
    }

    fn prepare_answer(&mut self, instructed: Instructed, outcome: Outcome) {
        let Instructed { by, at, instruction } = instructed;
        let known = self.answers.iter().any(|w| w.by == by && w.answer.at == at);
        if known || self.answered.contains(&(by.clone(), at)) || self.answers.len() >= MAX_WAITING {
            return;
        }
        let wait = match outcome {
            Outcome::Learned | Outcome::Known => Duration::ZERO,
            Outcome::NothingSeen => SAW_NOTHING,
            Outcome::UnknownRound | Outcome::NoDecision | Outcome::UnknownGesture | Outcome::NotLearning => {
                KNOWS_NOTHING
            }
        };
        let (mut class, mut samples, mut revision) = (None, 0, 0);
        if let (Some(learning), Some(round)) = (&self.learning, instruction.round()) {
            class = match learning.verdict(round) {
                Verdict::Class(class) => Some(class),
                _ => None,
            };
            samples = u32::try_from(learning.held_of(round)).unwrap_or(u32::MAX);
            revision = learning.pending_revision();
        }
        let answer = Answer { robot: self.me, at, to: instruction, outcome, class, samples };
        let due = self.now + wait + self.config.takeover.saturating_mul(self.turns);
        self.answers.push(Waiting { due, revision, by, answer });
    }

    /// Another robot has answered that word.
    pub(super) fn on_answered(&mut self, by: &InstructorId, at: u64, robot: RobotId) {
        if robot != self.me {
            self.answers.retain(|waiting| waiting.by != *by || waiting.answer.at != at);
            self.note_answered(by.clone(), at);
        }
    }

    /// An answer may come before the word it answers.
    fn note_answered(&mut self, by: InstructorId, at: u64) {
        self.answered.push_back((by, at));
        if self.answered.len() > MAX_WAITING {
            self.answered.pop_front();
        }
    }

    /// When the next answer is to be given, if what it says is remembered by then.
    pub(super) fn answer_due(&self) -> Option<Duration> {
        self.answers.iter().filter(|waiting| self.may_say(waiting)).map(|waiting| waiting.due).min()
    }

    fn may_say(&self, waiting: &Waiting) -> bool {
        self.learning.as_ref().is_none_or(|learning| learning.is_remembered(waiting.revision))
    }

    pub(super) fn answer_when_due(&mut self, out: &mut Vec<Output>) {
        let ready = |mind: &Self| {
            mind.answers.iter().position(|waiting| mind.now >= waiting.due && mind.may_say(waiting))
        };
        while let Some(position) = ready(self) {
            let Waiting { by, answer, .. } = self.answers.remove(position);
            self.note_answered(by.clone(), answer.at);
            out.push(Output::Answer(by, answer));
        }
    }
}
