//! What fails, said at once and then at most once a second: a camera of 30 frames per second fails 30 times in one, and whoever may speak in a
//! swarm may say what nobody can read without an end.

use std::time::{Duration, Instant};

/// The time between two messages.
const PERIOD: Duration = Duration::from_secs(1);

/// Failures that were not told yet: the latest, and how many.
#[derive(Debug, Default)]
pub struct Complaints {
    told: Option<Instant>,
    kept: Option<(String, u64)>,
}

impl Complaints {
    /// Something failed.
    pub fn note(&mut self, cause: String) {
        let times = self.kept.take().map_or(0, |(_, times)| times);
        self.kept = Some((cause, times.saturating_add(1)));
    }

    /// The latest failure and how many there were since the last message, when it is time for one.
    pub fn due(&mut self, now: Instant) -> Option<(String, u64)> {
        if self.told.is_some_and(|told| now.saturating_duration_since(told) < PERIOD) {
            return None;
        }
        let kept = self.kept.take()?;
        self.told = Some(now);
        Some(kept)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_failure_is_said_at_once_and_the_others_once_a_second() {
        let start = Instant::now();
        let mut failures = Complaints::default();
        let mut said = Vec::new();
        for frame in 0..90u32 {
            let now = start + Duration::from_secs(1) * frame / 30;
            failures.note(format!("frame {frame}"));
            said.extend(failures.due(now));
        }
        let [first, second, third] = &said[..] else { panic!("{said:?}") };
        assert_eq!(*first, ("frame 0".to_owned(), 1));
        assert_eq!((second, third), (&("frame 30".to_owned(), 30), &("frame 60".to_owned(), 30)));
        // The last ones are said although no more come.
        assert_eq!(failures.due(start + Duration::from_secs(3)), Some(("frame 89".to_owned(), 29)));
        assert_eq!(failures.due(start + Duration::from_secs(9)), None);
    }
}
