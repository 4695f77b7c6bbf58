//! How often a trial is begun, and what comes of it.

/// How often a trial is begun.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Attempts {
    /// Once.
    One,
    /// Once more, with nothing beside it, if it fails.
    Two,
}

impl Attempts {
    /// Makes them. `attempt` is told whether to be alone. What a trial that passed only alone first failed with.
    ///
    /// # Errors
    /// With what the last attempt failed with.
    pub(crate) fn make(self, attempt: impl Fn(bool) -> Result<(), String>) -> Result<Option<String>, String> {
        match (attempt(false), self) {
            (Ok(()), _) => Ok(None),
            (Err(cause), Self::Two) => attempt(true).map(|()| Some(cause)),
            (Err(cause), Self::One) => Err(cause),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use super::*;

    #[test]
    fn what_fails_is_tried_once_more_alone_and_what_fails_again_has_failed() {
        for (attempts, passes_at, made, comes_to) in [
            (Attempts::One, 1, 1, Ok(None)),
            (Attempts::Two, 1, 1, Ok(None)),
            (Attempts::One, 2, 1, Err("the 1st".to_owned())),
            (Attempts::Two, 2, 2, Ok(Some("the 1st".to_owned()))),
            (Attempts::Two, 3, 2, Err("the 2nd".to_owned())),
        ] {
            let alone = RefCell::new(Vec::new());
            let came_to = attempts.make(|is_alone| {
                alone.borrow_mut().push(is_alone);
                let (th, suffix) = (alone.borrow().len(), ["st", "nd"]);
                if th < passes_at { Err(format!("the {th}{}", suffix[th - 1])) } else { Ok(()) }
            });
            assert_eq!(came_to, comes_to);
            assert_eq!(*alone.borrow(), [false, true][..made]);
        }
    }
}
