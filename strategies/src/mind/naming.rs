//! Gestures that instructors name while the swarm works: what a robot makes of such a word, and of what a neighbour heard.

use std::ops::ControlFlow;

use gestalt_protocol::{
    ClassId, Fate, Gesture, Instruction, InstructorId, MAX_LABEL, Naming, Namings, Outcome, RobotId, RoundId,
};
use gestalt_rounds::Refusal;

use super::input::Instructed;
use super::machine::Mind;
use super::sample_repair::MAX_UNPROVEN;
use crate::believe::Standing;
use crate::learning::Learning;
use crate::names::{NamingReceipt, of_somebody};

/// From which probability on a round is said to look like a gesture.
const LOOKS_LIKE: f64 = 0.5;

/// What came of a word on a gesture's name, and which gesture it is about.
pub(super) type Named = (Outcome, Option<ClassId>);

impl Mind {
    /// Names a gesture, or merges, retires or restores one. `None` for any other word.
    pub(super) fn name(&mut self, instructed: &Instructed) -> Option<Named> {
        let learning = self.learning.as_mut();
        let named = match &instructed.instruction {
            Instruction::New { label, .. } => learning.map(|learning| learning.name_anew(label, instructed)),
            Instruction::Same { class, of } => {
                learning.map(|learning| match learning.gesture(of, &instructed.by) {
                    Some(of) => learning.decree(class, instructed, Fate::Same(of)),
                    None => (Outcome::UnknownGesture, None),
                })
            }
            Instruction::Retire { class } => {
                learning.map(|learning| learning.decree(class, instructed, Fate::Retired))
            }
            Instruction::Restore { class } => {
                learning.map(|learning| learning.decree(class, instructed, Fate::InUse))
            }
            Instruction::Open
            | Instruction::Was { .. }
            | Instruction::Right { .. }
            | Instruction::Wrong { .. }
            | Instruction::Retract { .. } => return None,
        };
        self.call_by_names();
        Some(named.unwrap_or((Outcome::NotLearning, None)))
    }

    /// Takes in what a neighbour heard of names.
    pub(super) fn on_namings(&mut self, from: RobotId, namings: &Namings) {
        let Some(learning) = &mut self.learning else { return };
        let (mut news, mut unproven) = (false, Vec::new());
        learning.hear_namings(&namings.namings, |naming, receipt| {
            match receipt {
                NamingReceipt::New => news = true,
                NamingReceipt::Unproven if unproven.len() == MAX_UNPROVEN => return ControlFlow::Break(()),
                NamingReceipt::Unproven => unproven.push(naming),
                other => refusal(other).into_iter().for_each(|cause| self.rounds.note_refusal(cause)),
            }
            ControlFlow::Continue(())
        });
        // A gesture can be the same as one that was named behind it.
        learning.hear_namings(unproven, |_, receipt| {
            match receipt {
                NamingReceipt::New => news = true,
                other => refusal(other).into_iter().for_each(|cause| self.rounds.note_refusal(cause)),
            }
            ControlFlow::Continue(())
        });
        if news {
            // Lessons may name what was not known.
            self.ask_again_for_lessons();
            self.call_by_names();
            // The other neighbours may lack it too.
            self.rounds.pass_on_soon(from);
        }
    }

    /// What this robot's gestures are called from now on where it announces them.
    pub(super) fn call_by_names(&mut self) {
        if let Some(learning) = &self.learning {
            self.rounds.call(learning.names().called(learning.vocabulary().labels()));
        }
    }

    /// The gesture that the swarm took for likeliest in that round, if it was not that one.
    pub(super) fn looked_like(&self, round: RoundId, gesture: Option<ClassId>) -> Option<ClassId> {
        let decision = self.rounds.held().filter(|held| held.round == round)?;
        let certificate = &decision.certificate;
        let likely = certificate.classes().zip(&certificate.probabilities);
        let (likeliest, p) = likely.max_by(|a, b| a.1.total_cmp(b.1))?;
        (*p >= LOOKS_LIKE && Some(likeliest) != gesture).then_some(likeliest)
    }
}

impl Learning {
    /// The gesture that an instructor means.
    fn gesture(&self, gesture: &Gesture, by: &InstructorId) -> Option<ClassId> {
        self.meant(gesture, |label| self.names().find(label, by))
    }

