//! How well one robot is served: frames a second, and from a frame to its vote.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// How many of the latest delays are kept: ten seconds of a fast camera.
const KEPT: usize = 300;

/// The score of one robot's frames.
#[derive(Debug)]
pub(super) struct Tally {
    served: u64,
    delays: VecDeque<Duration>,
    before: (Instant, u64, u64),
}

/// How it went lately.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Lately {
    /// Frames a second that arrived.
    pub fps_received: f64,
    /// Frames a second that were looked at.
    pub fps_served: f64,
    /// From a frame's being taken to its vote: half are faster, and 99 of 100 are.
    pub delay: (Duration, Duration),
}

impl Tally {
    pub fn new(now: Instant) -> Self {
        Self { served: 0, delays: VecDeque::new(), before: (now, 0, 0) }
    }

    /// A frame was looked at, and what it said handed over that long after it was taken.
    pub fn served(&mut self, delay: Duration) {
        self.served += 1;
        if self.delays.len() == KEPT {
            self.delays.pop_front();
        }
        self.delays.push_back(delay);
    }

    /// The score since it was asked for last; `received` counts the frames that ever arrived. Delays are of the latest
    /// frames, however old.
    pub fn lately(&mut self, now: Instant, received: u64) -> Lately {
        let (then, received_then, served_then) =
            std::mem::replace(&mut self.before, (now, received, self.served));
        let seconds = now.saturating_duration_since(then).as_secs_f64().max(1e-3);
        let mut delays: Vec<Duration> = self.delays.iter().copied().collect();
        delays.sort();
        let quantile = |part: f64| {
            let rank = (delays.len().saturating_sub(1) as f64 * part).ceil() as usize;
            delays.get(rank).copied().unwrap_or_default()
        };
        Lately {
            fps_received: received.saturating_sub(received_then) as f64 / seconds,
            fps_served: (self.served - served_then) as f64 / seconds,
            delay: (quantile(0.5), quantile(0.99)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_of_the_time_since_and_delays_of_the_latest() {
        let start = Instant::now();
        let mut tally = Tally::new(start);
        (1..=100).for_each(|ms| tally.served(Duration::from_millis(ms)));
        let lately = tally.lately(start + Duration::from_secs(4), 120);
        assert_eq!((lately.fps_received, lately.fps_served), (30.0, 25.0));
        assert_eq!(lately.delay, (Duration::from_millis(51), Duration::from_millis(100)));
        let lately = tally.lately(start + Duration::from_secs(5), 120);
        assert_eq!((lately.fps_received, lately.fps_served), (0.0, 0.0));
    }

    #[test]
    fn what_is_kept_is_bounded() {
        let mut tally = Tally::new(Instant::now());
        (0..5000).for_each(|ms| tally.served(Duration::from_millis(ms)));
        assert_eq!(tally.delays.len(), KEPT);
    }
}
