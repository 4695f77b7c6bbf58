//! Which round is the newest that was heard of, also where a swarm starts again and counts from one.

use std::collections::VecDeque;

use gestalt_protocol::RoundId;

/// How far a round may lie behind the newest one that was decided, and be one that is heard of late; and how far before it, and be one that is not
/// announced yet.
const LATE: u32 = 2;

/// How many decided rounds are remembered: what is said again of one of them is no news.
const REMEMBERED: usize = 32;

/// The newest round, and how often the swarm began anew.
#[derive(Debug, Default)]
pub(super) struct Newest {
    /// The highest counter since the swarm began, decided or held.
    counter: Option<u32>,
    decided: Option<RoundId>,
    known: VecDeque<RoundId>,
    turn: u32,
}

impl Newest {
    /// A robot holds a decision of that round. It may be an old one, of a robot that was away.
    pub fn hold(&mut self, round: RoundId) {
        self.counter = self.counter.max(Some(round.counter));
    }

    /// That round was decided. Says in which turn of the swarm: what is said again of an earlier one is of no later turn.
    pub fn decide(&mut self, round: RoundId) -> u32 {
        if self.known.contains(&round) {
            return self.turn.saturating_sub(u32::from(Some(round.counter) > self.counter()));
        }
        if self.known.len() == REMEMBERED {
            self.known.pop_front();
        }
        self.known.push_back(round);
        if self.decided.is_some_and(|newest| begins_anew(newest, round)) {
            (self.counter, self.decided) = (Some(round.counter), Some(round));
            self.turn = self.turn.saturating_add(1);
        }
        self.hold(round);
        if self.decided.is_none_or(|decided| decided.counter < round.counter) {
            self.decided = Some(round);
        }
        self.turn
    }

    /// The highest counter since the swarm began. What is held is soon decided, or made up where it is far ahead of what was.
    pub fn counter(&self) -> Option<u32> {
        let most = self.decided.map_or(u32::MAX, |decided| decided.counter.saturating_add(LATE));
        self.counter.map(|counter| counter.min(most))
    }

    /// The newest round that was decided.
    pub fn decided(&self) -> Option<RoundId> {
        self.decided
    }

    /// How often the swarm began anew.
    pub fn turn(&self) -> u32 {
        self.turn
    }
}

/// Whether a round that was not heard of before is of a swarm that started again, though `newest` was heard of; or all that was heard of later ones made
/// up. A robot that starts again alone goes on from the newest round.
#[must_use]
pub fn begins_anew(newest: RoundId, round: RoundId) -> bool {
    match newest.opener == round.opener {
        true => newest.life != round.life && round.counter <= newest.counter,
        false => round.counter.saturating_add(LATE) < newest.counter,
    }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::RobotId;

    use super::*;

    fn round(counter: u32, opener: u32, life: u32) -> RoundId {
        RoundId { counter, opener: RobotId(opener), life }
    }

    fn after(rounds: &[RoundId]) -> Newest {
        let mut newest = Newest::default();
        for round in rounds {
            newest.decide(*round);
        }
        newest
    }

    fn decided(rounds: &[RoundId]) -> Option<u32> {
        after(rounds).decided().map(|round| round.counter)
    }

    #[test]
    fn a_swarm_that_starts_again_counts_from_one() {
        assert_eq!(decided(&[round(5, 1, 7), round(1, 1, 8)]), Some(1));
        assert_eq!(decided(&[round(1, 1, 7), round(1, 1, 8)]), Some(1), "after one round");
        let mut anew = after(&[round(5, 1, 7), round(1, 2, 9), round(5, 1, 7)]);
        assert_eq!((anew.counter(), anew.turn()), (Some(1), 1), "and an old decision again is no news");
        assert_eq!((anew.decide(round(5, 1, 7)), anew.decide(round(1, 2, 9))), (0, 1));
        anew.hold(round(2, 2, 9));
        assert_eq!((anew.counter(), anew.decided()), (Some(2), Some(round(1, 2, 9))));
    }

    #[test]
    fn what_is_heard_late_is_not_the_newest() {
        assert_eq!(decided(&[round(4, 2, 7), round(5, 1, 7), round(4, 2, 7)]), Some(5), "again");
        assert_eq!(decided(&[round(5, 1, 7), round(3, 2, 7)]), Some(5), "for the first time");
        assert_eq!(decided(&[round(5, 1, 7), round(1, 1, 7)]), Some(5), "of the same start");
    }

    #[test]
    fn what_is_made_up_does_not_stay_the_newest() {
        let mut made_up = after(&[round(5, 1, 7), round(u32::MAX, 9, 9)]);
        made_up.decide(round(6, 1, 7));
        assert_eq!(made_up.counter(), Some(6));
        made_up.hold(round(u32::MAX, 9, 9));
        assert_eq!(made_up.counter(), Some(6 + LATE));
        for counter in 7..1000 {
            made_up.decide(round(counter, 1, 7));
            assert_eq!(made_up.decided(), Some(round(counter, 1, 7)));
        }
        assert_eq!(made_up.known.len(), REMEMBERED);
    }
}