    /// The gesture that an instructor means who says what was shown, or was not.
    pub(super) fn gesture_shown(&self, gesture: &Gesture, by: &InstructorId) -> Option<ClassId> {
        self.meant(gesture, |label| self.names().find_shown(label, by))
    }

    fn meant(&self, gesture: &Gesture, find: impl FnOnce(&str) -> Option<ClassId>) -> Option<ClassId> {
        match gesture {
            Gesture::Class(class) if class.is_named() => self.names().get(*class).map(Naming::gesture),
            Gesture::Class(class) => Some(*class).filter(|class| self.vocabulary().place(*class).is_some()),
            Gesture::Label(label) => self.vocabulary().class(label).or_else(|| find(label)),
        }
    }

    fn name_anew(&mut self, label: &str, said: &Instructed) -> Named {
        let by = &said.by;
        if let Some(listed) = self.vocabulary().class(label) {
            return (Outcome::Known, Some(listed));
        }
        if !(1..=MAX_LABEL).contains(&label.len()) || of_somebody(label).is_some() {
            return (Outcome::NoRoom, None);
        }
        self.say_of(by.clone(), label.to_owned(), said, Fate::InUse)
    }

    /// Whether there is room for what that word leaves in use, if it changes anything.
    fn has_room_for(&self, naming: &Naming) -> bool {
        let (names, standing) = (self.names(), self.standing_of_naming(naming));
        let counts =
            standing != Some(Standing::Unproven) && names.would_hear(naming, standing) == NamingReceipt::New;
        !counts || names.has_room(self.room_for_names(), naming, standing)
    }

    /// Says what became of a gesture that was named, whoever named it.
    fn decree(&mut self, gesture: &Gesture, said: &Instructed, fate: Fate) -> Named {
        let known = self.gesture(gesture, &said.by).and_then(|gesture| self.names().get(gesture));
        let Some(Naming { by, label, .. }) = known.cloned() else { return (Outcome::UnknownGesture, None) };
        if fate == Fate::Same(ClassId::named(&by, &label)) {
            return (Outcome::UnknownGesture, None);
        }
        self.say_of(by, label, said, fate)
    }

    fn say_of(&mut self, by: InstructorId, label: String, word: &Instructed, fate: Fate) -> Named {
        let Instructed { by: said_by, at, said, .. } = word;
        let gesture = ClassId::named(&by, &label);
        let known = self.names().get(gesture);
        if known.is_some_and(|known| known.said_by == *said_by && word.is_late(known.at)) {
            return (Outcome::Known, Some(gesture));
        }
        let again = known.is_some_and(|known| known.fate == fate);
        let count = match known {
            _ if said.is_some() => *at,
            // A neighbour told of it before it was heard.
            Some(known) if again && known.at == *at && known.said_by == *said_by => known.count,
            // What is said again is kept all the same: where others say otherwise, it goes before what was said before it.
            Some(known) => known.count.saturating_add(1),
            None => 1,
        };
        let naming = Naming { by, label, count, at: *at, said_by: said_by.clone(), fate, said: said.clone() };
        // Some other that is in use would be told apart no more.
        if !self.has_room_for(&naming) {
            return (Outcome::NoRoom, None);
        }
        match self.hear_naming(&naming) {
            NamingReceipt::New if !again => (Outcome::Learned, Some(gesture)),
            // Somebody with a key has spoken of it, and this one has none; or what was said before has the higher count.
            NamingReceipt::Known if !again => (Outcome::NotAllowed, None),
            NamingReceipt::New | NamingReceipt::Known => (Outcome::Known, Some(gesture)),
            NamingReceipt::Unproven => (Outcome::NotAllowed, None),
            NamingReceipt::Full | NamingReceipt::FarAhead => (Outcome::NoRoom, None),
        }
    }
}

/// What a word on a gesture's name was refused for, if it was.
fn refusal(receipt: NamingReceipt) -> Option<Refusal> {
    match receipt {
        NamingReceipt::New | NamingReceipt::Known => None,
        NamingReceipt::Unproven => Some(Refusal::NamingUnproven),
        NamingReceipt::Full => Some(Refusal::NamingFull),
        NamingReceipt::FarAhead => Some(Refusal::NamingFarAhead),
    }
}
