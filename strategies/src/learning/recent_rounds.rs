//! The latest rounds a robot lived through, and what it saw in them: feedback comes after the round.

use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;

use gestalt_protocol::RoundId;

/// How many rounds are remembered, those in which something was seen before others: feedback that comes later than that labels nothing new.
const MAX_ROUNDS: usize = 32;

/// How many names of one round are remembered: that under which it became known, under which it is looked at, and the smallest.
const MAX_NAMES: usize = 1024;

/// One round.
#[derive(Clone, Debug)]
struct RecentRound {
    /// All names it was known under: robots that open at once merge their rounds on the smallest.
    names: BTreeSet<RoundId>,
    /// The first of them.
    known_as: RoundId,
    last_look: Option<Duration>,
    looks: usize,
    /// What was seen and has no label yet.
    unlabelled: Vec<Vec<f32>>,
}

/// The latest rounds, oldest first.
#[derive(Clone, Debug, Default)]
pub(super) struct RecentRounds(VecDeque<RecentRound>);

impl RecentRounds {
    /// Notes a round; says whether it was news.
    pub fn enter(&mut self, round: RoundId) -> bool {
        if self.contains(round) {
            return false;
        }
        self.0.push_back(RecentRound {
            names: [round].into(),
            known_as: round,
            last_look: None,
            looks: 0,
            unlabelled: Vec::new(),
        });
        if self.0.len() > MAX_ROUNDS {
            // Anybody can say that there was a round; what was seen in one is this robot's own.
            let before = self.0.iter().take(MAX_ROUNDS);
            let unseen = before.enumerate().find(|(_, known)| known.looks == 0);
            let dropped = unseen.map_or(0, |(n, _)| n);
            self.0.remove(dropped);
        }
        true
    }

    /// Notes another name of a round; says whether it was news.
    pub fn merge(&mut self, round: RoundId, other: RoundId) -> bool {
        self.enter(round);
        let Some(known) = self.find_mut(round) else { return false };
        let new = known.names.insert(other);
        if known.names.len() <= MAX_NAMES {
            return new;
        }
        let dropped = known.names.iter().rev().find(|name| **name != known.known_as).copied();
        dropped.is_none_or(|dropped| known.names.remove(&dropped) && dropped != other)
    }

    /// Keeps what was seen, up to `keep` times a round, at least `spacing` apart. Says whether it did.
    pub fn look(
        &mut self,
        now: Duration,
        round: RoundId,
        vector: Vec<f32>,
        keep: usize,
        spacing: Duration,
    ) -> bool {
        self.enter(round);
        let Some(known) = self.find_mut(round) else { return false };
        if known.looks >= keep || known.last_look.is_some_and(|last| now < last + spacing) {
            return false;
        }
        (known.last_look, known.looks) = (Some(now), known.looks + 1);
        known.unlabelled.push(vector);
        true
    }

    pub fn looks(&self, round: RoundId) -> usize {
        self.find(round).map_or(0, |known| known.looks)
    }

    pub fn contains(&self, round: RoundId) -> bool {
        self.find(round).is_some()
    }

    /// What was seen in that round and has no label yet; from now on it has.
    pub fn take_unlabelled(&mut self, round: RoundId) -> Vec<Vec<f32>> {
        self.find_mut(round).map(|known| std::mem::take(&mut known.unlabelled)).unwrap_or_default()
    }

    /// All names of the round that has this one.
    pub fn names(&self, round: RoundId) -> impl Iterator<Item = RoundId> + '_ {
        let known = self.find(round);
        let unknown = known.is_none().then_some(round);
        known.into_iter().flat_map(|known| &known.names).copied().chain(unknown)
    }

    fn find(&self, round: RoundId) -> Option<&RecentRound> {
        // Most that is said is about the newest.
        self.0.iter().rev().find(|known| known.names.contains(&round))
    }

    fn find_mut(&mut self, round: RoundId) -> Option<&mut RecentRound> {
        self.0.iter_mut().rev().find(|known| known.names.contains(&round))
    }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::RobotId;

    use super::*;

    #[test]
    fn a_round_is_looked_at_under_its_first_name_and_spoken_of_under_its_smallest_however_many_it_has() {
        let id = |opener| RoundId { counter: 1, opener: RobotId(opener), life: 0 };
        let mut recent = RecentRounds::default();
        recent.merge(id(9000), id(4000));
        for opener in (1000..4000).rev() {
            assert!(recent.merge(id(opener + 1), id(opener)), "{opener}");
            assert!(recent.look(Duration::ZERO, id(9000), vec![1.0], usize::MAX, Duration::ZERO), "{opener}");
        }
        assert!(!recent.merge(id(1000), id(8000)), "of those beyond, the smallest are remembered");
        assert_eq!((recent.0.len(), recent.names(id(1000)).count()), (1, MAX_NAMES));
        assert_eq!(recent.take_unlabelled(id(1000)).len(), 3000);
    }

    #[test]
    fn a_round_in_which_something_was_seen_outlives_those_that_others_speak_of() {
        let id = |counter| RoundId { counter, opener: RobotId(1), life: 0 };
        let mut recent = RecentRounds::default();
        recent.enter(id(1));
        assert!(recent.look(Duration::ZERO, id(2), vec![1.0], 1, Duration::ZERO));
        for counter in 3..200 {
            recent.enter(id(counter));
        }
        assert!(recent.0.len() == MAX_ROUNDS && recent.contains(id(199)));
        assert!(!recent.contains(id(1)));
        assert_eq!(recent.take_unlabelled(id(2)).len(), 1);
        // Of those in which something was seen the oldest is forgotten.
        for counter in 200..300 {
            recent.look(Duration::ZERO, id(counter), vec![1.0], 1, Duration::ZERO);
        }
        recent.enter(id(300));
        assert!(!recent.contains(id(2)) && recent.contains(id(299)) && recent.contains(id(300)));
    }
}
