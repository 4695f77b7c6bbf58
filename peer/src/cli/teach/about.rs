//! What the words of a person at a keyboard are about.

use std::time::Instant;

use gestalt_protocol::{ClassId, Decision, Gesture, Instruction, Question, RoundId};

use gestalt_desk::{APART, SHOWN, Word, gesture_asked};

/// What was heard and said so far, as far as the next word may be about it.
#[derive(Debug, Default)]
pub(super) struct About {
    /// Whether it is the round of the command line that words are about, whatever is decided meanwhile.
    is_named: bool,
    /// The round that words are about, and what was decided of it.
    last: Option<(RoundId, Option<ClassId>)>,
    /// Whether that decision was final.
    is_final: bool,
    /// The round of which something was said last.
    said: Option<RoundId>,
    /// The newest round of which it is known that it was decided.
    newest: Option<u32>,
    /// What the swarm asked last, and when.
    asked: Option<(Question, Instant)>,
    /// When it asked last, answered or not.
    last_asked: Option<Instant>,
}

/// What was typed.
#[derive(Debug, PartialEq)]
pub(super) enum Typed {
    /// A word, of the round that was decided last or of none.
    Word(Word),
    /// The answer to a question: this gesture.
    Answer(Question, Gesture),
    /// That it is none of the gestures of a question; which one, the next line may say.
    Neither,
}

impl About {
    /// Words are about that round, if one was named, or else about the one that was decided last.
    pub fn new(named: Option<RoundId>, last: Option<&Decision>) -> Self {
        let newest = last.map(|last| last.round.counter);
        let decided = last.filter(|last| named.is_none_or(|named| named == last.round));
        let of = named.or(last.map(|last| last.round));
        let last = of.map(|round| (round, decided.and_then(|decided| decided.class)));
        let is_final = decided.is_some_and(|decided| decided.is_final);
        Self { is_named: named.is_some(), last, is_final, newest, ..Self::default() }
    }

    /// The swarm decided, whoever had it look: words are about what a person has just seen. What comes late of another round than the newest, or
    /// again and less sure, is no news.
    pub fn hear(&mut self, decision: &Decision, is_newest: bool) {
        if !is_newest {
            return;
        }
        let round = decision.round;
        self.newest = Some(round.counter);
        let news = self
            .last
            .is_none_or(|(known, _)| !known.may_merge(&round) || decision.is_final || !self.is_final);
        if news && !self.is_named {
            (self.last, self.is_final) = (Some((round, decision.class)), decision.is_final);
        }
    }

    /// The round that a word is about, and what was decided of it: what is withdrawn is what was said last, of whichever round that was.
    pub fn of(&self, word: &Word) -> Option<(RoundId, Option<ClassId>)> {
        match self.said {
            Some(said) if *word == Word::Undo => Some((said, None)),
            _ => self.last,
        }
    }

    /// That is said to the swarm.
    pub fn say(&mut self, instruction: &Instruction) {
        self.said = instruction.round().or(self.said);
    }

    /// The swarm asks; whether that is to be shown. Where a robot dies while it asks, the next may ask the same; and who asks of earlier rounds, of one that was
    /// spoken of, or without end, is no robot in good order.
    pub fn ask(&mut self, now: Instant, question: &Question) -> bool {
        let is_known = self.question(now).is_some_and(|known| known.round == question.round);
        let is_over = self.newest > Some(question.round.counter) || self.said == Some(question.round);
        let is_soon = self.last_asked.is_some_and(|last| now.saturating_duration_since(last) < APART);
        if is_known || is_over || is_soon {
            return false;
        }
        (self.asked, self.last_asked) = (Some((question.clone(), now)), Some(now));
        true
    }

    /// The question that waits for its answer.
    fn question(&self, now: Instant) -> Option<&Question> {
        let (question, asked) = self.asked.as_ref()?;
        (now.saturating_duration_since(*asked) < SHOWN).then_some(question)
    }

