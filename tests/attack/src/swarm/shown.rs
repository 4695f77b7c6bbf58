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
    /// How long after it began the first announcement of a gesture that any holds in the end came; `None` if none did.
    pub announced: Option<Duration>,
    /// The same of the first that was final.
    pub settled: Option<Duration>,
}

impl Shown {
    /// Whether any robot holds another gesture, whichever that is.
    #[must_use]
    pub fn is_wrong(&self) -> bool {
        self.held.iter().flatten().any(|held| *held != self.class)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::swarm::{Plan, Swarm};

    #[test]
    fn in_peace_what_is_shown_is_announced_as_final_in_the_end() {
        let mut swarm = Swarm::new(&Plan::open(), 1, true);
        swarm.show(1);
        let shown = &swarm.shown()[0];
        assert!(shown.announced.is_some() && shown.settled >= shown.announced, "{shown:?}");
    }

    #[test]
    fn any_other_gesture_is_wrong_and_none_is_not() {
        let shown = |held: &[Option<u32>]| Shown {
            class: 1,
            began: Duration::ZERO,
            held: held.to_vec(),
            announced: None,
            settled: None,
        };
        assert!(!shown(&[Some(1), None]).is_wrong());
        assert!(shown(&[Some(1), Some(2)]).is_wrong() && shown(&[Some(4), None]).is_wrong());
    }
}
