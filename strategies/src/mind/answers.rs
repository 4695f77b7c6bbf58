//! One answer for each word of an instructor, from the first robot that can give it; and which words were heard.

use std::collections::VecDeque;
use std::time::Duration;

use gestalt_protocol::{Answer, Instruction, InstructorId};

use super::input::Instructed;

/// The most answers that wait, and the most words known to be answered, or heard.
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

/// The answers that wait, the words answered last, by whomever, and those heard last.
#[derive(Clone, Debug, Default)]
pub(super) struct Answers {
    waiting: Vec<Waiting>,
    answered: VecDeque<(InstructorId, u64)>,
    heard: VecDeque<(InstructorId, u64, Instruction)>,
}

impl Answers {
    /// Notes a word of an open swarm; says whether it is no copy of one that was heard lately: networks repeat what they carry.
    pub fn is_news(&mut self, word: &Instructed) -> bool {
        let Instructed { by, at, instruction, .. } = word;
        let same = |heard: &(InstructorId, u64, Instruction)| {
            heard.1 == *at && heard.0 == *by && heard.2 == *instruction
        };
        if self.heard.iter().any(same) {
            return false;
        }
        self.heard.push_back((by.clone(), *at, instruction.clone()));
        if self.heard.len() > MAX_WAITING {
            self.heard.pop_front();
        }
        true
    }

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
