//! Whose words count, by the roster.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use gestalt_protocol::{InstructorId, RobotId, SignedWord};
use gestalt_strategies::{Believe, Standing};
use gestalt_trust::{Role, Roster, Speaker};

/// Knows who may teach from the roster that is gone by, and which robots on it speak for nobody any more: they were proven to lie.
#[derive(Debug)]
pub(crate) struct Believer {
    pub roster: Roster,
    pub convicted: BTreeSet<RobotId>,
    pub me: RobotId,
    /// The highest count of a word that this robot signed for somebody.
    pub returned: Arc<AtomicU64>,
}

impl Believe for Believer {
    fn believe(&self, by: &InstructorId, said: &SignedWord) -> Option<(u64, Standing)> {
        let (heading, roles) = self.roster.check_word(by, &said.word, Some(&said.attachment)).ok()?;
        if heading.speaker == Speaker::For(self.me) {
            self.returned.fetch_max(heading.count, Ordering::Relaxed);
        }
        let standing = match heading.speaker {
            Speaker::For(robot) if self.convicted.contains(&robot) => return None,
            _ if !roles.has(Role::Teach) => return None,
            _ if roles.has(Role::Overrule) => Standing::Overrules,
            Speaker::Own(_) => Standing::Teaches,
            Speaker::For(_) => Standing::Vouched,
        };
        Some((heading.count, standing))
    }
}
