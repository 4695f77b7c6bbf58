//! Which newer rounds may end the one that is open, or take the place of one that is over.

use gestalt_protocol::{HeldVote, RobotId, RoundId};

use super::rounds::{Effects, Rounds};

impl Rounds {
    /// Whether that newer round, which is not the open one by another name, would end this before it had its time, if others take part in it; or would be a further one of those that come to nothing by one robot's word. `from`: whose
    /// vote brings it, or who says what was `decided` in it.
    ///
    /// Robots are behind, and a newer round takes them along; but whoever may vote could begin one round after the other. So the votes of the open
    /// one decide first if they suffice, without waiting for more; and if they do not, nobody ends two rounds within a deadline. But where as many
    /// are as make a decision final, the swarm has gone on. A refractory time of zero switches all of that off.
    pub(super) fn is_too_soon(
        &mut self,
        (id, decided): (RoundId, Option<bool>),
        from: RobotId,
        effects: &mut Effects<'_>,
    ) -> bool {
        let Some(round) = &self.round else { return false };
        if round.id > id || self.config.refractory.is_zero() {
            return false;
        }
        // That nothing was decided is anybody's word.
        if decided == Some(false) {
            if !round.open {
                // What is held gives way to it.
                let known = self.known(from);
                return self.compare(id, decided).is_gt() && !self.preempted.take(self.now, known);
            }
            // Nobody looks in a round that is over: what is shown now would have none. But who opened the open one under a count that was used opens another.
            if !self.is_displaced_by(id) {
                return true;
            }
        }
        let begun = round.open && round.ballot.len() > 1;
        if !begun {
            return false;
        }
        if self.now < round.since + self.config.refractory {
            return true;
        }
        // A decision of others is the word of many.
        if decided == Some(true) {
            return false;
        }
        if self.concludes_now(effects) {
            return true;
        }
        let known = self.known(from);
        let others = self.waiting.keys().filter(|robot| **robot != from && self.known(**robot).is_some());
        let elsewhere = others.count() + usize::from(known.is_some());
        if elsewhere >= self.config.holders(self.electorate.count()).max(2) as usize {
            return false;
        }
        !self.preempted.take(self.now, known)
    }

    /// Keeps a vote in a newer round for when the open one is over: the latest of each robot that is known, and of all others one.
    pub(super) fn keep_waiting(&mut self, held: HeldVote) {
        if self.known(held.robot).is_none() {
            self.forget_waiting();
        }
        let newer = self.waiting.get(&held.robot).is_none_or(|waiting| waiting.stamp < held.stamp);
        if newer {
            self.waiting.insert(held.robot, held);
        }
    }

    /// Keeps waiting those alone who are there.
    pub(super) fn forget_waiting(&mut self) {
        let (alive, partners) = (&self.alive, &self.partners);
        self.waiting.retain(|robot, _| alive.contains(*robot) || partners.is_neighbour(*robot));
    }

    /// Counts the votes that wait for it, once the open round is over, or where the swarm has gone on: in the order of their rounds.
    pub(super) fn hear_waiting(&mut self, effects: &mut Effects<'_>) {
        let mut waiting: Vec<HeldVote> = std::mem::take(&mut self.waiting).into_values().collect();
        waiting.sort_by_key(|held| (held.vote.round, held.robot));
        for held in waiting {
            self.hear_vote(held, effects);
        }
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
