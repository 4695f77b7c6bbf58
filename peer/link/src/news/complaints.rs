//! How often it is said that something arrived which nobody can read: whoever may speak in a swarm may do so without an end.

use std::time::{Duration, Instant};

const PAUSE: Duration = Duration::from_secs(1);

/// Counts what is not said.
#[derive(Default)]
pub(super) struct Complaints {
    said: Option<Instant>,
    unsaid: u64,
}

impl Complaints {
    /// Notes one. If it is to be said: how many were not said since the last one that was.
    pub fn note(&mut self, now: Instant) -> Option<u64> {
        if self.said.is_some_and(|said| now.saturating_duration_since(said) < PAUSE) {
            self.unsaid += 1;
            return None;
        }
        self.said = Some(now);
        Some(std::mem::take(&mut self.unsaid))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_flood_one_a_second_is_said_with_how_many_were_before() {
        let (start, mut complaints) = (Instant::now(), Complaints::default());
        let said: Vec<u64> =
            (0..2500).filter_map(|ms| complaints.note(start + Duration::from_millis(ms))).collect();
        assert_eq!(said, [0, 999, 999]);
    }
}
