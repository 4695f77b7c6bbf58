//! Remembers what was said, to notice who says two things.

use std::collections::{BTreeMap, VecDeque};

use gestalt_protocol::{MAX_ROBOTS, RobotId, Signature, Stamp};

use crate::evidence::Evidence;
use crate::roster::Roster;
use crate::scheme::Scheme;
use crate::signed::{MAX_EVIDENT, Signed};
use crate::statement;

/// How many statements of one author are remembered at most.
const STATEMENTS: usize = 64;

/// How many bytes of memory one author's statements take at most.
const AUTHOR_BYTES: usize = 64 * 1024;

/// How many bytes those of all authors take together.
const TOTAL_BYTES: usize = 16 * 1024 * 1024;

/// Remembers the last statements of every author, up to 64 or 64 KiB of each, and finds two different ones under one stamp.
///
/// A lie is found if its halves come here with fewer statements of that author between them. All authors together take at most
/// 16 MiB: in a swarm of more than 256 robots, each has its share of those. A statement longer than that share or than
/// [`MAX_EVIDENT`] is not remembered.
#[derive(Clone, Debug)]
pub struct Witness {
    share: usize,
    authors: BTreeMap<RobotId, Heard>,
}

/// What one author said.
#[derive(Clone, Debug, Default)]
struct Heard {
    /// In the order they came in. Not by stamp: one statement with the highest of all would hide what comes after it.
    statements: VecDeque<(Stamp, Signed)>,
    bytes: usize,
}

impl Witness {
    /// One that listens to the robots on that roster.
    #[must_use]
    pub fn new<S: Scheme>(roster: &Roster<S>) -> Self {
        Self::of(roster.members().robots.len())
    }

    fn of(robots: usize) -> Self {
        let mut witness = Self { share: 0, authors: BTreeMap::new() };
        witness.resize(robots);
        witness
    }

    /// Listens to the robots on the roster that follows, and forgets who is not on it or has another key there.
    pub fn follow<S: Scheme>(&mut self, before: &Roster<S>, after: &Roster<S>) {
        self.authors.retain(|robot, _| after.keeps_key(before, *robot));
        self.resize(after.members().robots.len());
    }

    fn resize(&mut self, robots: usize) {
        self.share = AUTHOR_BYTES.min(TOTAL_BYTES / robots.clamp(1, MAX_ROBOTS));
        let share = self.share;
        self.authors.values_mut().for_each(|heard| heard.shrink_to(STATEMENTS, share));
    }

    /// Remembers a statement that a [`Verifier`](crate::Verifier) believed, with its signature. If its author said something else
    /// under that stamp, here is the evidence.
    pub fn observe(&mut self, statement: &[u8], signature: &Signature) -> Option<Evidence> {
        let heading = statement::heading(statement).ok()?;
        let full = self.authors.len() >= MAX_ROBOTS && !self.authors.contains_key(&heading.author);
        let new = Signed { statement: statement.to_vec(), signature: *signature };
        if full || statement.len() > MAX_EVIDENT || cost(&new) > self.share {
            return None;
        }
        let heard = self.authors.entry(heading.author).or_default();
        if let Some((_, held)) = heard.statements.iter().find(|(stamp, _)| *stamp == heading.stamp) {
            let differs = held.statement != new.statement;
            return differs.then(|| Evidence::of_two(held.clone(), new));
        }
        heard.shrink_to(STATEMENTS - 1, self.share - cost(&new));
        heard.bytes += cost(&new);
        heard.statements.push_back((heading.stamp, new));
        None
    }

    /// How many bytes of memory the statements take.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.authors.values().map(|heard| heard.bytes).sum()
    }
}

impl Heard {
    fn shrink_to(&mut self, statements: usize, bytes: usize) {
        while self.statements.len() > statements || self.bytes > bytes {
            let Some((_, gone)) = self.statements.pop_front() else { return };
            self.bytes -= cost(&gone);
        }
    }
}

