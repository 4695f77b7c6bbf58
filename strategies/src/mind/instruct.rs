//! What instructors say, and what they are answered: one answer for each word, from the first robot that can give it.

use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{Answer, ClassId, Gesture, Instruction, InstructorId, Lesson, Outcome, RobotId, Word};
use gestalt_rounds::{Input as AboutRounds, Refusal};

use super::answers::Waiting;
use super::input::Instructed;
use super::machine::Mind;
use super::output::Output;
use crate::believe::Believe;
use crate::learning::Learning;
use crate::lessons::{LessonReceipt, Verdict};

/// How much longer a robot waits that saw nothing of the round: another may have.
const SAW_NOTHING: Duration = Duration::from_millis(500);

/// How much longer one waits that has nothing but "no" to say.
const KNOWS_NOTHING: Duration = Duration::from_secs(1);

impl Mind {
    pub(super) fn on_instructed(&mut self, now: Duration, instructed: Instructed) -> AboutRounds {
        // In a sealed swarm whoever hands it over has seen to that.
        if instructed.said.is_none() && !self.answers.is_news(&instructed) {
            return AboutRounds::Tick;
        }
        if self.is_preceded(&instructed) {
            return self.disallow(now, instructed, self.rounds.turn());
        }
        // Somebody is there who says what is shown.
        if instructed.instruction.round().is_some() {
            self.asks.unanswered.clear();
        }
        let (outcome, named) = self.heed(&instructed);
        self.share();
        self.prepare_answer(now, instructed, outcome, named, self.rounds.turn());
        AboutRounds::Tick
    }

    /// Whether somebody else has said of that round what goes before it. What one said oneself anybody takes back.
    fn is_preceded(&self, instructed: &Instructed) -> bool {
        let Instructed { by, instruction, said, .. } = instructed;
        let round = instruction.round().filter(|_| !matches!(instruction, Instruction::Retract { .. }));
        let learning = self.learning.as_ref();
        learning.zip(round).is_some_and(|(learning, round)| learning.is_preceded(round, by, said.as_ref()))
    }

    /// Names or teaches what it says: what became of it, and which gesture was named.
    fn heed(&mut self, instructed: &Instructed) -> (Outcome, Option<ClassId>) {
        match self.name(instructed) {
            Some((outcome @ (Outcome::Learned | Outcome::Known), Some(gesture))) => {
                (self.shown_as(instructed, gesture).unwrap_or(outcome), Some(gesture))
            }
            Some((outcome, gesture)) => (outcome, gesture),
            None => (self.learn_from(instructed, &instructed.instruction), None),
        }
    }

    /// Who may teach is known anew.
    pub(super) fn on_believe(&mut self, believer: Arc<dyn Believe>) -> AboutRounds {
        if let Some(learning) = &mut self.learning {
            learning.believe(believer);
            // What was not believed may be: lessons, and names, of which nobody says that they were declined.
            learning.ask_again();
        }
        self.exchanges.forget_declined_lessons();
        self.share();
        AboutRounds::Tick
    }

    /// One robot says so for all that heard it, as it does of a word that is heeded.
    pub(super) fn on_disallowed(&mut self, now: Duration, instructed: Instructed) -> AboutRounds {
        // One that nobody signed was said to this robot alone: there is nobody to wait for.
        let turn = if instructed.said.is_some() { self.rounds.turn() } else { Duration::ZERO };
        self.disallow(now, instructed, turn)
    }

    fn disallow(&mut self, now: Duration, instructed: Instructed, turn: Duration) -> AboutRounds {
        self.rounds.note_refusal(Refusal::WordNotAllowed);
        self.prepare_answer(now, instructed, Outcome::NotAllowed, None, turn);
        AboutRounds::Tick
    }

    /// What was named was shown in a round, if the word says so.
    fn shown_as(&mut self, instructed: &Instructed, gesture: ClassId) -> Option<Outcome> {
        let round = instructed.instruction.round()?;
        let was = Instruction::Was { round, class: Gesture::Class(gesture) };
        Some(self.learn_from(instructed, &was))
    }

