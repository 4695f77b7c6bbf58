//! Whose words count by the roster, as in `gestalt-link`.

use gestalt_protocol::{InstructorId, SignedWord};
use gestalt_strategies::{Believe, Standing};

use crate::trust::{Role, Roster, Speaker};

/// Knows who may teach.
#[derive(Debug)]
pub struct Believer(pub Roster);

impl Believe for Believer {
    fn believe(&self, by: &InstructorId, said: &SignedWord) -> Option<(u64, Standing)> {
        let (heading, roles) = self.0.check_word(by, &said.word, Some(&said.attachment)).ok()?;
        let standing = match heading.speaker {
            _ if !roles.has(Role::Teach) => return None,
            _ if roles.has(Role::Overrule) => Standing::Overrules,
            Speaker::Own(_) => Standing::Teaches,
            Speaker::For(_) => Standing::Vouched,
        };
        Some((heading.count, standing))
    }
}
