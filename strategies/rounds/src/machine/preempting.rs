//! Which newer rounds may end the one that is open.

use gestalt_protocol::{RobotId, RoundId};

use super::rounds::{Effects, Rounds};

impl Rounds {
    /// Whether that newer round would end the open one, in which others take part, before that had its time. `by`: whose vote brings it,
    /// if it is one.
    ///
    /// Robots are behind, and a newer round takes them along; but whoever may vote could begin one round after the other. So the votes of the open
    /// one decide first if they suffice, without waiting for more; and if they do not, nobody ends two rounds within a deadline. A refractory
    /// time of zero switches all of that off.
    pub(super) fn is_too_soon(
        &mut self,
        id: RoundId,
        by: Option<RobotId>,
        effects: &mut Effects<'_>,
    ) -> bool {
        let this = self.is_this_round(id);
        let Some(round) = &self.round else { return false };
        let begun = round.open && round.ballot.len() > 1;
        if this || !begun || round.id > id || self.config.refractory.is_zero() {
            return false;
        }
        if self.now < round.since + self.config.refractory {
            return true;
        }
        // A decision of others is the word of many.
        let Some(by) = by else { return false };
        if self.concludes_now(effects) {
            return true;
        }
        let known = self.known(by);
        !self.preempted.take(self.now, known)
    }

    /// Whether something is held for the open round, if need be by the votes that there are.
    fn concludes_now(&mut self, effects: &mut Effects<'_>) -> bool {
        self.hurry(true);
        self.decide(effects);
        let holds = self.held().is_some();
        self.hurry(holds);
        holds
    }

    fn hurry(&mut self, hurried: bool) {
        if let Some(round) = &mut self.round {
            round.hurried = hurried;
        }
    }
}
