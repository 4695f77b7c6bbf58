//! A robot's own votes, that come back.

use std::collections::VecDeque;

use gestalt_protocol::Stamp;

/// So many of its votes a robot remembers.
const KEPT: usize = 64;

/// What a robot voted since it started.
#[derive(Debug, Default)]
pub(crate) struct Echoes {
    hashes: VecDeque<u32>,
    last: Option<Stamp>,
}

impl Echoes {
    /// It said that.
    pub fn said(&mut self, stamp: Stamp, vote: &[u8]) {
        if self.hashes.len() == KEPT {
            self.hashes.pop_front();
        }
        self.hashes.push_back(crc32fast::hash(vote));
        self.last = Some(stamp);
    }

    /// Whether it said exactly that lately: Zenoh's routing can loop for a moment after a heal.
    pub fn is_one(&self, vote: &[u8]) -> bool {
        self.hashes.contains(&crc32fast::hash(vote))
    }

    /// Whether it may have said something of that stamp: now, in the start of number `boot`, or in one before. What is signed anybody can say again,
    /// long after.
    pub fn may_be_one(&self, stamp: Stamp, boot: u32) -> bool {
        self.last.map_or(stamp.boot < boot, |last| stamp <= last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_this_robot_may_have_said_itself_is_no_twins_vote() {
        let stamp = |boot, sequence| Stamp { boot, sequence };
        let silent = Echoes::default();
        let mut spoke = Echoes::default();
        spoke.said(stamp(7, 3), b"vote");
        assert!(spoke.is_one(b"vote") && !spoke.is_one(b"another") && !silent.is_one(b"vote"));
        for old in [stamp(1, u32::MAX), stamp(6, 900)] {
            assert!(silent.may_be_one(old, 7) && spoke.may_be_one(old, 7), "{old:?}");
        }
        assert!(spoke.may_be_one(stamp(7, 3), 7));
        for another in [stamp(7, 4), stamp(8, 0)] {
            assert!(!silent.may_be_one(another, 7) && !spoke.may_be_one(another, 7), "{another:?}");
        }
    }
}
