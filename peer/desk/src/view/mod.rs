//! The swarm as a client sees it: what is heard goes in, state and events come out. No clock, no network.
//!
//! Whatever is heard twice, or in another order, gives the same state; of two words about one thing the greater wins. And
//! whoever speaks, nothing here grows beyond [`MAX_ROBOTS`], [`MAX_ROUNDS`] and the lengths below.

mod decision;
mod question;
mod robot;
mod round;
mod said;
mod tally;
#[cfg(test)]
pub(crate) mod tests;
mod text;

use std::collections::BTreeMap;
use std::time::Duration;

use gestalt_link::{Heard, begins_anew};
use gestalt_protocol::{
    Announcement, Answer, Gesture, Holding, InstructorId, MAX_ROBOTS, Question, RobotId, RoundId, Status,
    VocabularyId,
};
use gestalt_strategies::Vocabulary;
use serde::Serialize;

pub use decision::{DecisionView, Share, VoteView};
pub use question::{APART, QuestionView, SHOWN, gesture_asked};
pub use robot::{LearningView, RobotView};
pub use round::{CurvePoint, MAX_ROUNDS, RoundView, Verdict};
pub use said::{MAX_SAID, SaidView};
pub use tally::{SECONDS, Tally};
pub use text::clipped;

use question::Asked;
use robot::Robot;
use round::Rounds;
use said::Said;

/// After this long without an answer a robot counts as silent, though its token stands.
pub const SILENT: Duration = Duration::from_secs(5);

/// What a client hears, or finds.
#[derive(Clone, Debug)]
pub enum Input {
    /// A robot's liveliness token came.
    Came(RobotId),
    /// It went.
    Left(RobotId),
    /// A robot's account of itself.
    Status(Box<Status>),
    /// All robots were asked for their status, and that many answered.
    Asked(usize),
    /// The swarm's decision.
    Decided(Box<Announcement>),
    /// Which decision a robot holds.
    Held(RobotId, Box<Holding>),
    /// The swarm's question to its instructor.
    Question(Box<Question>),
    /// The swarm's answer to an instructor.
    Answered(InstructorId, Box<Answer>),
}

impl From<Heard> for Input {
    fn from(heard: Heard) -> Self {
        match heard {
            Heard::Came(robot) => Self::Came(robot),
            Heard::Left(robot) => Self::Left(robot),
            Heard::Decided(announcement) => Self::Decided(Box::new(announcement)),
            Heard::Asked(question) => Self::Question(Box::new(question)),
            Heard::Held(robot, holding) => Self::Held(robot, Box::new(holding)),
        }
    }
}

/// What is new by an [`Input`].
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A robot came.
    Came(RobotId),
    /// A robot left, or was lost.
    Left(RobotId),
    /// A round was decided, or decided otherwise than was heard before.
    Decided(Box<Announcement>),
    /// The swarm asks.
    Question(Box<Question>),
    /// An instructor was answered; of which round, where the word names one.
    Answered(Option<RoundId>),
}

/// The robots, and what is the matter with all of them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SwarmView {
    /// The robots that are there, by id.
    pub robots: Vec<RobotView>,
    /// The labels of the gestures: those that the latest decision chose from, or else those that most robots know.
    pub vocabulary: Vec<String>,
    /// The same as an instructor's words name them.
    pub gestures: Vec<Gesture>,
    /// What keeps this view from being true, with the fix.
    pub trouble: Option<String>,
}

/// What is known of a swarm.
#[derive(Clone, Debug, Default)]
pub struct View {
    robots: BTreeMap<RobotId, Robot>,
    /// The decision of the newest round, whole.
    latest: Option<Announcement>,
    rounds: Rounds,
    said: Said,
    asked: Asked,
    tally: Tally,
    /// Since when no robot has answered, though asked.
    unanswered: Option<Duration>,
}

impl View {
    /// Takes in what was heard at `now`, the time since any fixed moment. Says what is new, which may be nothing.
    pub fn hear(&mut self, now: Duration, input: Input) -> Option<Event> {
        match input {
            Input::Came(id) => self.on_came(now, id),
            Input::Left(id) => self.on_left(id),
            Input::Status(status) => self.on_status(now, *status),
            Input::Asked(answers) => self.on_asked(now, answers),
            Input::Decided(announcement) => self.on_decided(*announcement),
            Input::Held(id, holding) => self.on_held(now, id, *holding),
            Input::Question(question) => self.on_question(now, *question),
            Input::Answered(by, answer) => self.on_answered(by, *answer),
        }
    }

