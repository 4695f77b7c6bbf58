//! The question that the swarm asks now.

use std::time::Duration;

use gestalt_protocol::{ClassId, Gesture, Outcome, Question, RobotId, RoundId};
use serde::Serialize;

use super::text::{clipped, finite};

/// How long it is shown: as long as robots wait for its answer, unless they are told otherwise.
pub const SHOWN: Duration = Duration::from_secs(15);

/// How long after one another is shown at the earliest: robots ask 10 s apart, unless they are told otherwise, and what they say is under way for a while. Whoever
/// asks more is no robot in good order.
pub const APART: Duration = Duration::from_secs(8);

/// A question as a reader of the page is shown it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct QuestionView {
    /// The round that it is about, and that an answer names.
    pub round: RoundId,
    /// `between`, `again` or `name`.
    pub kind: &'static str,
    /// The question in words.
    pub words: String,
    /// What the gestures are called that it names.
    pub gestures: Vec<String>,
    /// The same as the words that answer it name them.
    pub answers: Vec<Gesture>,
    /// Who asks.
    pub robot: RobotId,
    /// See [`Question::entropy`].
    pub entropy: f64,
    /// See [`Question::disagreement`].
    pub disagreement: f64,
}

/// The latest question, until it is answered or nobody did in time.
#[derive(Clone, Debug, Default)]
pub(super) struct Asked {
    open: Option<(Question, Duration)>,
    /// When the last one was heard, answered or not.
    last: Option<Duration>,
}

impl Asked {
    /// Takes in a question. Says whether it is new: where a robot dies while it asks, the next may ask the same.
    pub fn ask(&mut self, now: Duration, question: Question) -> bool {
        let is_known = self.at(now).is_some_and(|known| known.round == question.round);
        if is_known || self.last.is_some_and(|last| now < last.saturating_add(APART)) {
            return false;
        }
        (self.open, self.last) = (Some((question, now)), Some(now));
        true
    }

    /// A word on that round was answered: where it was heeded, the question is settled.
    pub fn answer(&mut self, round: RoundId, outcome: Outcome) {
        self.open.take_if(|(question, _)| !outcome.is_refusal() && question.round == round);
    }

    /// The one that waits for its answer.
    pub fn at(&self, now: Duration) -> Option<&Question> {
        let (question, heard) = self.open.as_ref()?;
        (now < heard.saturating_add(SHOWN)).then_some(question)
    }
}

impl From<&Question> for QuestionView {
    fn from(question: &Question) -> Self {
        Self {
            round: question.round,
            kind: question.ask.kind(),
            words: clipped(&question.to_string()),
            gestures: question.names().iter().map(|name| clipped(name)).collect(),
            answers: question.names().iter().map(|name| gesture_asked(question, name)).collect(),
            robot: question.robot,
            entropy: finite(question.entropy),
            disagreement: finite(question.disagreement),
        }
    }
}

/// The gesture that a word names which answers a question by what it calls one. Of those that were named it is the one that was asked about:
/// whoever answers may have named another so.
#[must_use]
pub fn gesture_asked(question: &Question, name: &str) -> Gesture {
    let mut named = question.names().into_iter().zip(question.ask.classes());
    let class = named.find(|(known, _)| known == name).map(|(_, class)| class);
    // Without labels its names are numbers.
    match class.filter(|_| question.labels.is_empty()) {
        Some(class) => Gesture::Class(class),
        None => gesture_called(name, class),
    }
}

/// A gesture as a word names it: one of the list by its label, which means the same whatever list a robot has; one that was named by its number, for
/// another can bear its label.
pub(super) fn gesture_called(label: &str, class: Option<ClassId>) -> Gesture {
    class.filter(|class| class.is_named()).map_or_else(|| Gesture::Label(label.to_owned()), Gesture::Class)
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::{Ask, Stamp};

    use super::*;

    fn question(counter: u32) -> Question {
        Question {
            round: RoundId { counter, opener: RobotId(1), life: 0 },
            ask: Ask::Between { classes: [ClassId(2), ClassId(3)] },
            labels: vec!["two".to_owned(), "three".to_owned()],
            entropy: 0.5,
            disagreement: 0.25,
            robot: RobotId(1),
            stamp: Stamp::default(),
            signature: None,
        }
    }

    #[test]
    fn it_is_answered_by_the_gestures_that_it_asks_about() {
        let circle = ClassId::named(&"ana".parse().unwrap(), "circle");
        let ask = Ask::Between { classes: [ClassId(2), circle] };
        let asked = Question { ask, labels: vec!["two".to_owned(), "circle".to_owned()], ..question(5) };
        let two = Gesture::Label("two".to_owned());
        assert_eq!(QuestionView::from(&asked).answers, [two, Gesture::Class(circle)]);
        let unnamed = Question { labels: vec![], ..asked.clone() };
        assert_eq!(gesture_asked(&unnamed, "2"), Gesture::Class(ClassId(2)));
        assert_eq!(gesture_asked(&asked, "2"), Gesture::Label("2".to_owned()));
    }

    #[test]
    fn it_stands_until_it_is_answered_or_for_a_while() {
        let second = Duration::from_secs;
        let mut asked = Asked::default();
        assert!(asked.ask(second(1), question(5)));
        assert!(!asked.ask(second(2), question(5)), "who takes over may ask it again");
        let view = QuestionView::from(asked.at(second(2)).unwrap());
        assert_eq!((view.kind, view.words.as_str()), ("between", "\"two\" or \"three\"?"));
        asked.answer(question(4).round, Outcome::Learned);
        asked.answer(question(5).round, Outcome::NotAllowed);
        assert!(asked.at(second(15)).is_some() && asked.at(second(16)).is_none());
        assert!(asked.ask(second(20), question(8)));
        asked.answer(question(8).round, Outcome::Learned);
        assert_eq!(asked.at(second(20)), None);
    }

    #[test]
    fn who_asks_without_end_is_shown_no_more_than_a_swarm_asks() {
        let mut asked = Asked::default();
        let shown = (0..1000).filter(|n| asked.ask(Duration::from_millis(100 * n), question(*n as u32)));
        assert_eq!(shown.count(), 13, "in 100 s, one in 8");
    }
}
