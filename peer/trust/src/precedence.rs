//! Who may say what of a round, and who said so first.

use std::collections::VecDeque;

use gestalt_protocol::{Instruction, InstructorId, RoundId};

use crate::roles::{Role, Roles};

/// Of how many rounds it is remembered who said first what was shown.
const ROUNDS: usize = 1024;

/// Remembers who taught which round first: they are overruled by those alone who may, and people without a key by those who have one.
#[derive(Clone, Debug, Default)]
pub struct Precedence {
    taught: VecDeque<(RoundId, InstructorId)>,
}

impl Precedence {
    /// Whether somebody with these roles may say that.
    pub fn permits(
        &mut self,
        by: &InstructorId,
        roles: Roles,
        said: &Instruction,
        has_key: impl Fn(&InstructorId) -> bool,
    ) -> bool {
        if !roles.has(if *said == Instruction::Open { Role::Open } else { Role::Teach }) {
            return false;
        }
        // Of gestures that are named anybody who teaches may say what becomes of them: nothing of that is lost.
        let Some(round) = said.round() else { return true };
        if let Some((_, first)) = self.taught.iter_mut().find(|(taught, _)| *taught == round) {
            // What one takes back is what one said oneself.
            let is_own = first == by || matches!(said, Instruction::Retract { .. });
            if !is_own && has_key(by) && !has_key(first) {
                *first = by.clone();
                return true;
            }
            return is_own || roles.has(Role::Overrule);
        }
        if self.taught.len() == ROUNDS {
            self.taught.pop_front();
        }
        self.taught.push_back((round, by.clone()));
        true
    }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::{ClassId, Gesture, RobotId};

    use super::*;

    fn round(counter: u32) -> RoundId {
        RoundId { counter, opener: RobotId(1), life: 7 }
    }

    fn was(counter: u32) -> Instruction {
        Instruction::Was { round: round(counter), class: Gesture::Class(ClassId(3)) }
    }

    #[test]
    fn each_word_needs_its_role() {
        let mut words = Precedence::default();
        let has_key = |who: &InstructorId| who.to_string() != "guest";
        let mut may =
            |who: &InstructorId, roles, said: &Instruction| words.permits(who, roles, said, has_key);
        let [ada, bob, guest] = ["ada", "bob", "guest"].map(|name| name.parse().unwrap());
        let [open, teach, overrule] = [Role::Open, Role::Teach, Role::Overrule].map(Roles::up_to);
        let begin = Instruction::Open;
        assert!(may(&ada, open, &begin) && !may(&ada, Roles::NONE, &begin));
        assert!(!may(&ada, open, &was(1)));
        let new = Instruction::New { label: "circle".to_owned(), round: None };
        assert!(!may(&ada, open, &new) && may(&ada, teach, &new));
        assert!(may(&ada, teach, &was(1)) && may(&ada, teach, &was(1)));
        assert!(!may(&bob, teach, &was(1)), "ada said it first");
        assert!(may(&bob, overrule, &was(1)) && may(&bob, teach, &was(2)));
        let back = Instruction::Retract { round: round(1) };
        assert!(may(&bob, teach, &back), "it takes back what bob said");
        assert!(
            may(&guest, teach, &was(3)) && may(&bob, teach, &was(3)),
            "who has a key goes before who has none"
        );
        assert!(!may(&guest, teach, &was(3)) && !may(&ada, teach, &was(3)));
    }

    #[test]
    fn what_is_remembered_of_rounds_is_bounded() {
        let mut words = Precedence::default();
        let ada = "ada".parse().unwrap();
        for counter in 0..3000 {
            assert!(words.permits(&ada, Roles::up_to(Role::Teach), &was(counter), |_| true));
        }
        assert_eq!(words.taught.len(), ROUNDS);
    }
}
