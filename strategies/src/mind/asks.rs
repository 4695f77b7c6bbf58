//! What this robot knows of the swarm's questions.

use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;

use gestalt_protocol::{ClassId, Question, RobotId, RoundId};
use gestalt_rounds::{Input as AboutRounds, Output as OfRounds};

use crate::asking::{QuestionBudget, QuestionsConfig};

/// With how many rounds before it a round is compared.
const COMPARED: usize = 6;

/// Of at most so many gestures is remembered that they were asked about.
const MOST_UNANSWERED: usize = 1024;

/// What came of one input for the rounds that this robot lives through.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Passed {
    /// It announced a decision.
    pub announced: bool,
    /// It looks at a round no more.
    pub closed: bool,
    /// It heard that robot announce what became of that round.
    pub heard: Option<(RoundId, RobotId)>,
}

impl Passed {
    /// Of what is about to be taken in.
    pub fn of(input: &AboutRounds) -> Self {
        let heard = match input {
            AboutRounds::Announced(said) => Some((said.decision.round, said.announcer)),
            _ => None,
        };
        Self { heard, ..Self::default() }
    }

    pub fn note(&mut self, output: &OfRounds) {
        self.announced |= matches!(output, OfRounds::Announce(_));
        self.closed |= matches!(output, OfRounds::Closed(_));
    }
}

/// What this robot knows of the swarm's questions.
#[derive(Clone, Debug, Default)]
pub(super) struct Asks {
    pub budget: QuestionBudget,
    /// The counter of the newest round that was counted.
    pub counted: Option<u32>,
    /// Of the robots that announced what became of the newest round the one of the smallest number: it speaks for the swarm.
    speaker: Option<RobotId>,
    /// Whether the last question came from another robot than that.
    out_of_turn: bool,
    /// When this robot, having announced what became of the newest round, looks whether to ask about it.
    pub due: Option<Duration>,
    /// The question that waits for its answer, and until when.
    pub open: Option<(Question, Duration)>,
    /// The gestures that were asked about as the likeliest, since anybody said of a round what it showed.
    pub unanswered: BTreeSet<ClassId>,
    /// When something unknown was last shown.
    pub unknown: Option<Duration>,
    /// What labels of the latest rounds were worth of which nobody said what they showed: at most [`COMPARED`].
    pub worth: VecDeque<f64>,
}

impl Asks {
    /// The newest round is that one.
    pub fn enter(&mut self, now: Duration, round: Option<RoundId>) {
        let counter = round.map(|round| round.counter);
        if counter != self.counted {
            // Of what was asked in rounds that it missed it has not heard.
            if self.counted.zip(counter).is_some_and(|(before, counter)| counter > before.saturating_add(1)) {
                self.budget = QuestionBudget::default();
            }
            self.counted = counter;
            self.budget.enter(now);
            // What was not asked in time is not asked.
            (self.due, self.speaker) = (None, None);
        }
    }

    /// That robot announced what became of the newest round.
    pub fn note_speaker(&mut self, robot: RobotId) {
        self.speaker = Some(self.speaker.map_or(robot, |speaker| speaker.min(robot)));
    }

    /// Whether that robot may ask about the newest round, if anyone may: it speaks for the swarm, or the one before that asked did. Whoever asks the moment a
    /// round is over, before others do, so has every other turn at most; and whoever asks where its announcement was lost is heard.
    pub fn is_turn_of(&self, robot: RobotId) -> bool {
        self.speaker == Some(robot) || !self.out_of_turn
    }

    /// Puts off by whole periods what was to be asked while the round was open still: several may have announced it, each in its turn, and
    /// would now all ask at once.
    pub fn put_off(&mut self, now: Duration, period: Duration) {
        if let Some(due) = self.due.as_mut().filter(|due| **due <= now && !period.is_zero()) {
            let missed = (now - *due).as_nanos() / period.as_nanos() + 1;
            *due = due.saturating_add(period.saturating_mul(u32::try_from(missed).unwrap_or(u32::MAX)));
        }
    }

    /// That was asked, by this robot or another.
    pub fn note(&mut self, now: Duration, question: Question, config: &QuestionsConfig) {
        self.budget.spend(now);
        self.due = None;
        self.out_of_turn = self.speaker != Some(question.robot);
        if self.unanswered.len() < MOST_UNANSWERED {
            self.unanswered.extend(question.ask.classes().first());
        }
        self.open = Some((question, now.saturating_add(config.gone)));
    }

    /// Notes that something unknown was shown; says whether it was before, lately.
    pub fn repeats(&mut self, now: Duration, within: Duration) -> bool {
        self.unknown.replace(now).is_some_and(|before| now <= before.saturating_add(within))
    }

    /// Notes what a label of a round is worth.
    pub fn note_worth(&mut self, worth: f64) {
        self.worth.push_back(worth);
        if self.worth.len() > COMPARED {
            self.worth.pop_front();
        }
    }
}
