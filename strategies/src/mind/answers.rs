//! One answer for each word of an instructor, from the first robot that can give it.

use std::collections::VecDeque;
use std::time::Duration;

use gestalt_protocol::{Answer, InstructorId};

/// The most answers that wait, and the most words known to be answered.
const MAX_WAITING: usize = 64;

/// An answer that waits for its turn, and until what it says is remembered.
#[derive(Clone, Debug)]
pub(super) struct Waiting {
    pub due: Duration,
    /// The revision that what it says is remembered with.
    pub revision: u64,
    pub by: InstructorId,
    pub answer: Answer,
}

/// The answers that wait, and the words answered last, by whomever.
#[derive(Clone, Debug, Default)]
pub(super) struct Answers {
    waiting: Vec<Waiting>,
    answered: VecDeque<(InstructorId, u64)>,
}

impl Answers {
    /// Whether there is nothing to answer: the word is answered, or its answer waits, or too many do.
    pub fn needs_none(&self, by: &InstructorId, at: u64) -> bool {
        let known = self.waiting.iter().any(|w| w.by == *by && w.answer.at == at);
        known || self.answered.contains(&(by.clone(), at)) || self.waiting.len() >= MAX_WAITING
    }

    pub fn wait(&mut self, waiting: Waiting) {
        self.waiting.push(waiting);
    }

    /// That word has its answer. It may come before the word itself.
    pub fn note_answered(&mut self, by: InstructorId, at: u64) {
        self.waiting.retain(|waiting| waiting.by != by || waiting.answer.at != at);
        self.answered.push_back((by, at));
        if self.answered.len() > MAX_WAITING {
            self.answered.pop_front();
        }
    }

    /// When the next answer is to be given, of those whose revision `is_remembered`.
    pub fn due(&self, is_remembered: impl Fn(u64) -> bool) -> Option<Duration> {
        self.waiting.iter().filter(|waiting| is_remembered(waiting.revision)).map(|w| w.due).min()
    }

    /// The answer to be given now, if there is one.
    pub fn take_due(
        &mut self,
        now: Duration,
        is_remembered: impl Fn(u64) -> bool,
    ) -> Option<(InstructorId, Answer)> {
        let due = |waiting: &Waiting| now >= waiting.due && is_remembered(waiting.revision);
        let position = self.waiting.iter().position(due)?;
        let Waiting { by, answer, .. } = self.waiting.remove(position);
        self.note_answered(by.clone(), answer.at);
        Some((by, answer))
    }
}