    /// The robots and the gestures they know.
    #[must_use]
    pub fn swarm(&self, now: Duration) -> SwarmView {
        let robots = self.present().map(|(id, robot)| robot.view(*id, now)).collect();
        let known = self.vocabulary();
        let vocabulary = known.map(Vocabulary::shown).unwrap_or_default();
        let class = |label: &str| known.and_then(|known| known.class(label));
        let gestures = vocabulary.iter().map(|label| question::gesture_called(label, class(label))).collect();
        SwarmView { robots, vocabulary, gestures, trouble: self.trouble(now) }
    }

    /// The decision of the newest round with its reasons.
    #[must_use]
    pub fn decision(&self) -> Option<DecisionView> {
        let latest = self.latest.as_ref()?;
        let vocabulary = self.known_vocabulary(latest.decision.certificate.vocabulary);
        let held = self.present().filter_map(|(_, robot)| robot.holds(latest.decision.round));
        let held = held.filter(|held| held.class == latest.decision.class).count();
        Some(DecisionView::new(latest, vocabulary, held))
    }

    /// The same as it was announced.
    #[must_use]
    pub fn latest(&self) -> Option<&Announcement> {
        self.latest.as_ref()
    }

    /// The latest rounds, oldest first.
    #[must_use]
    pub fn rounds(&self) -> Vec<RoundView> {
        self.rounds.views(|id| self.vocabulary_of(id))
    }

    /// How often robots alone, and the swarm, were right lately, for each round of which the gesture is known.
    #[must_use]
    pub fn curve(&self) -> Vec<CurvePoint> {
        self.rounds.curve(|id| self.vocabulary_of(id))
    }

    /// What instructors said and what became of it, latest first.
    #[must_use]
    pub fn said(&self) -> Vec<SaidView> {
        self.said.views(|round, class| {
            let decided = round.and_then(|round| self.rounds.vocabulary(round));
            let vocabulary = decided.and_then(|id| self.known_vocabulary(id));
            text::gesture(class, vocabulary.or_else(|| self.vocabulary()))
        })
    }

    /// The question that waits for its answer.
    #[must_use]
    pub fn question(&self, now: Duration) -> Option<QuestionView> {
        self.asked.at(now).map(QuestionView::from)
    }

    /// What was heard since the view began, counted.
    #[must_use]
    pub fn tally(&self) -> &Tally {
        &self.tally
    }

    /// The counters of each robot that is there, as it reports them.
    pub fn counters(&self) -> impl Iterator<Item = (RobotId, &BTreeMap<String, u64>)> {
        self.present().map(|(id, robot)| (*id, robot.counters()))
    }

    fn present(&self) -> impl Iterator<Item = (&RobotId, &Robot)> {
        self.robots.iter().filter(|(_, robot)| robot.is_there())
    }

    fn vocabulary(&self) -> Option<&Vocabulary> {
        let of_latest = self.latest.as_ref().map(|it| it.decision.certificate.vocabulary);
        let decided = of_latest.and_then(|id| self.known_vocabulary(id));
        decided.or_else(|| {
            let mut known: BTreeMap<&[String], (usize, &Vocabulary)> = BTreeMap::new();
            for vocabulary in self.present().filter_map(|(_, robot)| robot.vocabulary()) {
                let (robots, fullest) = known.entry(vocabulary.labels()).or_insert((0, vocabulary));
                *robots += 1;
                if vocabulary.titles() > fullest.titles() {
                    *fullest = vocabulary;
                }
            }
            known.into_values().max_by_key(|(robots, _)| *robots).map(|(_, vocabulary)| vocabulary)
        })
    }

    /// The gestures that votes of that vocabulary are about. A round in which nobody could tell any was about those that the
    /// swarm knows now.
    fn vocabulary_of(&self, id: VocabularyId) -> Option<&Vocabulary> {
        self.known_vocabulary(id).or_else(|| self.vocabulary().filter(|_| id == VocabularyId::NONE))
    }

    /// Robots of one list do not all know what was named beside it: who does not learn has heard of nothing.
    fn known_vocabulary(&self, id: VocabularyId) -> Option<&Vocabulary> {
        let of_list = self.robots.values().filter(|robot| robot.vocabulary_id() == Some(id));
        // Reversed, because of equal maxima the last one is returned.
        of_list.rev().filter_map(Robot::vocabulary).max_by_key(|vocabulary| vocabulary.titles())
    }

    fn trouble(&self, now: Duration) -> Option<String> {
        let since = self.unanswered?;
        let seconds = now.saturating_sub(since).as_secs();
        (seconds >= 2).then(|| {
            format!(
                "no robot answers since {seconds} s: see that robots of this swarm run (gestalt peer), and that the endpoint \
                 given with -e is one of theirs"
            )
        })
    }

