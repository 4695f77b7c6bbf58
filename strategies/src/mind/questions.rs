//! What the swarm asks, and what this robot knows of that: one question at a time, seldom, and never while a round is open.

use std::time::Duration;

use gestalt_protocol::{Ask, Asked, ClassId, Message, Question, Reason};
use gestalt_rounds::{Doubt, Input as AboutRounds, Refusal, outcome};

use super::asks::Passed;
use super::machine::Mind;
use super::output::Output;
use crate::asking::{Occasion, is_unknown, worth_asking};
use crate::learning::Learning;
use crate::lessons::Verdict;

impl Mind {
    /// The swarm's question that waits for its answer.
    #[must_use]
    pub fn question(&self) -> Option<&Question> {
        self.asks.open.as_ref().map(|(question, _)| question)
    }

    /// Another robot asked. What no honest robot would have asked now is refused: else one member, or whoever says again what one asked long ago, could keep all
    /// others from asking, and have an instructor speak of rounds of its choice alone.
    pub(super) fn on_asked(&mut self, now: Duration, question: Question) -> AboutRounds {
        let Some(learning) = self.learning.as_ref().filter(|_| question.robot != self.rounds.me()) else {
            return AboutRounds::Tick;
        };
        let config = &learning.config().questions;
        let is_over = !self.rounds.is_open() && self.rounds.looking().is_none();
        let is_of_newest = self.rounds.is_newest(question.round);
        let is_unsaid = learning.verdict(question.round) == Verdict::Unsaid;
        let is_its_turn =
            self.asks.is_turn_of(question.robot) && self.asks.budget.allows_another(now, config);
        if is_over && is_of_newest && is_unsaid && is_its_turn {
            self.asks.note(now, question, config);
        } else {
            self.rounds.note_refusal(Refusal::Untimely);
        }
        AboutRounds::Tick
    }

    /// Follows the rounds that this robot lives through, and asks when it is to.
    pub(super) fn carry_on_asking(&mut self, now: Duration, passed: Passed, out: &mut Vec<Output>) {
        let Some(learning) = &self.learning else { return };
        self.asks.enter(now, self.rounds.round());
        if let Some((_, robot)) = passed.heard.filter(|(round, _)| self.rounds.is_newest(*round)) {
            self.asks.note_speaker(robot);
        }
        if passed.announced {
            self.asks.note_speaker(self.rounds.me());
            self.asks.due.get_or_insert(now.saturating_add(learning.config().questions.after));
        }
        if passed.closed {
            self.asks.put_off(now, learning.config().questions.after);
        }
        // What is said of its round settles a question, by whomever and whichever way it was heard; silence does not answer it.
        let settled = |(question, until): &mut (Question, Duration)| {
            now >= *until || learning.verdict(question.round) != Verdict::Unsaid
        };
        self.asks.open.take_if(settled);
        if self.asking_due().is_some_and(|due| now >= due) {
            self.asks.due = None;
            if let Some(asked) = self.judge_round(now) {
                let envelope = self.rounds.stamped(Message::Asked(asked));
                if let Some((question, learning)) = Question::of(envelope).zip(self.learning.as_ref()) {
                    self.asks.note(now, question.clone(), &learning.config().questions);
                    out.push(Output::Ask(question));
                }
            }
        }
    }

    /// When this robot is to look whether to ask: never while a round is open, nor while it looks at what is shown.
    fn asking_due(&self) -> Option<Duration> {
        self.asks.due.filter(|_| !self.rounds.is_open() && self.rounds.looking().is_none())
    }

    /// When the mind wants to be woken because of questions.
    pub(super) fn questions_due(&self) -> Option<Duration> {
        let gone = self.asks.open.as_ref().map(|(_, until)| *until);
        [self.asking_due(), gone].into_iter().flatten().min()
    }

    /// What to ask about the round that is over.
    fn judge_round(&mut self, now: Duration) -> Option<Asked> {
        let (learning, held) = (self.learning.as_ref()?, self.rounds.held()?);
        let (round, config) = (held.round, &learning.config().questions);
        if learning.verdict(round) != Verdict::Unsaid {
            return None;
        }
        let rounds = self.rounds.config();
        let doubt = Doubt::of(&held.certificate, rounds.clip);
        let untaught = self.rounds.classifier().is_none() && learning.looks(round) > 0;
        let too_few = matches!(outcome(held, rounds), (_, Reason::TooFewRobots { .. }));
        if doubt.is_none() && !untaught || doubt.is_some() && too_few {
            return None;
        }
        let repeated = is_unknown(doubt.as_ref()) && self.asks.repeats(now, config.repeated);
        let (labels, quiet) = (learning.label_counts(), self.asks.budget.quiet(config));
        let before: Vec<f64> = self.asks.worth.iter().copied().collect();
        let occasion = Occasion {
            doubt: doubt.as_ref(),
            labels: &labels,
            unanswered: &self.asks.unanswered,
            before: &before,
            repeated,
            quiet,
        };
        let (worth, ask) = (occasion.worth(config), worth_asking(&occasion, config));
        self.asks.note_worth(worth);
        if !self.asks.budget.allows(now, config) || !self.asks.is_turn_of(self.rounds.me()) {
            return None;
        }
        let ask = ask?;
        let [entropy, disagreement] = doubt.map_or([0.0; 2], |doubt| [doubt.entropy, doubt.disagreement]);
        Some(Asked { round, ask, labels: labels_of(learning, ask), entropy, disagreement })
    }
}

/// What the gestures of a question are called.
fn labels_of(learning: &Learning, ask: Ask) -> Vec<String> {
    let titles = learning.names().titles(learning.vocabulary().labels());
    let label = |class: ClassId| {
        learning.vocabulary().label(class).or(titles.get(&class).map(String::as_str)).map(str::to_owned)
    };
    ask.classes().into_iter().map(label).collect::<Option<_>>().unwrap_or_default()
}
