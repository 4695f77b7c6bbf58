//! What people call a gesture.

use std::collections::BTreeSet;

/// What a gesture is called that was named.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Called {
    /// By this robot.
    pub title: String,
    /// By others, that know of more or of fewer names.
    pub also: BTreeSet<String>,
}
