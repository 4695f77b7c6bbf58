//! Remembers what was said, to notice who says two things.

use std::collections::{BTreeMap, VecDeque};

use gestalt_protocol::{MAX_ROBOTS, RobotId, Signature, Stamp};

use crate::evidence::Evidence;
use crate::signed::{MAX_EVIDENT, Signed};
use crate::statement;

/// How many statements of one author are remembered at most.
const STATEMENTS: usize = 64;

/// How many bytes of one author's statements are remembered at most.
const AUTHOR_BYTES: usize = 64 * 1024;

/// How many bytes of all authors' statements together.
const TOTAL_BYTES: usize = 16 * 1024 * 1024;

/// Remembers the statements of every author, the last 64 or 64 KiB of each, and finds two different ones under one stamp.
///
/// A lie is found if its halves come here with fewer statements of that author between them. All authors together fill at most
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
    /// One that listens to that many robots, from 1 to [`MAX_ROBOTS`].
    #[must_use]
    pub fn new(robots: usize) -> Self {
        let mut witness = Self { share: 0, authors: BTreeMap::new() };
        witness.resize(robots);
        witness
    }

    /// Listens to that many robots from now on, and forgets those that do not belong to the swarm any more, or that have a new key.
    pub fn keep(&mut self, robots: usize, stays: impl Fn(RobotId) -> bool) {
        self.authors.retain(|robot, _| stays(*robot));
        self.resize(robots);
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
        if full || statement.len() > self.share.min(MAX_EVIDENT) {
            return None;
        }
        let new = Signed { statement: statement.to_vec(), signature: *signature };
        let heard = self.authors.entry(heading.author).or_default();
        if let Some((_, held)) = heard.statements.iter().find(|(stamp, _)| *stamp == heading.stamp) {
            let differs = held.statement != new.statement;
            return differs.then(|| Evidence::new(held.clone(), new));
        }
        heard.shrink_to(STATEMENTS - 1, self.share - statement.len());
        heard.bytes += statement.len();
        heard.statements.push_back((heading.stamp, new));
        None
    }

    /// How many bytes of statements are remembered.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.authors.values().map(|heard| heard.bytes).sum()
    }
}

impl Heard {
    fn shrink_to(&mut self, statements: usize, bytes: usize) {
        while self.statements.len() > statements || self.bytes > bytes {
            let Some((_, gone)) = self.statements.pop_front() else { return };
            self.bytes -= gone.statement.len();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{have, robot, roster, vote};

    fn observe(witness: &mut Witness, statement: &[u8], by: u32) -> Option<Evidence> {
        witness.observe(statement, &statement::sign(&robot(by), &roster(1).swarm_id(), statement))
    }

    #[test]
    fn two_statements_under_one_stamp_are_evidence_of_whatever_kind() {
        for other in [vote(2, 5, -1.0), have(2, 5)] {
            let mut witness = Witness::new(4);
            assert_eq!(observe(&mut witness, &vote(2, 5, 1.0), 2), None);
            let evidence = observe(&mut witness, &other, 2).unwrap();
            assert_eq!(evidence.check(&roster(1)).unwrap().robot, RobotId(2));
            // In the other order it is the same evidence.
            let mut witness = Witness::new(4);
            observe(&mut witness, &other, 2);
            assert_eq!(observe(&mut witness, &vote(2, 5, 1.0), 2), Some(evidence));
        }
    }

    #[test]
    fn repeating_oneself_is_no_lie() {
        let mut witness = Witness::new(4);
        for _ in 0..100 {
            assert_eq!(observe(&mut witness, &vote(2, 5, 1.0), 2), None);
            assert_eq!(observe(&mut witness, &vote(3, 5, 2.0), 3), None, "another author");
            assert_eq!(observe(&mut witness, &vote(2, 6, 2.0), 2), None, "another stamp");
        }
    }

    #[test]
    fn the_last_64_statements_are_remembered_and_no_more() {
        let lie_after = |others: u32| {
            let mut witness = Witness::new(4);
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
        let mut witness = Witness::new(4);
        for sequence in 0..200 {
            witness.observe(&long(1, sequence, MAX_EVIDENT), &signature);
            assert!(witness.bytes() <= AUTHOR_BYTES);
        }
        witness.observe(&long(2, 0, MAX_EVIDENT + 1), &signature);
        assert_eq!(witness.bytes(), AUTHOR_BYTES, "too long to be remembered");
        let mut witness = Witness::new(MAX_ROBOTS);
        for author in 0..2 * MAX_ROBOTS as u32 {
            (0..3).for_each(|sequence| {
                witness.observe(&long(author, sequence, 2000), &signature);
            });
        }
        assert_eq!(witness.bytes(), MAX_ROBOTS * 2 * 2000);
        assert!(witness.bytes() <= TOTAL_BYTES);
        witness.keep(2, |robot| robot.0 < 2);
        assert_eq!(witness.bytes(), 2 * 2 * 2000);
    }
}