/// How much memory a remembered statement takes.
fn cost(signed: &Signed) -> usize {
    size_of::<(Stamp, Signed)>() + signed.statement.len()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{authority, have, members, robot, roster, vote};

    fn observe(witness: &mut Witness, statement: &[u8], by: u32) -> Option<Evidence> {
        witness.observe(statement, &statement::sign(&robot(by), &roster(1).swarm_id(), statement))
    }

    #[test]
    fn two_statements_under_one_stamp_are_evidence_of_whatever_kind() {
        for other in [vote(2, 5, -1.0), have(2, 5)] {
            let mut witness = Witness::new(&roster(1));
            assert_eq!(observe(&mut witness, &vote(2, 5, 1.0), 2), None);
            let evidence = observe(&mut witness, &other, 2).unwrap();
            assert_eq!(evidence.check(&roster(1), |_| false).unwrap().robot, RobotId(2));
            // In the other order it is the same evidence.
            let mut witness = Witness::new(&roster(1));
            observe(&mut witness, &other, 2);
            assert_eq!(observe(&mut witness, &vote(2, 5, 1.0), 2), Some(evidence));
        }
    }

    #[test]
    fn repeating_oneself_is_no_lie() {
        let mut witness = Witness::new(&roster(1));
        for _ in 0..100 {
            assert_eq!(observe(&mut witness, &vote(2, 5, 1.0), 2), None);
            assert_eq!(observe(&mut witness, &vote(3, 5, 2.0), 3), None, "another author");
            assert_eq!(observe(&mut witness, &vote(2, 6, 2.0), 2), None, "another stamp");
            assert_eq!(observe(&mut witness, &vote(2, 5, 1.0), 3), None, "another signature alone");
        }
    }

    #[test]
    fn the_last_64_statements_are_remembered_and_no_more() {
        let lie_after = |others: u32| {
            let mut witness = Witness::new(&roster(1));
            observe(&mut witness, &vote(2, 1000, 1.0), 2);
            (0..others)
                .for_each(|sequence| assert_eq!(observe(&mut witness, &vote(2, sequence, 1.0), 2), None));
            observe(&mut witness, &vote(2, 1000, -1.0), 2)
        };
        assert!(lie_after(63).is_some());
        assert!(lie_after(64).is_none());
    }

    #[test]
    fn memory_is_bounded_whoever_speaks() {
        // Signatures are not looked into here.
        let signature = Signature::from_bytes([0; 64]);
        let long = |author: u32, sequence: u32, length: usize| {
            let mut statement = have(author, sequence);
            statement.resize(length, 0);
            statement
        };
        let mut witness = Witness::of(4);
        for sequence in 0..200 {
            witness.observe(&long(1, sequence, 1000 + sequence as usize), &signature);
            assert!(witness.bytes() <= AUTHOR_BYTES);
        }
        assert!(witness.bytes() > AUTHOR_BYTES - 1300, "no room for another one");
        for length in [MAX_EVIDENT, MAX_EVIDENT + 1] {
            witness.observe(&long(2, length as u32, length), &signature);
        }
        let remembered = &witness.authors[&RobotId(2)].statements;
        let lengths: Vec<usize> = remembered.iter().map(|(_, signed)| signed.statement.len()).collect();
        assert_eq!(lengths, [MAX_EVIDENT], "the other is too long");
        let mut witness = Witness::of(MAX_ROBOTS);
        for author in 0..2 * MAX_ROBOTS as u32 {
            for sequence in 0..3 {
                witness.observe(&long(author, sequence, 1900), &signature);
            }
        }
        assert!(witness.bytes() <= TOTAL_BYTES);
        assert_eq!(
            witness.authors.values().map(|heard| heard.statements.len()).sum::<usize>(),
            2 * MAX_ROBOTS
        );
    }

    #[test]
    fn what_fills_a_share_to_the_last_byte_is_remembered() {
        let share = TOTAL_BYTES / MAX_ROBOTS;
        let beside = size_of::<(Stamp, Signed)>();
        let of_length = |sequence: u32, cost: usize| {
            let mut statement = have(1, sequence);
            statement.resize(cost - beside, 0);
            statement
        };
        let bytes_of = |costs: &[usize]| {
            let mut witness = Witness::of(MAX_ROBOTS);
            for (sequence, cost) in (1..).zip(costs) {
                witness.observe(&of_length(sequence, *cost), &Signature::from_bytes([0; 64]));
            }
            witness.bytes()
        };
        assert_eq!(bytes_of(&[share]), share);
        assert_eq!(bytes_of(&[share + 1]), 0, "longer than all that is remembered of one author");
        assert_eq!(bytes_of(&[share - 1000, 1000]), share);
        assert_eq!(bytes_of(&[share - 1000, 1001]), 1001, "the older one makes room");
    }

    #[test]
    fn who_left_or_has_a_new_key_is_forgotten() {
        let mut witness = Witness::new(&roster(1));
        (0..4).for_each(|author| assert_eq!(observe(&mut witness, &vote(author, 1, 1.0), author), None));
        let mut after = members(2);
        after.robots.remove(&RobotId(0));
        after.robots.insert(RobotId(1), robot(11).public_key());
        witness.follow(&roster(1), &after.sign(&authority()).unwrap());
        let found = (0..4).map(|author| observe(&mut witness, &vote(author, 1, -1.0), author).is_some());
        assert_eq!(found.collect::<Vec<_>>(), [false, false, true, true]);
    }

    proptest! {
        /// Whatever is lost, repeated or overtaken on the way.
        #[test]
        fn an_honest_robot_is_never_accused(heard in prop::collection::vec((0..4_u32, 0..90_u32), 0..300)) {
            let mut witness = Witness::of(4);
            let signature = Signature::from_bytes([0; 64]);
            for (author, sequence) in heard {
                let said = vote(author, sequence, (7 * author + sequence) as f32);
                prop_assert_eq!(witness.observe(&said, &signature), None);
            }
        }

        #[test]
        fn a_liar_is_found_wherever_its_lie_stands_among_the_last_statements(
            honest in prop::collection::vec(0..1000_u32, 0..63), place in any::<prop::sample::Index>(),
        ) {
            let mut witness = Witness::of(4);
            let signature = Signature::from_bytes([0; 64]);
            let place = place.index(honest.len() + 1);
            for (number, sequence) in honest.iter().enumerate() {
                if number == place {
                    witness.observe(&vote(1, 5000, 1.0), &signature);
                }
                witness.observe(&vote(1, *sequence, 1.0), &signature);
            }
            witness.observe(&vote(1, 5000, 1.0), &signature);
            prop_assert!(witness.observe(&vote(1, 5000, -1.0), &signature).is_some());
        }
    }
}
