//! How well one robot is served: frames per second, and from a frame to its vote.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// How many of the latest delays are kept: ten seconds of a fast camera.
const KEPT: usize = 300;

/// The account of one robot's frames.
#[derive(Debug)]
pub(super) struct Service {
    delays: VecDeque<Duration>,
    before: (Instant, u64),
}

/// How it went lately.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Lately {
    /// Frames per second that arrived.
    pub fps_received: f64,
    /// From a frame's being taken to its vote: half are faster, and 99 of 100 are.
    pub delay: (Duration, Duration),
}

impl Service {
    pub fn new(now: Instant) -> Self {
        Self { delays: VecDeque::new(), before: (now, 0) }
    }

    /// A frame was looked at, and what it said handed over that long after it was taken.
    pub fn served(&mut self, delay: Duration) {
        if self.delays.len() == KEPT {
            self.delays.pop_front();
        }
        self.delays.push_back(delay);
    }

    /// The account since it was asked for last; `received` counts the frames that ever arrived. Delays are of the latest
    /// frames, however old.
    pub fn lately(&mut self, now: Instant, received: u64) -> Lately {
        let (then, received_then) = std::mem::replace(&mut self.before, (now, received));
        let seconds = now.saturating_duration_since(then).as_secs_f64().max(1e-3);
        let mut delays: Vec<Duration> = self.delays.iter().copied().collect();
        delays.sort();
        let quantile = |part: f64| {
            let rank = (delays.len().saturating_sub(1) as f64 * part).ceil() as usize;
            delays.get(rank).copied().unwrap_or_default()
        };
        Lately {
            fps_received: received.saturating_sub(received_then) as f64 / seconds,
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
        let mut service = Service::new(start);
        (1..=100).for_each(|ms| service.served(Duration::from_millis(ms)));
        let lately = service.lately(start + Duration::from_secs(4), 120);
        assert_eq!(lately.fps_received, 30.0);
        assert_eq!(lately.delay, (Duration::from_millis(51), Duration::from_millis(100)));
        let lately = service.lately(start + Duration::from_secs(5), 120);
        assert_eq!(lately.fps_received, 0.0);
    }

    #[test]
    fn what_is_kept_is_bounded() {
        let mut service = Service::new(Instant::now());
        (0..5000).for_each(|ms| service.served(Duration::from_millis(ms)));
        assert_eq!(service.delays.len(), KEPT);
    }
}
