//! Which rounds lie ahead of all that are known here: names of rounds to come can be guessed, and whoever speaks of one does not end it.

use gestalt_protocol::RoundId;
use gestalt_rounds::TAUGHT_AHEAD;

use super::memory::Item;
use super::state::Learning;

/// As [`TAUGHT_AHEAD`] for a robot that knows of no round yet: nobody shows a million gestures unnoticed.
const LEAP_OF_A_NEWBORN: u32 = 1_000_000;

impl Learning {
    /// The highest counter of a round of which a lesson is taken in: lessons come after their rounds.
    pub(super) fn furthest(&self) -> u32 {
        self.newest.map_or(LEAP_OF_A_NEWBORN, |newest| newest.saturating_add(TAUGHT_AHEAD))
    }

    /// Something was said of that round. What is said of one before any of its count is known ends none.
    pub(super) fn note_ahead(&mut self, round: RoundId) {
        if self.newest.is_some_and(|newest| round.counter > newest) {
            self.ahead.insert(round);
            self.ahead.retain(|round| self.lessons.contains(*round));
        }
    }

    /// That counter is one of a round. What was said of rounds that cannot be, if there are none beyond, is forgotten.
    pub(super) fn note_counter(&mut self, counter: u32) {
        if self.newest >= Some(counter) {
            return;
        }
        let before = self.newest.replace(counter);
        let mut come: Vec<RoundId> = Vec::new();
        if before.is_none() {
            // Under this key stands what was known when it was drawn.
            self.digest();
            come = self.lessons.forget_beyond(self.furthest());
            // What others remember of rounds up to this one is over for a newborn, too.
            let (ahead, over): (Vec<_>, Vec<_>) =
                self.lessons.all_rounds().partition(|round| self.is_to_come(*round));
            self.ahead.extend(ahead);
            come.extend(over);
        }
        come.extend(
            self.ahead.iter().filter(|round| round.counter <= counter && Some(round.counter) > before),
        );
        self.dirty.extend(come.into_iter().map(Item::Lessons));
    }

    /// Whether nothing shows that there was such a round: it is ahead of all that are known, and no instructor with a key spoke of it. From what is on its
    /// disk a robot that starts again counts on, and takes it for over; so what anybody may say of a round is not written before one of its count is known.
    pub(super) fn is_to_come(&self, round: RoundId) -> bool {
        let is_signed = || self.believer.is_some() && self.lessons.is_signed(round);
        self.newest < Some(round.counter) && !is_signed()
    }
}
