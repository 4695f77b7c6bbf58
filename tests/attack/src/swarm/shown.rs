//! What becomes of a gesture that is shown.

use std::time::Duration;

/// A gesture that was shown, and what became of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shown {
    /// The gesture.
    pub class: u32,
    /// When it began to be shown.
    pub began: Duration,
    /// What each honest robot holds for it in the end: a gesture, or none.
    pub held: Vec<Option<u32>>,
    /// How long after it began the last announcement of a gesture that all hold came; `None` if none did.
    pub announced: Option<Duration>,
}