    /// What was typed. While a question waits, a gesture that it asks about answers it, though it is called as a command is: whoever types it was just asked for
    /// that name. What is no command is a gesture's name then.
    ///
    /// # Errors
    /// What there is to type instead.
    pub fn read(&mut self, now: Instant, words: &[&str]) -> Result<Typed, String> {
        let typed = words.join(" ");
        let Some(question) = self.question(now).cloned() else { return Word::read(words).map(Typed::Word) };
        let is_asked = question.names().contains(&typed);
        match Word::read(words) {
            Ok(word) if !is_asked => Ok(Typed::Word(word)),
            Err(_) if !is_asked && typed == "neither" => {
                self.asked = Some((question, now));
                Ok(Typed::Neither)
            }
            _ => {
                // Until the swarm has taken the answer: it may be typed wrong.
                self.asked = Some((question.clone(), now));
                let gesture = gesture_asked(&question, &typed);
                Ok(Typed::Answer(question, gesture))
            }
        }
    }

    /// The swarm has taken an answer to the question about that round.
    pub fn settle(&mut self, round: RoundId) {
        self.asked.take_if(|(question, _)| question.round == round);
    }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::{Ask, RobotId, Stamp};
    use serde_json::json;

    use super::*;

    fn round(counter: u32) -> RoundId {
        RoundId { counter, opener: RobotId(1), life: 7 }
    }

    fn decided(counter: u32, class: u32, is_final: bool) -> Decision {
        let certificate = json!({
            "vocabulary": 1, "rule": "majority", "probabilities": [], "votes": [], "others": [],
            "robots": 1, "quorum": 1, "elapsed_ms": 1
        });
        let certificate = serde_json::from_value(certificate).unwrap();
        Decision {
            round: round(counter),
            class: Some(ClassId(class)),
            confidence: 1.0,
            author: RobotId(1),
            is_final,
            certificate,
        }
    }

    fn called(label: &str) -> Gesture {
        Gesture::Label(label.to_owned())
    }

    fn question(counter: u32, labels: [&str; 2]) -> Question {
        Question {
            round: round(counter),
            ask: Ask::Between { classes: [ClassId(2), ClassId(3)] },
            labels: labels.map(str::to_owned).to_vec(),
            entropy: 0.5,
            disagreement: 0.5,
            robot: RobotId(1),
            stamp: Stamp::default(),
            signature: None,
        }
    }

    #[test]
    fn words_are_about_the_newest_round_unless_one_was_named() {
        let mut about = About::new(None, Some(&decided(5, 3, true)));
        about.hear(&decided(6, 4, false), true);
        assert_eq!(about.of(&Word::Wrong), Some((round(6), Some(ClassId(4)))), "whoever opened it");
        about.hear(&decided(6, 3, true), true);
        about.hear(&decided(6, 4, false), true);
        about.hear(&decided(5, 1, true), false);
        assert_eq!(about.last, Some((round(6), Some(ClassId(3)))), "the final one, and none before it");
        let mut named = About::new(Some(round(5)), Some(&decided(6, 4, true)));
        named.hear(&decided(7, 4, true), true);
        assert_eq!(named.last, Some((round(5), None)));
        let mut none = About::new(None, None);
        assert_eq!(none.of(&Word::Undo), None);
        none.hear(&decided(1, 2, true), true);
        assert_eq!(none.of(&Word::Undo), Some((round(1), Some(ClassId(2)))));
    }

    #[test]
    fn words_are_about_the_rounds_of_a_swarm_that_started_again() {
        let again = |counter, is_final| {
            let mut decided = decided(counter, 4, is_final);
            decided.round.life = 8;
            decided
        };
        for before in [1, 5] {
            let mut about = About::new(None, Some(&decided(before, 3, true)));
            about.hear(&again(1, false), true);
            about.hear(&decided(before, 3, true), false);
            about.hear(&again(1, true), true);
            assert_eq!(about.last, Some((again(1, true).round, Some(ClassId(4)))));
            let asked = Question { round: again(1, true).round, ..question(1, ["a", "b"]) };
            assert!(about.ask(Instant::now(), &asked));
        }
    }