    /// The robot of that name, if there is room for one more.
    fn robot(&mut self, id: RobotId, now: Duration) -> Option<&mut Robot> {
        if !self.robots.contains_key(&id) && self.robots.len() >= MAX_ROBOTS {
            // Those without a token are what a status made up, or left behind.
            let gone = self.robots.iter().find(|(_, robot)| !robot.is_there()).map(|(id, _)| *id);
            let Some(gone) = gone else {
                self.tally.refused += 1;
                return None;
            };
            self.robots.remove(&gone);
        }
        Some(self.robots.entry(id).or_insert_with(|| Robot::new(now)))
    }

    fn on_came(&mut self, now: Duration, id: RobotId) -> Option<Event> {
        self.robot(id, now)?.come(now).then_some(Event::Came(id))
    }

    fn on_left(&mut self, id: RobotId) -> Option<Event> {
        let was_there = self.robots.remove(&id).is_some_and(|robot| robot.is_there());
        was_there.then_some(Event::Left(id))
    }

    fn on_status(&mut self, now: Duration, status: Status) -> Option<Event> {
        let id = status.robot;
        self.robot(id, now)?.tell(now, status);
        None
    }

    fn on_asked(&mut self, now: Duration, answers: usize) -> Option<Event> {
        if answers > 0 {
            self.unanswered = None;
        } else {
            self.unanswered.get_or_insert(now);
        }
        // A status of a robot whose token never came, or went before the answer was here.
        self.robots.retain(|_, robot| robot.is_there() || !robot.is_silent(now));
        if let Some(newest) = self.present().filter_map(|(_, robot)| robot.newest_round()).max() {
            self.forget_impossible(newest);
        }
        None
    }

    /// Whoever reaches a port can announce round 4 294 967 295, after which no other would be the newest. What no robot comes
    /// near is forgotten.
    fn forget_impossible(&mut self, newest: u32) {
        const AHEAD: u32 = 16;
        let most = newest.saturating_add(AHEAD);
        self.rounds.forget_after(most);
        self.latest.take_if(|latest| latest.decision.round.counter > most);
    }

    fn on_decided(&mut self, announcement: Announcement) -> Option<Event> {
        let decision = &announcement.decision;
        if !self.rounds.is_decided(decision.round) && self.begins_anew(decision.round) {
            self.rounds.forget_after(decision.round.counter);
            self.latest = None;
        }
        let (is_first, is_new) = self.rounds.decide(decision, announcement.label.as_deref());
        if is_first {
            self.tally.count_decision(decision);
        }
        if is_new && self.latest.as_ref().is_none_or(|latest| latest.decision.round <= decision.round) {
            self.latest = Some(announcement.clone());
        }
        is_new.then(|| Event::Decided(Box::new(announcement)))
    }

    /// Whether a round before the latest is of a swarm that started again, and counts from one: whoever is there knows of none as late as the latest.
    /// Where nobody is asked what they know, its name says it.
    fn begins_anew(&self, round: RoundId) -> bool {
        let Some(latest) = self.latest.as_ref().map(|latest| latest.decision.round) else { return false };
        let mut known =
            self.present().filter_map(|(_, robot)| robot.status()).map(|status| status.round).peekable();
        if known.peek().is_none() {
            return begins_anew(latest, round);
        }
        let is_another_start = (round.opener, round.life) != (latest.opener, latest.life);
        round < latest && is_another_start && known.all(|known| known < Some(latest))
    }

    fn on_held(&mut self, now: Duration, id: RobotId, holding: Holding) -> Option<Event> {
        self.robot(id, now)?.hold(&holding);
        None
    }

    fn on_question(&mut self, now: Duration, question: Question) -> Option<Event> {
        // Robots ask about their newest round alone.
        let is_earlier =
            self.latest.as_ref().is_some_and(|latest| question.round.counter < latest.decision.round.counter);
        let is_old = is_earlier && !self.begins_anew(question.round);
        if is_old || !self.asked.ask(now, question.clone()) {
            return None;
        }
        self.tally.count_question(&question.ask);
        Some(Event::Question(Box::new(question)))
    }

    fn on_answered(&mut self, by: InstructorId, answer: Answer) -> Option<Event> {
        let round = answer.to.round();
        if let Some(round) = round {
            self.asked.answer(round, answer.outcome);
        }
        if !self.said.note(&by, &answer) {
            return None;
        }
        self.tally.count_answer(answer.outcome);
        if let Some(round) = round {
            self.rounds.answer(round, by, &answer);
        }
        Some(Event::Answered(round))
    }
}
