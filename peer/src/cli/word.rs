//! The words of an instructor: `open`, `was three`, `right`, `wrong`, `undo`.

use gestalt_protocol::{ClassId, Gesture, Instruction, RoundId};

/// What an instructor types or sends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Word {
    Open,
    Was(Gesture),
    Right,
    Wrong,
    Undo,
    Quit,
}

impl Word {
    /// What words mean.
    ///
    /// # Errors
    /// What there is to say instead.
    pub(super) fn read(words: &[&str]) -> Result<Self, String> {
        match words {
            ["open"] => Ok(Self::Open),
            ["right"] => Ok(Self::Right),
            ["wrong"] => Ok(Self::Wrong),
            ["undo"] => Ok(Self::Undo),
            ["quit" | "exit"] => Ok(Self::Quit),
            // A bare number may be the label of a gesture, and mostly is.
            ["was", gesture] => Ok(Self::Was(Gesture::Label((*gesture).to_owned()))),
            ["class", number] => number
                .parse()
                .map(|class| Self::Was(Gesture::Class(ClassId(class))))
                .map_err(|_| format!("'{number}' is not a class number: write, for example, 'class 3'")),
            other => Err(format!(
                "unknown command '{}': use open, was GESTURE, class NUMBER, right, wrong, undo or quit",
                other.join(" ")
            )),
        }
    }

    /// The word about a round, of which that gesture was decided.
    ///
    /// # Errors
    /// Why nothing can be said of it.
    pub(super) fn about(
        self,
        round: RoundId,
        decided: Option<ClassId>,
    ) -> Result<Option<Instruction>, String> {
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
            Self::Open | Self::Quit => None,
        })
    }
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
        for wrong in ["it was 3", "class x", "was", "class 300"] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }
}