    #[test]
    fn undo_withdraws_what_was_said_last_whatever_round_that_was_of() {
        let mut about = About::new(None, Some(&decided(5, 3, true)));
        let was = |counter| Instruction::Was { round: round(counter), class: Gesture::Class(ClassId(2)) };
        about.say(&was(5));
        // A question about another round is answered, and another round is decided.
        about.say(&was(8));
        about.hear(&decided(9, 1, true), true);
        about.say(&Instruction::Retire { class: Gesture::Class(ClassId(1)) });
        let (of, decided) = about.of(&Word::Undo).unwrap();
        assert_eq!(Word::Undo.about(of, decided), Ok(Some(Instruction::Retract { round: round(8) })));
        assert_eq!(
            about.of(&Word::Wrong),
            Some((round(9), Some(ClassId(1)))),
            "all else is about the newest"
        );
    }

    #[test]
    fn a_question_is_answered_by_its_gestures_though_they_are_called_as_commands_are() {
        let (mut now, mut about) = (Instant::now(), About::new(None, Some(&decided(5, 3, true))));
        assert_eq!(about.read(now, &["right"]), Ok(Typed::Word(Word::Right)), "nothing was asked");
        let left_or_right = question(5, ["left", "right"]);
        for label in ["left", "right"] {
            now += APART;
            assert!(about.ask(now, &left_or_right));
            assert!(!about.ask(now, &left_or_right), "shown once");
            let answer = Typed::Answer(left_or_right.clone(), called(label));
            assert_eq!(about.read(now, &[label]), Ok(answer));
            about.settle(round(5));
        }
        assert_eq!(about.read(now, &["right"]), Ok(Typed::Word(Word::Right)), "it was answered");
        now += APART;
        assert!(about.ask(now, &left_or_right));
        assert_eq!(about.read(now, &["wrong"]), Ok(Typed::Word(Word::Wrong)));
        assert_eq!(about.read(now, &["neither"]), Ok(Typed::Neither));
        let circle = Typed::Answer(left_or_right, called("big circle"));
        assert_eq!(about.read(now, &["big", "circle"]), Ok(circle));
        about.settle(round(5));
        let odd = question(6, ["neither", "undo"]);
        now += APART;
        assert!(about.ask(now, &odd));
        assert_eq!(about.read(now, &["neither"]), Ok(Typed::Answer(odd.clone(), called("neither"))));
        about.settle(round(6));
        now += APART;
        assert!(about.ask(now, &odd));
        assert_eq!(about.read(now + SHOWN, &["undo"]), Ok(Typed::Word(Word::Undo)), "nobody waits any more");
        assert!(about.read(now + SHOWN, &["circle"]).is_err());
    }

    #[test]
    fn a_question_waits_until_an_answer_was_taken_and_its_gestures_are_those_that_it_asked_about() {
        let (now, mut about) = (Instant::now(), About::new(None, Some(&decided(5, 3, true))));
        let loop_of_ana = ClassId::named(&"ana".parse().unwrap(), "loop");
        let ask = Ask::Between { classes: [ClassId(2), loop_of_ana] };
        let asked = Question { ask, ..question(5, ["two", "loop"]) };
        assert!(about.ask(now, &asked));
        let answers = [("tow", called("tow")), ("loop", Gesture::Class(loop_of_ana)), ("two", called("two"))];
        for (typed, gesture) in answers {
            assert_eq!(about.read(now, &[typed]), Ok(Typed::Answer(asked.clone(), gesture)));
        }
        about.settle(round(4));
        assert!(about.read(now, &["two"]).is_ok(), "another round was spoken of");
        about.settle(round(5));
        assert!(about.read(now, &["two"]).is_err());
    }

    #[test]
    fn who_asks_without_end_or_of_what_is_over_is_shown_no_more_than_a_swarm_asks() {
        let (start, mut about) = (Instant::now(), About::new(None, Some(&decided(5, 3, true))));
        assert!(!about.ask(start, &question(4, ["a", "b"])), "of an earlier round");
        about.say(&Instruction::Right { round: round(5), of: Gesture::Class(ClassId(3)) });
        assert!(!about.ask(start, &question(5, ["a", "b"])), "of one that was spoken of");
        let at = |n: u32| start + std::time::Duration::from_millis(100) * n;
        let shown = (0..1000).filter(|n| about.ask(at(*n), &question(6 + n, ["a", "b"])));
        assert_eq!(shown.count(), 13, "in 100 s, one in 8");
    }
}
