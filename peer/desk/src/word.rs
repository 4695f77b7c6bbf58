//! The words of an instructor: `open`, `was three`, `right`, `wrong`, `undo`, `new circle`, `same ring as circle`, `retire circle`, `restore circle`.

use gestalt_protocol::{ClassId, Gesture, Instruction, RoundId};

/// What an instructor types or sends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Word {
    /// "Look now."
    Open,
    /// "It was this gesture."
    Was(Gesture),
    /// "The decision was right."
    Right,
    /// "The decision was wrong."
    Wrong,
    /// "I said nothing of it."
    Undo,
    /// "This is a new gesture", called so.
    New(String),
    /// "The first is the second."
    Same(Gesture, Gesture),
    /// "It is shown no more."
    Retire(Gesture),
    /// "It is shown again."
    Restore(Gesture),
    /// Nothing more will be said.
    Quit,
}

impl Word {
    /// What words mean.
    ///
    /// # Errors
    /// What there is to say instead.
    pub fn read(words: &[&str]) -> Result<Self, String> {
        match words {
            ["open" | "look"] => Ok(Self::Open),
            ["right"] => Ok(Self::Right),
            ["wrong"] => Ok(Self::Wrong),
            ["undo" | "retract"] => Ok(Self::Undo),
            ["quit" | "exit"] => Ok(Self::Quit),
            // A bare number may be the label of a gesture, and mostly is.
            ["was", gesture @ ..] if !gesture.is_empty() => Ok(Self::Was(called(gesture))),
            ["new", label @ ..] if !label.is_empty() => Ok(Self::New(label.join(" "))),
            ["same", gestures @ ..] => {
                let parts = gestures.iter().position(|word| *word == "as").map(|at| gestures.split_at(at));
                match parts {
                    Some((class @ [_, ..], ["as", of @ ..])) if !of.is_empty() => {
                        Ok(Self::Same(called(class), called(of)))
                    }
                    _ => Err("say which is the same as which: 'same ring as circle'".to_owned()),
                }
            }
            ["retire", gesture @ ..] if !gesture.is_empty() => Ok(Self::Retire(called(gesture))),
            ["restore", gesture @ ..] if !gesture.is_empty() => Ok(Self::Restore(called(gesture))),
            ["class", number] => number
                .parse()
                .map(|class| Self::Was(Gesture::Class(ClassId(class))))
                .map_err(|_| format!("'{number}' is not a class number: write, for example, 'class 3'")),
            other => Err(format!(
                "unknown command '{}': use open, was GESTURE, class NUMBER, right, wrong, undo, new LABEL, \
                 same GESTURE as GESTURE, retire GESTURE, restore GESTURE or quit",
                other.join(" ")
            )),
        }
    }

    /// The word about a gesture's name, which needs no round.
    #[must_use]
    pub fn of_names(&self, round: Option<RoundId>) -> Option<Instruction> {
        match self.clone() {
            Self::New(label) => Some(Instruction::New { label, round }),
            Self::Same(class, of) => Some(Instruction::Same { class, of }),
            Self::Retire(class) => Some(Instruction::Retire { class }),
            Self::Restore(class) => Some(Instruction::Restore { class }),
            Self::Open | Self::Was(_) | Self::Right | Self::Wrong | Self::Undo | Self::Quit => None,
        }
    }

    /// The word about a round, of which that gesture was decided.
    ///
    /// # Errors
    /// Why nothing can be said of it.
    pub fn about(self, round: RoundId, decided: Option<ClassId>) -> Result<Option<Instruction>, String> {
        let of = || {
            decided.map(Gesture::Class).ok_or_else(|| {
                format!("no decision of round {round} is known here to be right or wrong: say 'was GESTURE'")
            })
        };
        Ok(match self {
            Self::Was(class) => Some(Instruction::Was { round, class }),
            Self::Right => Some(Instruction::Right { round, of: of()? }),
            Self::Wrong => Some(Instruction::Wrong { round, of: of()? }),
            Self::Undo => Some(Instruction::Retract { round }),
            Self::Open | Self::Quit | Self::New(_) | Self::Same(..) | Self::Retire(_) | Self::Restore(_) => {
                None
            }
        })
    }
}

fn called(words: &[&str]) -> Gesture {
    Gesture::Label(words.join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn right_and_wrong_name_what_was_decided() {
        let round: RoundId = "5@2-3f9a01c7".parse().unwrap();
        let of = Gesture::Class(ClassId(3));
        assert_eq!(Word::Wrong.about(round, Some(ClassId(3))), Ok(Some(Instruction::Wrong { round, of })));
        assert!(Word::Right.about(round, None).unwrap_err().contains("was GESTURE"));
    }

    #[test]
    fn words_are_read_as_people_type_them() {
        let read = |text: &str| Word::read(&text.split_whitespace().collect::<Vec<_>>());
        assert_eq!(read("was 3"), Ok(Word::Was(Gesture::Label("3".to_owned()))));
        assert_eq!(read("class 3"), Ok(Word::Was(Gesture::Class(ClassId(3)))));
        assert_eq!(read(" undo "), Ok(Word::Undo));
        let label = |label: &str| Gesture::Label(label.to_owned());
        assert_eq!(read("was big circle (ana)"), Ok(Word::Was(label("big circle (ana)"))));
        assert_eq!(read("new big circle"), Ok(Word::New("big circle".to_owned())));
        assert_eq!(read("same ring as big circle"), Ok(Word::Same(label("ring"), label("big circle"))));
        for wrong in
            ["it was 3", "class x", "was", "new", "same ring", "same as ring", "same ring as", "retire"]
        {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }
}
