//! The names of a round: robots that open one at once call it by as many, and go on under the smallest.

use std::collections::BTreeMap;

use gestalt_protocol::{MAX_ROBOTS, RobotId, RoundId};

/// The most that are remembered: more robots than there may be do not open one.
const MAX_NAMES: usize = MAX_ROBOTS;

/// The most that one robot brings. An honest one brings its own, and then those that it goes on under, each smaller than the one before: of a thousand in
/// any order that are seven.
const MAX_BROUGHT: usize = 16;

/// All names of one round, each with who brought it. Robots that nobody knows have one share together, as names of robots cost nothing.
#[derive(Clone, Debug)]
pub(crate) struct Names(BTreeMap<RoundId, Option<RobotId>>);

impl Names {
    pub fn new(id: RoundId) -> Self {
        Self([(id, None)].into())
    }

    pub fn contains(&self, id: RoundId) -> bool {
        self.0.contains_key(&id)
    }

    pub fn iter(&self) -> impl Iterator<Item = RoundId> + '_ {
        self.0.keys().copied()
    }

    /// Takes in another one; whether it was news. Those beyond what a robot may bring are none: whoever could make a round forget a name could make another
    /// round of what was said under that.
    pub fn add(&mut self, id: RoundId, by: Option<RobotId>) -> bool {
        if self.contains(id) || self.0.len() >= MAX_NAMES {
            return false;
        }
        let brings = self.0.values().filter(|brought| **brought == by).count() < MAX_BROUGHT;
        if brings {
            self.0.insert(id, by);
        }
        brings
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn id(opener: u32) -> RoundId {
        RoundId { counter: 1, opener: RobotId(opener), life: 0 }
    }

    #[test]
    fn nobody_brings_so_many_that_those_of_others_find_no_room() {
        let mut names = Names::new(id(0));
        let brought = |names: &mut Names, by, openers: std::ops::Range<u32>| {
            openers.filter(|opener| names.add(id(*opener), by)).count()
        };
        assert_eq!(brought(&mut names, Some(RobotId(66)), 1..5000), MAX_BROUGHT);
        assert_eq!(brought(&mut names, None, 5000..6000), MAX_BROUGHT - 1, "with the first");
        for robot in 10_000..20_000 {
            names.add(id(robot), Some(RobotId(robot)));
        }
        assert_eq!(names.iter().count(), MAX_NAMES);
        assert!(names.contains(id(0)) && names.contains(id(10_000)) && !names.contains(id(19_999)));
        assert!(!names.add(id(10_000), Some(RobotId(1))), "it is known");
    }
}
