//! Why a robot does not believe a statement.

use thiserror::Error;

/// Why a statement is not believed. It changes nothing, but for the budget that checking it used up.
///
/// None of them blames who passed the statement on: the network passes on what it cannot judge.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Distrust {
    /// Without a signature.
    #[error("unsigned: its author runs without trust; give all robots of the swarm a key and the roster")]
    Unsigned,
    /// Bytes that are no statement, so they have no author.
    #[error("no statement: its author runs another release, or the bytes are junk")]
    Malformed,
    /// By a robot that is not on the roster, or not yet: this robot's roster may be old.
    #[error("its author is not on the roster: enrol it, or bring the newest roster here")]
    Stranger,
    /// By a robot that the authority has expelled.
    #[error("its author was expelled: enrol it anew with a new key, if it is to come back")]
    Expelled,
    /// By a key that was proven to lie.
    #[error("its author was caught in a lie: enrol it anew with a new key, if it is to come back")]
    Convicted,
    /// A word of an instructor that was heeded before, or is older than one that was.
    #[error("said before, or overtaken by a later word: it is heeded once")]
    Repeated,
    /// A frame that answers nothing which this robot asked since it started.
    #[error("it answers no challenge of today: recorded earlier, or its camera has not heard of it yet")]
    Unasked,
    /// More statements in that author's name than are checked.
    #[error("more in its author's name than is checked: it or somebody in its name floods the swarm")]
    TooFast,
    /// Not what the author's key signed in this swarm.
    #[error(
        "the signature is not its author's: forged, damaged on the way, or of another swarm or an older key"
    )]
    Forged,
}

impl Distrust {
    /// All causes.
    pub const ALL: [Self; 9] = [
        Self::Unsigned,
        Self::Malformed,
        Self::Stranger,
        Self::Expelled,
        Self::Convicted,
        Self::Repeated,
        Self::Unasked,
        Self::TooFast,
        Self::Forged,
    ];

    /// The cause in words, as the status names its counter.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Unsigned => "refused_unsigned",
            Self::Malformed => "refused_malformed_statement",
            Self::Stranger => "refused_stranger",
            Self::Expelled => "refused_expelled",
            Self::Convicted => "refused_convicted",
            Self::Repeated => "refused_repeated",
            Self::Unasked => "refused_unasked",
            Self::TooFast => "refused_too_fast",
            Self::Forged => "refused_forged",
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn every_cause_has_a_counter_of_its_own() {
        let names: BTreeSet<_> = Distrust::ALL.iter().map(|cause| cause.name()).collect();
        assert_eq!(names.len(), Distrust::ALL.len());
        assert!(names.iter().all(|n| n.bytes().all(|b| b.is_ascii_lowercase() || b == b'_')), "{names:?}");
    }
}
