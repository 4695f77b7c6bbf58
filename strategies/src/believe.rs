//! By which right somebody's word counts.

use std::fmt::Debug;

use gestalt_protocol::{InstructorId, SignedWord};

/// By which right a word counts: the greater the more.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Standing {
    /// By none that could be shown to others: this robot remembers it from before its swarm was sealed, or who said it may do so no more. It counts
    /// here, as long as nobody else says anything, and is told to nobody.
    Unproven,
    /// A robot speaks for somebody without a key.
    Vouched,
    /// An instructor who may teach what nobody else has.
    Teaches,
    /// An instructor who may overrule others. In an open swarm everybody may.
    Overrules,
}

/// Knows in a sealed swarm who may teach, and who said what; `gestalt-link` has one, that goes by the roster.
pub trait Believe: Debug + Send + Sync {
    /// The count of that word, and by which right it was said in that name; `None` if it was not, or may not be.
    fn believe(&self, by: &InstructorId, said: &SignedWord) -> Option<(u64, Standing)>;
}
