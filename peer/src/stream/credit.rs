//! When a frame may be sent: at most one is on its way, so that none ever waits in a queue.

use std::time::{Duration, Instant};

use gestalt_protocol::FrameTaken;

/// When nobody has acknowledged a frame for this long, it is lost, or nobody listens: the newest one is sent to find out.
pub const PROBE: Duration = Duration::from_secs(1);

/// The account of what one sender has under way.
#[derive(Clone, Debug)]
pub struct Credit {
    nonce: u64,
    sequence: u32,
    in_flight: Option<Instant>,
}

impl Credit {
    /// Nothing sent yet, in a start with this nonce.
    #[must_use]
    pub fn new(nonce: u64) -> Self {
        Self { nonce, sequence: 0, in_flight: None }
    }

    /// From when on the next frame may be sent; `None`: at once.
    #[must_use]
    pub fn waits_until(&self) -> Option<Instant> {
        self.in_flight.map(|sent| sent + PROBE)
    }

    /// Notes that a frame is sent now, and gives its sequence number.
    pub fn sent(&mut self, now: Instant) -> u32 {
        self.sequence = self.sequence.wrapping_add(1);
        self.in_flight = Some(now);
        self.sequence
    }

    /// Takes in an acknowledgement. One of an earlier frame, or of another start, allows nothing: the frame sent last is
    /// still under way. Says whether it was the awaited one.
    pub fn taken(&mut self, taken: &FrameTaken) -> bool {
        let awaited = taken.nonce == self.nonce && taken.sequence == self.sequence;
        awaited && self.in_flight.take().is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn taken(nonce: u64, sequence: u32) -> FrameTaken {
        FrameTaken { nonce, sequence, round: None }
    }

    #[test]
    fn the_next_frame_waits_for_the_one_before() {
        let now = Instant::now();
        let mut credit = Credit::new(5);
        assert_eq!(credit.waits_until(), None);
        let first = credit.sent(now);
        assert_eq!(credit.waits_until(), Some(now + PROBE));
        assert!(credit.taken(&taken(5, first)));
        assert_eq!(credit.waits_until(), None);
        assert!(!credit.taken(&taken(5, first)), "the same again");
    }

    #[test]
    fn only_the_frame_under_way_is_acknowledged() {
        let now = Instant::now();
        let mut credit = Credit::new(5);
        let first = credit.sent(now);
        let probe = credit.sent(now + PROBE);
        assert!(!credit.taken(&taken(5, first)) && !credit.taken(&taken(4, probe)));
        assert_eq!(credit.waits_until(), Some(now + 2 * PROBE));
        assert!(credit.taken(&taken(5, probe)));
    }
}
