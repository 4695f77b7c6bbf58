//! What is asked, and what the instructor answers.

use std::time::Duration;

use gestalt_protocol::{Ask, ClassId, Question, RoundId};
use gestalt_strategies::{Doubt, Mind, QuestionBudget};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::Swarm;
use super::queue::Due;
use crate::emulation::answering::AskedBy;
use crate::emulation::teaching::{Feedback, Teaching};

/// How long an instructor takes to answer.
pub(super) const THINKS: Duration = Duration::from_millis(800);

/// Less than this between the two likeliest outcomes is no lead.
const NO_LEAD: f64 = 0.5;

/// As many nats are no certainty.
const UNSURE: f64 = 0.35;

/// What was asked and answered so far.
pub(super) struct Asking {
    /// Of those who ask in the swarm's place.
    budget: QuestionBudget,
    rng: ChaCha8Rng,
    pub questions: u32,
    /// How often the instructor named a gesture, or said right or wrong.
    pub labels: u32,
}

impl Asking {
    pub fn new(rng: ChaCha8Rng) -> Self {
        Self { budget: QuestionBudget::default(), rng, questions: 0, labels: 0 }
    }
}

impl Swarm<'_> {
    /// A robot asks. The instructor stands at it.
    pub(super) fn hear_question(&mut self, i: usize, question: &Question) {
        let asked = |teaching: &Teaching| {
            teaching.feedback == Feedback::Asked && teaching.answering.asked_by == AskedBy::Swarm
        };
        if !self.scenario.learning.as_ref().is_some_and(asked) {
            return;
        }
        self.asking.questions += 1;
        // Who is asked to show it again shows it again, another time; and says nothing.
        if !matches!(question.ask, Ask::Again { .. }) {
            self.at(self.now + THINKS, Due::Reply(i, question.round, question.ask));
        }
    }

    /// Whether somebody who asks in the swarm's place asks about the round at that robot.
    pub(super) fn is_asked(&mut self, i: usize) -> bool {
        let Some(teaching) = &self.scenario.learning else { return false };
        let questions = &teaching.robots.questions;
        self.asking.budget.enter(self.now);
        if !self.asking.budget.allows(self.now, questions) {
            return false;
        }
        let held = self.robots[i].mind.as_ref().and_then(Mind::held);
        let doubt = held.and_then(|held| {
            let probabilities = &held.certificate.probabilities;
            let mut outcomes: Vec<f64> =
                probabilities.iter().copied().chain(held.certificate.unknown).collect();
            outcomes.sort_by(|a, b| b.total_cmp(a));
            let lead = outcomes.first()? - outcomes.get(1)?;
            Some((Doubt::of(&held.certificate, self.scenario.mind.clip)?.entropy, lead))
        });
        // Who was never taught anything cannot be more unsure.
        let asks = match teaching.answering.asked_by {
            AskedBy::Swarm => false,
            AskedBy::Random => self.asking.rng.random(),
            AskedBy::Entropy => doubt.is_none_or(|(entropy, _)| entropy >= UNSURE),
            AskedBy::Margin => doubt.is_none_or(|(_, lead)| lead < NO_LEAD),
        };
        if asks {
            self.asking.budget.spend(self.now);
            self.asking.questions += 1;
        }
        asks
    }

    /// The gesture that the instructor names: the one shown, or where they err, the other one asked about, or any other.
    pub(super) fn names(&mut self, ask: Option<Ask>) -> ClassId {
        // Both are drawn for each answer: whether one is wrong does not shift what is drawn for the next. Who asks by chance draws from the same
        // stream, so where others ask other showings are answered wrongly.
        let (errs, which): (bool, u64) = (self.errs(), self.asking.rng.random());
        if !errs {
            return self.shown;
        }
        if let Some(Ask::Between { classes: [a, b] }) = ask {
            if self.shown == a {
                return b;
            }
            if self.shown == b {
                return a;
            }
        }
        let others: Vec<ClassId> =
            (0..).map(ClassId).take(self.scenario.classes).filter(|class| *class != self.shown).collect();
        others.get((which % others.len().max(1) as u64) as usize).copied().unwrap_or(self.shown)
    }

    /// Whether the instructor errs this time.
    pub(super) fn errs(&mut self) -> bool {
        let wrong = self.scenario.learning.as_ref().map_or(0.0, |teaching| teaching.answering.wrong);
        self.asking.rng.random::<f64>() < wrong
    }

    /// The instructor answers, if that round is still the newest.
    pub(super) fn reply(&mut self, i: usize, round: RoundId, ask: Ask) {
        let newest = self.robots[i].mind.as_ref().and_then(Mind::round);
        if newest.is_some_and(|newest| newest.counter == round.counter) {
            let class = self.names(Some(ask));
            self.tell_class(i, round, class);
        }
    }
}
