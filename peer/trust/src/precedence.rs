//! Who may say what of a round, and who said so first.

use std::cmp::Reverse;
use std::collections::{BTreeMap, VecDeque};

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
        let place = self.taught.iter().position(|(taught, _)| *taught == round);
        if matches!(said, Instruction::Retract { .. }) {
            // What one takes back is what one said oneself; then somebody else may be the first.
            let own = place.filter(|place| self.taught[*place].1 == *by);
            own.into_iter().for_each(|place| drop(self.taught.remove(place)));
            return true;
        }
        if let Some((_, first)) = place.map(|place| &mut self.taught[place]) {
            let is_own = first == by;
            if !is_own && has_key(by) && !has_key(first) {
                *first = by.clone();
                return true;
            }
            return is_own || roles.has(Role::Overrule);
        }
        if self.taught.len() == ROUNDS {
            self.forget_one(has_key);
        }
        self.taught.push_back((round, by.clone()));
        true
    }

    /// Forgets the oldest of whoever spoke of most rounds, of those without a key if there are any: who speaks of made-up rounds has others' forgotten last.
    fn forget_one(&mut self, has_key: impl Fn(&InstructorId) -> bool) {
        let mut rounds: BTreeMap<&InstructorId, usize> = BTreeMap::new();
        self.taught.iter().for_each(|(_, by)| *rounds.entry(by).or_default() += 1);
        let most = rounds.into_iter().max_by_key(|(by, rounds)| (!has_key(by), *rounds, Reverse(*by)));
        let most = most.map(|(by, _)| by.clone());
        let oldest = self.taught.iter().position(|(_, by)| Some(by) == most.as_ref());
        oldest.into_iter().for_each(|place| drop(self.taught.remove(place)));
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
        let [ada, bob, cyn, guest] = ["ada", "bob", "cyn", "guest"].map(|name| name.parse().unwrap());
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
        assert!(!may(&cyn, teach, &was(1)), "ada is still the first");
        assert!(may(&ada, teach, &back) && may(&cyn, teach, &was(1)) && !may(&ada, teach, &was(1)));
        assert!(may(&bob, teach, &Instruction::Retract { round: round(9) }) && may(&ada, teach, &was(9)));
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

    #[test]
    fn whoever_speaks_of_ever_so_many_rounds_has_nobody_elses_forgotten() {
        let has_key = |who: &InstructorId| !who.to_string().starts_with("guest");
        let [ada, eve]: [InstructorId; 2] = ["ada", "eve"].map(|name| name.parse().unwrap());
        let mut words = Precedence::default();
        let teach = Roles::up_to(Role::Teach);
        let mut say = |who: &InstructorId, counter| words.permits(who, teach, &was(counter), has_key);
        assert!((0..100).all(|counter| say(&ada, counter)));
        assert!((1000..4000).all(|counter| say(&eve, counter)));
        for n in 0..2000 {
            let guest = format!("guest{n}").parse().unwrap();
            assert!(say(&guest, 5000 + n));
        }
        assert!((0..100).all(|counter| !say(&eve, counter)), "ada was the first");
    }
}
