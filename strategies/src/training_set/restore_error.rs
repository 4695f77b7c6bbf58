//! What a stored training set may be, if not one of this robot.

use gestalt_protocol::SampleId;
use thiserror::Error;

/// A stored set that contradicts itself. The training set is unchanged.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum RestoreError {
    /// Two samples have one key.
    #[error("two stored samples have the key {0}")]
    Key(u64),
    /// A key that is yet to be given out.
    #[error("stored sample {key} is newer than the next key, {next}")]
    KeyAhead {
        /// The sample's key.
        key: u64,
        /// The next key.
        next: u64,
    },
    /// A next key that no robot lives long enough to reach: with it, keys could run out.
    #[error("the stored next key, {0}, is out of range")]
    NextKey(u64),
    /// Two samples have one name.
    #[error("two stored samples have the name {0}")]
    Name(SampleId),
    /// A sample in a part that its name does not fit: a personal one has none, a shared one has this robot's, an
    /// external one another's.
    #[error("stored sample {0} is in a part that its name does not fit: was it stored by another robot?")]
    Part(u64),
    /// A sample with a name that was not seen.
    #[error("stored sample {0} is not among those seen")]
    Unseen(SampleId),
}