    fn learn_from(&mut self, instructed: &Instructed, instruction: &Instruction) -> Outcome {
        let Some(learning) = &mut self.learning else { return Outcome::NotLearning };
        let Some(round) = instruction.round() else { return Outcome::UnknownRound };
        if !learning.knows(round) {
            return Outcome::UnknownRound;
        }
        let class = |gesture: &Gesture| learning.gesture_shown(gesture, &instructed.by);
        let word = match instruction {
            Instruction::Open
            | Instruction::New { .. }
            | Instruction::Same { .. }
            | Instruction::Retire { .. }
            | Instruction::Restore { .. } => return Outcome::UnknownRound,
            Instruction::Retract { .. } => Some(Word::Retracted),
            Instruction::Was { class: gesture, .. } | Instruction::Right { of: gesture, .. } => {
                class(gesture).map(Word::Was)
            }
            Instruction::Wrong { of, .. } => class(of).map(Word::Not),
        };
        let Some(word) = word else { return Outcome::UnknownGesture };
        let Instructed { by, at, said, .. } = instructed;
        let latest = learning.latest(round, by);
        if latest.is_some_and(|(_, known, _)| instructed.is_late(known)) {
            return Outcome::Known;
        }
        let again = latest.is_some_and(|(.., latest)| latest == word);
        let count = match latest {
            _ if said.is_some() => *at,
            // A neighbour told of it before it was heard.
            Some((count, known, _)) if again && known == *at => count,
            _ => learning.next_count(round),
        };
        let lesson = Lesson { round, instructor: by.clone(), count, at: *at, word, said: said.clone() };
        match learning.hear(&lesson) {
            LessonReceipt::New | LessonReceipt::Known
                if word != Word::Retracted && !learning.is_heeded(round, by) =>
            {
                Outcome::NotAllowed
            }
            LessonReceipt::New if again => Outcome::Known,
            // It is kept all the same: who says so may have been heard elsewhere.
            LessonReceipt::New if word == Word::Retracted && latest.is_none() => Outcome::Known,
            LessonReceipt::New if word != Word::Retracted && !learning.has_seen(round) => {
                Outcome::NothingSeen
            }
            LessonReceipt::New => Outcome::Learned,
            LessonReceipt::Known if again => Outcome::Known,
            // One that was counted higher stands.
            LessonReceipt::Known => Outcome::NotAllowed,
            LessonReceipt::Unproven => Outcome::NotAllowed,
            LessonReceipt::Full | LessonReceipt::FarAhead => Outcome::UnknownRound,
        }
    }

    fn prepare_answer(
        &mut self,
        now: Duration,
        instructed: Instructed,
        outcome: Outcome,
        named: Option<ClassId>,
        turn: Duration,
    ) {
        let Instructed { by, at, instruction, .. } = instructed;
        if self.answers.needs_none(&by, at) {
            return;
        }
        let wait = match outcome {
            // What is taken back another may have heard.
            Outcome::Known if matches!(instruction, Instruction::Retract { .. }) => KNOWS_NOTHING,
            Outcome::Learned | Outcome::Known | Outcome::NotAllowed => Duration::ZERO,
            Outcome::NothingSeen => SAW_NOTHING,
            Outcome::UnknownRound | Outcome::UnknownGesture | Outcome::NoRoom | Outcome::NotLearning => {
                KNOWS_NOTHING
            }
        };
        let (mut class, mut samples, mut revision, mut looks_like) = (named, 0, 0, None);
        if let (Some(learning), Some(round)) = (&self.learning, instruction.round()) {
            // What a round shows may be another gesture than the one that was named with it.
            if !matches!(instruction, Instruction::New { .. }) {
                class = match learning.verdict(round) {
                    Verdict::Class(class) => Some(class),
                    _ => None,
                };
            }
            samples = u32::try_from(learning.held_of(round)).unwrap_or(u32::MAX);
            looks_like = named.and_then(|gesture| self.looked_like(round, Some(gesture)));
        }
        if let Some(learning) = &self.learning {
            revision = learning.pending_revision();
        }
        let answer = Answer { robot: self.me(), at, to: instruction, outcome, class, samples, looks_like };
        let due = now + wait + turn;
        self.answers.wait(Waiting { due, revision, by, answer });
    }

    /// Another robot has answered that word.
    pub(super) fn on_answered(&mut self, by: InstructorId, at: u64, robot: RobotId) -> AboutRounds {
        if robot != self.me() {
            self.answers.note_answered(by, at);
        }
        AboutRounds::Tick
    }

    /// When the next answer is to be given, if what it says is remembered by then.
    pub(super) fn answer_due(&self) -> Option<Duration> {
        self.answers.due(|revision| is_remembered(self.learning.as_ref(), revision))
    }

    pub(super) fn answer_when_due(&mut self, out: &mut Vec<Output>) {
        let (now, learning) = (self.rounds.now(), self.learning.as_ref());
        while let Some((by, answer)) =
            self.answers.take_due(now, |revision| is_remembered(learning, revision))
        {
            out.push(Output::Answer(by, answer));
        }
    }
}

/// Whether what a robot knows as of that revision would survive a kill; there is nothing to survive for one that learns
/// nothing.
fn is_remembered(learning: Option<&Learning>, revision: u64) -> bool {
    learning.is_none_or(|learning| learning.is_remembered(revision))
}
