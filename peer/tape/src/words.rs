//! What one person said of one showing, and what robots answered.

use gestalt_protocol::{Answer, Instruction, Outcome};

/// How many words of one person about one showing are kept.
const MAX_WORDS: usize = 16;

/// The latest words of one person about one showing, as they were heard.
#[derive(Clone, Debug, Default)]
pub struct Words(Vec<Said>);

#[derive(Clone, Debug)]
struct Said {
    word: Instruction,
    /// When the word itself was said, once it was heard: its answer may come before it.
    heard: Option<u64>,
    /// The time by which robots answered it: two that answer one word name one.
    answered: Option<u64>,
    /// Whether a robot took it,
    taken: bool,
    /// and whether one refused it.
    refused: bool,
}

impl Words {
    /// Takes in a word that was said at that time. Networks repeat what they carry: a copy is no other word.
    pub(crate) fn hear(&mut self, word: Instruction, at: u64) {
        if self.0.iter().any(|said| said.heard == Some(at) && said.word == word) {
            return;
        }
        let early = self.0.iter().position(|said| said.heard.is_none() && said.word == word);
        let said = early.map_or_else(|| Said::new(word), |early| self.0.remove(early));
        self.push(Said { heard: Some(at), ..said });
    }

    /// Takes in what a robot answered to one of them. Of equal ones that is the first without an answer.
    pub(crate) fn answer(&mut self, answer: &Answer) {
        let equal = |said: &Said| said.word == answer.to;
        let this = |said: &Said| equal(said) && said.answered == Some(answer.at);
        let position = self.0.iter().position(this);
        let position =
            position.or_else(|| self.0.iter().position(|said| equal(said) && said.answered.is_none()));
        let position = position.or_else(|| self.0.iter().rposition(equal));
        let place = position.unwrap_or_else(|| {
            self.push(Said::new(answer.to.clone()));
            self.0.len() - 1
        });
        let Some(said) = self.0.get_mut(place) else { return };
        said.answered.get_or_insert(answer.at);
        said.taken |= !answer.outcome.is_refusal();
        // Of robots that do not learn whoever says what was shown is refused, and right all the same.
        said.refused |= answer.outcome.is_refusal() && answer.outcome != Outcome::NotLearning;
    }

    /// The last of those that robots took. One that nobody answered may be: a recording need not have all that was said. One that a robot refused is if
    /// another took it, as robots of two parts of a swarm may.
    #[must_use]
    pub fn last(&self) -> Option<&Instruction> {
        self.0.iter().rfind(|said| said.stands()).map(|said| &said.word)
    }

    fn push(&mut self, said: Said) {
        if self.0.len() >= MAX_WORDS {
            let refused = self.0.iter().position(|said| !said.stands());
            self.0.remove(refused.unwrap_or(0));
        }
        self.0.push(said);
    }
}

impl Said {
    fn new(word: Instruction) -> Self {
        Self { word, heard: None, answered: None, taken: false, refused: false }
    }

    fn stands(&self) -> bool {
        self.taken || !self.refused
    }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::{ClassId, Gesture, RobotId, RoundId};

    use super::*;

    fn was(class: u32) -> Instruction {
        let round = RoundId { counter: 2, opener: RobotId(1), life: 0 };
        Instruction::Was { round, class: Gesture::Class(ClassId(class)) }
    }

    fn answer(at: u64, class: u32, outcome: Outcome) -> Answer {
        Answer { robot: RobotId(1), at, to: was(class), outcome, class: None, looks_like: None, samples: 0 }
    }

    #[test]
    fn what_robots_refused_was_not_said_whichever_comes_first_the_word_or_its_answer() {
        for early in [false, true] {
            let mut words = Words::default();
            words.hear(was(3), 10);
            words.answer(&answer(1, 3, Outcome::Learned));
            let refused = answer(2, 4, Outcome::UnknownGesture);
            if early {
                words.answer(&refused);
            }
            words.hear(was(4), 20);
            if !early {
                assert_eq!(words.last(), Some(&was(4)), "nobody has answered yet");
                words.answer(&refused);
            }
            words.hear(was(4), 20);
            assert_eq!(words.last(), Some(&was(3)), "nor is a copy another word");
            words.hear(was(4), 30);
            words.answer(&answer(3, 4, Outcome::Learned));
            assert_eq!(words.last(), Some(&was(4)), "said again, and taken");
        }
    }

    #[test]
    fn a_word_counts_if_any_robot_took_it_or_none_learns() {
        let last = |outcomes: &[Outcome]| {
            let mut words = Words::default();
            words.hear(was(3), 10);
            words.hear(was(4), 20);
            for outcome in outcomes {
                words.answer(&answer(7, 4, *outcome));
            }
            words.last().cloned()
        };
        for taken in [Outcome::Learned, Outcome::Known, Outcome::NothingSeen] {
            assert_eq!(last(&[Outcome::UnknownRound, taken]), Some(was(4)));
            assert_eq!(last(&[taken, Outcome::UnknownRound]), Some(was(4)));
        }
        assert_eq!(last(&[Outcome::NotLearning]), Some(was(4)));
        assert_eq!(last(&[Outcome::NotLearning, Outcome::NotAllowed]), Some(was(3)));
    }

    #[test]
    fn whoever_speaks_in_ones_name_and_is_refused_does_not_hide_what_was_taken() {
        let mut words = Words::default();
        words.hear(was(3), 1);
        words.answer(&answer(1, 3, Outcome::Learned));
        for class in 4..1000 {
            words.hear(was(class), class.into());
            words.answer(&answer(class.into(), class, Outcome::NotAllowed));
        }
        assert_eq!(words.last(), Some(&was(3)));
        assert!(words.0.len() <= MAX_WORDS);
    }
}
