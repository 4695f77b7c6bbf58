//! Which of two senders that stream for one robot is heard.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// So many earlier ones are known.
const KNOWN: usize = 8;

/// After so long an earlier one takes its place again: who is not answered sends a frame a second.
const SILENT: Duration = Duration::from_secs(3);

/// The starts of whatever streams for a robot, each known by its nonce. The latest is heard while it sends: who is started again takes its place at once. Who
/// goes on beside it, with the same id by mistake, shows another hand.
#[derive(Debug, Default)]
pub(crate) struct Senders {
    latest: Option<(u64, Instant)>,
    earlier: VecDeque<u64>,
}

impl Senders {
    /// Whether the one with that nonce, which sends now, goes on beside one that was started later. Such a one stays known, however often
    /// the other is started again.
    pub fn refuses(&mut self, nonce: u64, now: Instant) -> bool {
        let others = self.latest.filter(|(latest, _)| *latest != nonce);
        let Some((_, at)) = others else { return false };
        let known = self.earlier.iter().position(|earlier| *earlier == nonce);
        let Some(known) = known.filter(|_| now.saturating_duration_since(at) < SILENT) else { return false };
        self.earlier.remove(known);
        self.earlier.push_front(nonce);
        true
    }

    /// Whether the one with that nonce, which sends now, is to be heard. It is the latest then.
    pub fn hears(&mut self, nonce: u64, now: Instant) -> bool {
        if self.refuses(nonce, now) {
            return false;
        }
        match self.latest {
            Some((latest, _)) if latest == nonce => {}
            Some((latest, _)) => {
                self.earlier.retain(|earlier| *earlier != nonce);
                self.earlier.truncate(KNOWN - 1);
                self.earlier.push_front(latest);
            }
            None => {}
        }
        self.latest = Some((nonce, now));
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_is_started_again_is_heard_at_once_and_who_goes_on_beside_it_is_not() {
        let (mut senders, now) = (Senders::default(), Instant::now());
        assert!([1, 1, 2, 2, 3].into_iter().all(|nonce| senders.hears(nonce, now)));
        for second in 1..10 {
            let now = now + Duration::from_secs(second);
            assert!(![1, 2].into_iter().any(|nonce| senders.hears(nonce, now)) && senders.hears(3, now));
        }
    }

    #[test]
    fn who_goes_on_stays_known_however_often_the_other_is_started_again() {
        let (mut senders, now) = (Senders::default(), Instant::now());
        assert!(senders.hears(0, now));
        for nonce in 1..=3 * KNOWN as u64 {
            assert!(senders.hears(nonce, now) && !senders.hears(0, now), "{nonce}");
        }
        assert_eq!(senders.earlier.len(), KNOWN);
    }

    #[test]
    fn who_sends_no_more_keeps_nobody_else_out() {
        let (mut senders, now) = (Senders::default(), Instant::now());
        assert!(senders.hears(1, now) && senders.hears(2, now) && !senders.hears(1, now));
        let later = now + SILENT;
        assert!(senders.hears(1, later) && !senders.hears(2, later));
        assert_eq!(senders.earlier, [2]);
    }

    #[test]
    fn what_is_remembered_of_them_is_bounded() {
        let (mut senders, now) = (Senders::default(), Instant::now());
        assert!((0..1000).all(|nonce| senders.hears(nonce, now)));
        assert_eq!(senders.earlier, (991..999).rev().collect::<Vec<u64>>());
    }
}
