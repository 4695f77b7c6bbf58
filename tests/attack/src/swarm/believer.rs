//! Whose words count by the roster, as in `gestalt-link`.

use std::collections::BTreeSet;

use gestalt_protocol::{InstructorId, RobotId, SignedWord};
use gestalt_strategies::{Believe, Standing};

use crate::trust::{Role, Roster, Speaker};

/// Knows who may teach.
#[derive(Debug)]
pub struct Believer {
    pub roster: Roster,
    pub convicted: BTreeSet<RobotId>,
}

impl Believe for Believer {
    fn believe(&self, by: &InstructorId, said: &SignedWord) -> Option<(u64, Standing)> {
        let (heading, roles) = self.roster.check_word(by, &said.word, Some(&said.attachment)).ok()?;
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
